"""Leads SUMO's ego through its tour: the route, the speed in bends, another way where a turn was missed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import libsumo
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, IntArray
from hippodrome.sim.blockage import clear_around, ego_is_waiting, red_signal, send_ego_again, what_holds_ego
from hippodrome.sim.ego_spec import REAR_AXLE_TO_FRONT_M, EgoSpec
from hippodrome.sim.ego_speed import comfortable_speed_mps
from hippodrome.sim.lane_log import LaneLog, driven_edges, lane_pieces, lanes_ahead, ways_out, ways_to_edge
from hippodrome.sim.path import STEP_M, Piece, piece_of_samples, piece_starts, smooth_path
from hippodrome.sim.sumo_run import EGO, SUMO_STEP_S, BackgroundTraffic, add_vehicle, drawn_length_factors
from hippodrome.sim.tour import TourGraph, plan_tour
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.types import TrafficLog

WARM_UP_S: Final = 20.0  # traffic spreads before the ego enters
ENTRY_PATIENCE_S: Final = 120.0  # for a gap to enter the road
CLEARED_AFTER_S: Final = 20.0  # so long traffic is waited for at the entrance; then it is taken away there
STUCK_AFTER_S: Final = 180.0  # longer than a red light; at a light twice as long is waited
MOST_CLEARINGS: Final = 20  # in one drive: each costs three minutes, and a network that needs more of them is not drivable
SIGHT_AHEAD_M: Final = 80.0  # braking from 50 km/h at 2 m/s^2 takes 50 m
SIGHT_BEHIND_M: Final = 15.0  # the bend that the rear axle is still in
REFILL_STEPS: Final = 10  # traffic is topped up once a second
LAST_CHANCE_M: Final = 8.0  # a turn is given up this long before the car would have to stop for it
LAST_EDGE_M: Final = 60.0  # a tour that is not done is planned on this long before its end
COUNTED_OTHERWISE: Final = 0.1  # beyond it a network's own lengths of its lanes are meant to differ from the drawing
SLOWEST_SCALE: Final = 0.1  # metres drawn per metre counted; lanes below it are points
SPARE_M: Final = 200.0  # planned beyond the tour's length, so that SUMO's ego does not leave the road before


@dataclass(slots=True)
class DriveLog:
    """What is written down at each SUMO step while the ego is on the road."""

    lane: list[int] = field(default_factory=list)
    position_m: list[float] = field(default_factory=list)  # of the front bumper, along the lane as drawn
    speed_mps: list[float] = field(default_factory=list)
    start: list[int] = field(default_factory=lambda: [0])
    vehicle: list[int] = field(default_factory=list)
    poses_m: list[tuple[float, ...]] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)

    def lanes(self, last: int = 0) -> LaneLog:
        """The ego's part, of the ``last`` steps or of all."""
        return LaneLog(np.array(self.lane[-last:]), np.array(self.position_m[-last:]), np.array(self.speed_mps[-last:]))

    def traffic(self) -> TrafficLog:
        return TrafficLog(
            t_s=np.arange(len(self.lane), dtype=np.float64) * SUMO_STEP_S,
            start=np.array(self.start, dtype=np.int32),
            vehicle=np.array(self.vehicle, dtype=np.int32),
            poses_m=np.array(self.poses_m, dtype=np.float64).reshape(-1, len(self.poses_m[0]) if self.poses_m else 3),
            kind=np.array(self.kind, dtype=np.uint8),
        )


