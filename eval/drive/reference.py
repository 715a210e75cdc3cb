"""SUMO's own driver on the same mission: what its time is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import libsumo
import numpy as np

from hippodrome.eval.drive.missions import Mission
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M
from hippodrome.sim.loop.world import REFILL_STEPS, ROAM_PER_VEHICLE_M, STEP_S, WARM_UP_S, World
from hippodrome.sim.sumo_run import EGO, BackgroundTraffic, sumo_run
from hippodrome.sim.tour import tour_graph, toured_area
from hippodrome.sim.traffic import vehicle_types_xml

LONGEST_S: Final = 600.0
STANDING_MPS: Final = 0.1
FOREVER_S: Final = 1e6


def reference_time_s(world: World, mission: Mission) -> float | None:
    """Seconds that SUMO's driver takes from start to goal, in traffic of the same seed; None if it does not get there.

    SUMO runs once per process: the world is closed before, and resets anew afterwards.
    """
    world.close()
    scenario, network = world.scenario, world.network
    drive, graph = scenario.localization, tour_graph(network)
    mapped_m = (1.0 - scenario.mapping.tour.revisit_share) * scenario.mapping.tour.planned_length_m()
    area = toured_area(graph, max(mapped_m, ROAM_PER_VEHICLE_M * drive.traffic.vehicles))
    types = vehicle_types_xml(drive.ego.accel_mps2, drive.ego.decel_mps2, LENGTH_M)
    with sumo_run(world.town.net_file, types, mission.seed):
        others = BackgroundTraffic(drive.traffic, network, graph, area, np.random.default_rng([mission.seed, 0]), False)
        for step in range(round(WARM_UP_S / STEP_S)):
            if step % REFILL_STEPS == 0:
                others.refill(ego_on_road=False)
            libsumo.simulationStep()
        try:
            return _driven_s(mission, others, world.closed_roads)
        except (libsumo.TraCIException, ValueError):  # no route, or a goal too close to where a lane begins to stop there
            return None


def _edges(start: str, goal: str, is_behind: bool) -> tuple[str, ...]:
    """SUMO's quickest way; where the goal lies behind on the same road, round the block."""
    if start != goal or not is_behind:
        return tuple(libsumo.simulation.findRoute(start, goal, "ego").edges)
    lanes = (f"{start}_{k}" for k in range(libsumo.edge.getLaneNumber(start)))
    onward = sorted({link[0].rpartition("_")[0] for lane in lanes for link in libsumo.lane.getLinks(lane)})
    routes = [libsumo.simulation.findRoute(edge, goal, "ego") for edge in onward]
    best = min((route for route in routes if route.edges), key=lambda route: route.travelTime)
    return start, *best.edges


def _driven_s(mission: Mission, others: BackgroundTraffic, closed: Sequence[str]) -> float | None:
    for name in closed:
        libsumo.edge.adaptTraveltime(name, FOREVER_S)  # SUMO's driver knows what is closed
    start, goal = (lane.rpartition("_") for lane in (mission.start_lane, mission.goal_lane))
    libsumo.route.add("reference", _edges(start[0], goal[0], mission.goal_m <= mission.start_m))
    front_m = mission.start_m + REAR_AXLE_TO_FRONT_M
    libsumo.vehicle.add(EGO, "reference", typeID="ego", departLane=start[2], departPos=f"{front_m:.2f}", departSpeed="0")
    stop_m = min(mission.goal_m + REAR_AXLE_TO_FRONT_M, libsumo.lane.getLength(mission.goal_lane) - 0.2)
    libsumo.vehicle.setStop(EGO, goal[0], stop_m, int(goal[2]), LONGEST_S)
    entered = None
    for step in range(round(LONGEST_S / STEP_S)):
        if step % REFILL_STEPS == 0:
            others.refill(ego_on_road=True)
        libsumo.simulationStep()
        if EGO in libsumo.vehicle.getIDList():
            entered = step if entered is None else entered
            if libsumo.vehicle.isStopped(EGO) and libsumo.vehicle.getSpeed(EGO) < STANDING_MPS:
                return (step - entered) * STEP_S
        elif entered is not None:
            return None
    return None
