"""Who is coming to the junction ahead of the ego, and whether the ego may drive in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import libsumo
import numpy as np

from hippodrome.sim.ego_spec import LENGTH_M
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.users import Users

SIGHT_M: Final = 90.0  # so far from its junction a vehicle is seen coming: nine seconds at 10 m/s
LINKS_AHEAD: Final = 3  # junctions that a vehicle is followed through: short streets between split junctions
LANES_INSIDE: Final = 4  # in a row, in a junction: netconvert makes up to three, and the road is one more
PATIENCE_S: Final = 5.0  # whoever stands so long at the junction, though he might go, waits for somebody else
MARGIN_S: Final = 1.0  # between the ego's rear and the next vehicle
FOE_ACCEL_MPS2: Final = 1.0  # others may become this much faster on their way
OWN_ACCEL_MPS2: Final = 1.5  # with which the ego is taken to drive through
OWN_BRAKING_MPS2: Final = 2.0  # and to brake before a bend
STRAIGHT_MPS, BEND_MPS = 8.0, 4.5  # and the speeds at which it is taken to do so
BEND_RAD: Final = math.radians(35.0)
TURN_RADPS: Final = 0.5  # through sharp corners a car creeps: its wheels have to be turned meanwhile
STANDS_MPS: Final = 0.3


@dataclass(frozen=True, slots=True)
class Comer:
    """A vehicle on its way into a junction, or in it.

    Args:
        name: SUMO's.
        row: in the list of users.
        lane: the lane inside the junction that it takes.
        distance_m: of its front from the junction; negative inside.
        rest_m: to where its rear leaves the junction.
        speed_mps: now.
        held: a red or yellow signal keeps it out.
        waiting_s: so long it has been standing.
        most_mps: the highest speed that its driver takes the road to allow.
    """

    name: str
    row: int
    lane: int
    distance_m: float
    rest_m: float
    speed_mps: float
    held: bool
    waiting_s: float
    most_mps: float = math.inf

    @property
    def is_inside(self) -> bool:
        return self.distance_m < 0.0

    def arrival_s(self) -> float:
        """Until it is at the junction, if it becomes as fast as it may."""
        most_mps = max(self.most_mps, self.speed_mps, STANDS_MPS)
        return 0.0 if self.is_inside else _drive_s(self.distance_m, self.speed_mps, most_mps, FOE_ACCEL_MPS2)

    def gone_s(self) -> float:
        """Until it has left the junction, if it goes on as fast as now."""
        return self.rest_m / self.speed_mps if self.speed_mps > STANDS_MPS else math.inf


def comers(
    junction: str,
    users: Users,
    ego_m: tuple[float, float],
    rights: Rights,
    lane_of: Mapping[str, int],
    lengths_m: Sequence[float],
) -> list[Comer]:
    """The vehicles near the ego that are in a junction or drive to it.

    Args:
        junction: SUMO's name.
        users: vehicles near the ego.
        ego_m: where the ego is.
        rights: of the network.
        lane_of: lanes by name.
        lengths_m: of the lanes.
    """
    found = []
    near = np.hypot(users.poses_m[:, 0] - ego_m[0], users.poses_m[:, 1] - ego_m[1]) < SIGHT_M + 30.0
    for row in np.flatnonzero(near).tolist():
        name, length = users.names[row], float(users.sizes_m[row, 0])
        here, along = libsumo.vehicle.getLaneID(name), libsumo.vehicle.getLanePosition(name)
        if here.startswith(":"):
            lane = lane_of.get(here, -1)
            if rights.junction_of.get(lane) == junction:
                rest = lengths_m[lane] - along + length
                found.append(Comer(name, row, lane, -along - 1e-6, rest, float(users.speed_mps[row]), False, 0.0))
                continue
        way = _way_to(junction, name, here, along, rights, lane_of)
        if way is not None:
            lane, distance, state = way
            waiting = float(libsumo.vehicle.getWaitingTime(name))
            rest = distance + lengths_m[lane] + length
            most, speed = float(libsumo.vehicle.getAllowedSpeed(name)), float(users.speed_mps[row])
            found.append(Comer(name, row, lane, distance, rest, speed, state in "rRuyY", waiting, most))
    return found


def _way_to(
    junction: str, name: str, here: str, along_m: float, rights: Rights, lane_of: Mapping[str, int]
) -> tuple[int, float, str] | None:
    """The lane inside the junction that a vehicle will take, its way to there, and the letter of the signal before it."""
    distance = _to_links_m(here) - along_m if here else math.inf
    for onward, _, _, _, via, state, _, length in libsumo.vehicle.getNextLinks(name)[:LINKS_AHEAD]:
        if distance > SIGHT_M:
            return None
        lane = lane_of.get(via, -1)
        if rights.junction_of.get(lane) == junction:
            return lane, max(distance, 0.0), state
        distance += length + libsumo.lane.getLength(onward)
    return None


def _to_links_m(lane: str) -> float:
    """From the beginning of a lane to the first of SUMO's next links: these begin at the end of the road.

    For who is inside a junction that is the end of the road after it, which SUMO's list does not have.
    """
    length = float(libsumo.lane.getLength(lane))
    for _ in range(LANES_INSIDE):
        links = libsumo.lane.getLinks(lane) if lane.startswith(":") else ()
        if not links:
            break
        lane = links[0][4] or links[0][0]  # the next lane inside, or the one beyond
        length += float(libsumo.lane.getLength(lane))
    return length


@dataclass(frozen=True, slots=True)
class Entry:
    """The ego before a junction.

    Args:
        lane: the first lane inside that it means to take.
        line_m: from the front bumper to the junction.
        way_m: length of the way through.
        turn_rad: how far it turns.
        speed_mps: now.
        signal: SUMO's letter of the ego's lamp, empty without one.
    """

    lane: int
    line_m: float
    way_m: float
    turn_rad: float
    speed_mps: float
    signal: str

    def enter_s(self) -> float:
        """Until the front is in the junction."""
        return _drive_s(max(self.line_m, 0.0), self.speed_mps, STRAIGHT_MPS)

    def clear_s(self) -> float:
        """Until the rear has left it, braking before a bend and going through it no faster than it allows."""
        v, line_m, over_m = self.speed_mps, max(self.line_m, 0.0), self.way_m + LENGTH_M
        top, there = self._through_mps(), min(math.sqrt(v * v + 2.0 * OWN_ACCEL_MPS2 * line_m), STRAIGHT_MPS)
        if there <= top:
            return _drive_s(line_m + over_m, v, top)
        return self.enter_s() + (there - top) ** 2 / (2.0 * OWN_BRAKING_MPS2 * there) + over_m / top

    def _through_mps(self) -> float:
        """The speed through the junction."""
        if abs(self.turn_rad) <= BEND_RAD:
            return STRAIGHT_MPS
        return min(BEND_MPS, TURN_RADPS * self.way_m / abs(self.turn_rad))


def _drive_s(way_m: float, speed_mps: float, top_mps: float, accel_mps2: float = OWN_ACCEL_MPS2) -> float:
    """Time over a way, from a speed up to the highest one."""
    v, a = min(speed_mps, top_mps), accel_mps2
    gaining_m = (top_mps**2 - v**2) / (2.0 * a)
    if way_m < gaining_m:
        return (math.sqrt(v * v + 2.0 * a * way_m) - v) / a
    return (top_mps - v) / a + (way_m - gaining_m) / top_mps


def in_the_way(entry: Entry, others: Sequence[Comer], rights: Rights) -> list[Comer]:
    """Those for whom the ego has to wait before it enters.

    They have the right of way and would meet the ego in the junction or within a second of it; or they are in the junction, cross
    the ego's way, and will still be there. Where the ego's lamp shows the green that has the right of way, only the latter count.
    Somebody who stands at the junction for five seconds though he may go is not waited for: he waits for somebody else.
    """
    if entry.signal and entry.signal in "rRuyY":
        return []
    enter, clear = entry.enter_s(), entry.clear_s()
    return [comer for comer in others if _meets(comer, entry, enter, clear, rights)]


def _meets(comer: Comer, entry: Entry, enter_s: float, clear_s: float, rights: Rights) -> bool:
    first = rights.must_yield(entry.lane, comer.lane) and entry.signal != "G"
    if comer.gone_s() < enter_s:
        return False
    if comer.is_inside:
        waits = rights.must_yield(comer.lane, entry.lane) and comer.speed_mps < STANDS_MPS
        return rights.cross(entry.lane, comer.lane) and not waits
    if not first or comer.held or comer.waiting_s > PATIENCE_S:
        return False
    return comer.arrival_s() < clear_s + MARGIN_S