class Pilot:
    """Drives one tour in the running simulation. It holds what changes from step to step; results are in its log."""

    def __init__(
        self, network: RoadNetwork, graph: TourGraph, area: IntArray, tour: TourSpec, ego: EgoSpec, rng: np.random.Generator
    ) -> None:
        self._network, self._graph, self._area, self._tour, self._ego, self._rng = network, graph, area, tour, ego, rng
        self._lane_number = {name: i for i, name in enumerate(network.lane_ids)}
        self._lengths_m, self._length_factors = network.lane_lengths_m(), drawn_length_factors(network)
        self._drawn_share = _drawn_share(network, self._length_factors)
        self._counted_m, self._driven_m = 0.0, 0.0  # since the start, as SUMO counts and as drawn
        self._route: list[int] = []  # edges of the network
        self._leads_on = True  # the present lane leads to the route's next edge
        self._cap_mps, self._cap_offset_m = np.zeros(1), 0.0
        self._clearings = 0
        self._entries: list[int] = []  # steps at which the view ahead was renewed, in general on a new lane
        self._log = DriveLog()

    def drive(self, others: BackgroundTraffic) -> DriveLog:
        """Until the tour is done. Raises HippodromeError where the ego cannot enter the road or go on."""
        self._enter(others)
        standing_steps = 0
        while EGO in libsumo.vehicle.getIDList():
            if self._is_done():
                return self._log
            self._write_down(others)
            if len(self._log.lane) == 1 or self._log.lane[-1] != self._log.lane[-2]:
                self._look_ahead()
            if self._turn_is_missed() or self._route_ends():
                self._replan()
            self._set_speed()
            standing_steps = standing_steps + 1 if self._log.speed_mps[-1] < 0.1 else 0
            standing_s = standing_steps * SUMO_STEP_S
            if standing_s > 2.0 * STUCK_AFTER_S or (standing_s > STUCK_AFTER_S and not red_signal()):
                self._free(standing_s)
                standing_steps = 0
            if len(self._log.lane) % REFILL_STEPS == 0:
                others.refill(ego_on_road=True)
            libsumo.simulationStep()
        last = self._network.edge_ids[self._network.lane_edge[self._log.lane[-1]]]
        raise HippodromeError(
            f"edge {last}: SUMO took the ego off the road before its tour was done; set another seed, or check it in netedit"
        )

    def _free(self, standing_s: float) -> None:
        """Traffic in a knot with the ego is taken off the road. Raises HippodromeError where it is not traffic that holds it."""
        edge = libsumo.vehicle.getRoadID(EGO)
        if red_signal() or clear_around(*libsumo.vehicle.getPosition(EGO)) == 0:
            raise HippodromeError(f"edge {edge}: the ego has been standing for {standing_s:.0f} s: {what_holds_ego()}")
        self._clearings += 1
        if self._clearings > MOST_CLEARINGS:
            raise HippodromeError(
                f"edge {edge}: traffic had to be taken away round the ego {MOST_CLEARINGS} times and it stands again for "
                f"{STUCK_AFTER_S:.0f} s; lower traffic.vehicles"
            )

    def _enter(self, others: BackgroundTraffic) -> None:
        """Lets traffic spread, then waits for the ego's place on the road, and makes room where there is none for long."""
        self._route = self._network_edges(plan_tour(self._graph, self._area, self._plan_length_m(), self._rng))
        for step in range(round((WARM_UP_S + ENTRY_PATIENCE_S) / SUMO_STEP_S)):
            if step == round(WARM_UP_S / SUMO_STEP_S):
                add_vehicle(EGO, "ego", self._network, self._route, "base")
            elif step % REFILL_STEPS == 0:
                sent_s = step * SUMO_STEP_S - WARM_UP_S
                others.refill(ego_on_road=sent_s > 0.0)
                if sent_s > 0.0 and not ego_is_waiting():
                    if sent_s > CLEARED_AFTER_S:
                        clear_around(*self._entrance_m())
                    send_ego_again()
            libsumo.simulationStep()
            if EGO in libsumo.vehicle.getIDList():
                return
        edge = self._network.edge_ids[self._route[0]]
        raise HippodromeError(
            f"edge {edge}: SUMO lets the ego not begin there within {ENTRY_PATIENCE_S:.0f} s, though traffic was taken away; "
            f"set another seed, or check the lanes of this edge in netedit"
        )

    def _entrance_m(self) -> tuple[float, float]:
        """Where the ego's route begins."""
        lane = int(np.flatnonzero(self._network.lane_edge == self._route[0])[0])
        x_m, y_m = self._network.lane_points_m(lane)[0]
        return float(x_m), float(y_m)

    def _plan_length_m(self) -> float:
        if self._tour.length_m is None and self._tour.duration_s is not None:
            return self._tour.duration_s * float(self._network.speed_limit_mps.max()) + SPARE_M
        return self._tour.planned_length_m() + SPARE_M

    def _is_done(self) -> bool:
        if self._tour.duration_s is not None and len(self._log.lane) * SUMO_STEP_S > self._tour.duration_s:
            return True
        by_time_only = self._tour.length_m is None and self._tour.duration_s is not None
        return not by_time_only and self._way_m() >= self._tour.planned_length_m()

    def _way_m(self) -> float:
        """What the ego has driven. Where SUMO counts other metres than are drawn, each lane's are turned into drawn ones."""
        counted_m = float(libsumo.vehicle.getDistance(EGO))
        if self._drawn_share == 1.0 or not self._log.lane:
            return counted_m
        self._driven_m += (counted_m - self._counted_m) * float(self._length_factors[self._log.lane[-1]])
        self._counted_m = counted_m
        return self._driven_m

    def _write_down(self, others: BackgroundTraffic) -> None:
        name = libsumo.vehicle.getLaneID(EGO)
        lane = self._lane_number.get(name)
        if lane is None:
            raise HippodromeError(f"lane {name}: SUMO led the ego there though it is closed to passenger cars; check the network")
        log = self._log
        log.lane.append(lane)
        log.position_m.append(libsumo.vehicle.getLanePosition(EGO) * float(self._length_factors[lane]))
        log.speed_mps.append(libsumo.vehicle.getSpeed(EGO))
        ids, poses, kinds = others.near(*libsumo.vehicle.getPosition(EGO))
        log.vehicle.extend(ids)
        log.poses_m.extend(poses)
        log.kind.extend(kinds)
        log.start.append(len(log.vehicle))

    def _look_ahead(self) -> None:
        """On a new lane: the comfortable speed along it and what follows."""
        lane, onward = self._log.lane[-1], self._onward_edges()
        pieces, _ = lane_pieces(self._network, self._log.lanes(self._steps_behind()), lengths_m=self._lengths_m)
        here = pieces[-1]
        pieces[-1] = Piece(lane, here.begin_m, float(self._lengths_m[lane]), here.side_step, here.speed_mps)
        ahead = lanes_ahead(self._network, lane, onward, SIGHT_AHEAD_M)
        self._cap_offset_m = float(piece_starts(pieces)[-2]) - here.begin_m - REAR_AXLE_TO_FRONT_M
        pieces += [Piece(each, 0.0, float(self._lengths_m[each]), False, here.speed_mps) for each in ahead]
        lanes = np.array([piece.lane for piece in pieces])[piece_of_samples(pieces)]
        limit = self._network.speed_limit_mps[lanes]
        self._cap_mps = comfortable_speed_mps(smooth_path(self._network, pieces), limit, self._ego)
        on_road = not self._network.is_internal[lane]
        self._leads_on = not on_road or not onward or bool(ways_to_edge(self._network, lane, onward[0]))

    def _steps_behind(self) -> int:
        """How many of the last steps show the bend that the car's rear is still in."""
        self._entries.append(len(self._log.lane) - 1)
        behind_m, k = 0.0, len(self._entries) - 1
        while k > 0 and behind_m < SIGHT_BEHIND_M:
            k -= 1
            behind_m += float(self._lengths_m[self._log.lane[self._entries[k]]])
        return len(self._log.lane) - self._entries[k]

    def _set_speed(self) -> None:
        """No faster than what the rear axle's place on the path allows; SUMO adds right of way and the cars ahead."""
        where = (self._log.position_m[-1] + self._cap_offset_m) / STEP_M
        k = min(max(int(where), 0), len(self._cap_mps) - 1)
        scale = 1.0 if self._drawn_share == 1.0 else max(float(self._length_factors[self._log.lane[-1]]), SLOWEST_SCALE)
        libsumo.vehicle.setSpeed(EGO, float(self._cap_mps[k]) / scale)

    def _turn_is_missed(self) -> bool:
        """On a lane that does not lead where the route goes, too near its end to change."""
        if self._leads_on:
            return False
        left_m = float(self._lengths_m[self._log.lane[-1]]) - self._log.position_m[-1]
        braking_m = self._log.speed_mps[-1] ** 2 / (2.0 * self._ego.decel_mps2)
        return left_m < braking_m + LAST_CHANCE_M

    def _route_ends(self) -> bool:
        """On the last edge of the route, near its end, though the tour is not done: SUMO counts the lanes shorter than drawn."""
        lane = self._log.lane[-1]
        if self._network.is_internal[lane] or self._onward_edges():
            return False
        return float(self._lengths_m[lane]) - self._log.position_m[-1] < LAST_EDGE_M

    def _replan(self) -> None:
        """The rest of the tour anew, from where the present lane leads; with no such place SUMO must get the lane change done."""
        number = {int(edge): k for k, edge in enumerate(self._graph.edges)}
        lane = self._log.lane[-1]
        after = [number.get(int(self._network.lane_edge[way[-1]]), -1) for way in ways_out(self._network, lane)]
        reachable = sorted({edge for edge in after if edge >= 0})
        if not reachable:
            return
        pieces, distance = lane_pieces(self._network, self._log.lanes(), lengths_m=self._lengths_m)
        edges = [number[edge] for edge in driven_edges(self._network, pieces) if edge in number]
        visits = np.bincount(edges, minlength=len(self._graph.edges)).astype(np.int32)
        start = min(reachable, key=lambda edge: (edge not in self._area, visits[edge]))
        left_m = max(self._plan_length_m() - float(distance[-1]), SPARE_M)
        rest = plan_tour(self._graph, self._area, left_m, self._rng, visits, start)
        self._route = [int(self._network.lane_edge[lane]), *self._network_edges(rest)]
        libsumo.vehicle.setRoute(EGO, [self._network.edge_ids[edge] for edge in self._route])
        self._look_ahead()

    def _onward_edges(self) -> list[int]:
        """The route after the edge that the ego is on or has just left."""
        return self._route[libsumo.vehicle.getRouteIndex(EGO) + 1 :]

    def _network_edges(self, tour: IntArray) -> list[int]:
        return [int(edge) for edge in self._graph.edges[tour]]


def _drawn_share(network: RoadNetwork, factors: FloatArray) -> float:
    """Metres drawn per metre that SUMO counts, over all roads; 1 where the two agree about as well as they do in any network."""
    drawn_m = np.where(network.is_internal, 0.0, network.lane_lengths_m())
    share = float(drawn_m.sum() / (drawn_m / factors).sum())
    return share if abs(share - 1.0) > COUNTED_OTHERWISE else 1.0
