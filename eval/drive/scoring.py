"""What a mission scores, and what a row of missions does. Every figure's definition stands beside it, in ``DEFINITIONS``.

Success weighted by path length (SPL): Anderson et al., "On evaluation of embodied navigation agents" (2018). Driving score: that
of the CARLA leaderboard, completion times a penalty for each infraction, with the coefficients of its version 2.0 where it has
infraction, and those of a red light for a right of way, of an obstacle for a kerb.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.eval.drive.flight import Flight
from hippodrome.eval.drive.missions import Mission, by_length, pose_of, shortest_m
from hippodrome.sim.loop.types import EventKind

REACHED_M: Final = 3.0  # from the goal's place on its lane, the rear axle
MOVING_MPS: Final = 0.1
TYRE_M: Final = 0.05  # a tyre on the line is in the lane
HARSH_MPS2: Final = 3.0  # braking and speeding up that passengers complain of
PENALTIES: Final = {  # CARLA leaderboard 2.0
    EventKind.COLLISION: 0.60,  # with a vehicle
    EventKind.BUILDING: 0.65,  # with a static object
    EventKind.KERB: 0.65,
    EventKind.RED_LIGHT: 0.70,
    EventKind.RIGHT_OF_WAY: 0.70,
}
DEFINITIONS: Final = {
    "missions": "missions driven",
    "success_rate": "share that stood within 3 m of the goal's place, on its lane, and said so themselves",
    "success_rate_mapped": "the same, goals on streets that the map knows",
    "success_rate_unmapped": "the same, goals on streets that the map does not know",
    "spl": "mean of success x shortest way / max(driven, shortest way), Anderson et al. 2018",
    "driving_score": "mean of completion x product of penalties, of 100 (CARLA leaderboard 2.0: vehicle .60, static or kerb .65, "
    "red light .70, right of way .70)",
    "collisions_at_fault": "collisions with vehicles that were the ego's fault, in all missions",
    "wrong_way": "times that the ego drove against its lane's direction",
    "false_arrivals": "times that an arrival was said elsewhere than at the goal",
    "red_lights": "red lights run",
    "rights_of_way": "rights of way taken",
    "outside_lane_share": "share of the time with a wheel outside of the lane; in junctions and turning round, off the paving",
    "lane_rms_m": "distance of the rear axle from the lane's middle outside of junctions, root mean square",
    "lane_worst_m": "the same, largest",
    "time_ratio": "time of successful missions over that of SUMO's own driver on them, mean",
    "metres_until_localized": "way driven before the first fix, mean over missions that had one",
    "realtime_factor": "simulated seconds per second of CPU, with drawing, SUMO and scoring",
    "minimum_gap_m": "least gap to a road user ahead while driving",
    "harsh_share": "share of the time braking or speeding up by more than 3 m/s^2",
    "per_km": "events per driven kilometre, by kind",
}


def mission_result(mission: Mission, flight: Flight, network: RoadNetwork, reference_s: float | None) -> dict[str, Any]:
    """The figures of one mission, as plain data that the seed determines.

    Args:
        mission: what was to be done.
        flight: what happened.
        network: the roads as they are.
        reference_s: time of SUMO's own driver; None where it did not get there.
    """
    end = tuple(float(flight.column(name)[-1]) for name in ("x_m", "y_m"))
    goal = pose_of(network, mission.goal_lane, mission.goal_m)
    apart_m = math.dist(end, goal[:2])
    there = apart_m <= REACHED_M and flight.end_lane == mission.goal_lane
    success = flight.arrived and there
    driven_m, time_s = float(flight.column("driven_m")[-1]), float(flight.column("t_s")[-1])
    moving, road = np.abs(flight.column("speed_mps")) > MOVING_MPS, flight.column("in_junction") == 0.0
    aside = np.abs(flight.column("offset_m")[moving & road])
    aside = aside[np.isfinite(aside)]
    fixed = np.flatnonzero(flight.column("localized") > 0.0)
    gaps = flight.column("gap_m")[moving & np.isfinite(flight.column("gap_m"))]
    penalty = math.prod(PENALTIES.get(event.kind, 1.0) for event in flight.events if event.at_fault)
    completion = 1.0 if success else _completion(mission, flight, network)
    cause = "arrived" if success else ("said so elsewhere" if flight.arrived else flight.cause)
    return {
        **mission.as_json(),
        "start": f"{mission.start_lane} {mission.start_m:.1f} m",
        "goal": f"{mission.goal_lane} {mission.goal_m:.1f} m",
        "end": f"{flight.end_lane or 'off the road'} {apart_m:.1f} m from the goal",
        "cause": cause,
        "success": success,
        "false_arrival": flight.arrived and not there,
        "apart_m": apart_m,
        "driven_m": driven_m,
        "time_s": time_s,
        "reference_s": reference_s,
        "spl": float(success) * mission.shortest_m / max(driven_m, mission.shortest_m),
        "driving_score": 100.0 * completion * penalty,
        "completion": completion,
        "events": dict(sorted(Counter(f"{event.kind.value}{'' if event.at_fault else ' of others'}"
                                      for event in flight.events).items())),
        "outside_lane_share": float(np.mean(flight.column("wheel_outside_m") > TYRE_M)),
        "lane_rms_m": float(np.sqrt(np.mean(aside**2))) if len(aside) else None,
        "lane_worst_m": float(aside.max()) if len(aside) else None,
        "metres_until_localized": float(flight.column("driven_m")[fixed[0]]) if len(fixed) else None,
        "minimum_gap_m": float(gaps.min()) if len(gaps) else None,
        "harsh_share": float(np.mean(np.abs(flight.column("acceleration_mps2")) > HARSH_MPS2)),
    }  # fmt: skip


def _completion(mission: Mission, flight: Flight, network: RoadNetwork) -> float:
    """How much of the shortest way was done: what is left of it from the end, against the whole."""
    if not flight.end_lane:
        return 0.0
    end = network.lane_ids.index(flight.end_lane), float(flight.column("lane_m")[-1])
    goal = network.lane_ids.index(mission.goal_lane), mission.goal_m
    left_m = shortest_m(by_length(network), end, goal, frozenset())
    return max(0.0, 1.0 - left_m / mission.shortest_m) if math.isfinite(left_m) else 0.0


def row_result(missions: Sequence[dict[str, Any]], realtime_factor: float | None) -> dict[str, Any]:
    """The figures of a row, ``drive`` in ``results.json``."""
    km = sum(one["driven_m"] for one in missions) / 1e3
    events: Counter[str] = Counter()
    for one in missions:
        events.update(one["events"])
    ratios = [one["time_s"] / one["reference_s"] for one in missions if one["success"] and one["reference_s"]]
    total_s = sum(one["time_s"] for one in missions)
    return {
        "missions": len(missions),
        "success_rate": _mean(missions, "success"),
        "success_rate_mapped": _mean([one for one in missions if one["mapped"]], "success"),
        "success_rate_unmapped": _mean([one for one in missions if not one["mapped"]], "success"),
        "spl": _mean(missions, "spl"),
        "driving_score": _mean(missions, "driving_score"),
        "collisions_at_fault": events[EventKind.COLLISION.value],
        "wrong_way": events[EventKind.WRONG_WAY.value],
        "false_arrivals": sum(one["false_arrival"] for one in missions),
        "red_lights": events[EventKind.RED_LIGHT.value],
        "rights_of_way": events[EventKind.RIGHT_OF_WAY.value],
        "outside_lane_share": sum(one["outside_lane_share"] * one["time_s"] for one in missions) / max(total_s, 1e-9),
        "lane_rms_m": _mean(missions, "lane_rms_m"),
        "lane_worst_m": max((one["lane_worst_m"] for one in missions if one["lane_worst_m"] is not None), default=None),
        "time_ratio": float(np.mean(ratios)) if ratios else None,
        "metres_until_localized": _mean(missions, "metres_until_localized"),
        "minimum_gap_m": min((one["minimum_gap_m"] for one in missions if one["minimum_gap_m"] is not None), default=None),
        "harsh_share": _mean(missions, "harsh_share"),
        "driven_km": km,
        "per_km": {kind: count / max(km, 1e-9) for kind, count in sorted(events.items())},
        "realtime_factor": realtime_factor,
        "definitions": DEFINITIONS,
        "missions_detail": list(missions),
    }


def _mean(missions: Sequence[dict[str, Any]], key: str) -> float | None:
    """The mean of a figure over the missions that have it."""
    values = [float(one[key]) for one in missions if one[key] is not None]
    return float(np.mean(values)) if values else None
