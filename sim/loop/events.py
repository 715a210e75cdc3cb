"""What the ego does wrong, and what happens to it: detected at each step, logged once at its beginning."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from hippodrome.sim.loop.contact import Circumstances, is_at_fault, touching
from hippodrome.sim.loop.crossing import Crossing
from hippodrome.sim.loop.moment import Moment, event
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.types import Event, EventKind
from hippodrome.sim.loop.ways import Ways

TOLERANCE_M: Final = 0.05  # a tyre on the line is in the lane
OVER_S: Final = 1.0  # what has not been seen for so long is over, and would be a new event
WRONG_WAY_S: Final = 0.5  # against the traffic for so long, and moving
MOVING_MPS: Final = 0.3
LONG_M: Final = 20.0  # who backs farther in one manoeuvre drives against the traffic
SWING_M: Final = 0.3  # in turns the wheels need not be in the lane's middle
STEADY_S: Final = 2.0  # so long the ego must have been in its lane to be there by right


class Watch:
    """Detects events. It remembers what is under way, so that each is logged once, at its beginning.

    *Collision*: the box of the ego and that of another vehicle overlap by more than 5 cm; at fault as ``is_at_fault`` says.
    *Building*: the ego's body touches one. *Kerb*: a wheel stands more than 5 cm off everything that is paved for cars:
    lanes, junctions, turning places. *Left lane*: outside of junctions a wheel stands more than 5 cm outside of the ego's
    lane and those beside it in the same direction. *Left road*: the middle of the ego and a wheel are off all that is paved.
    *Wrong way*: outside of junctions the middle of the moving ego has been for half a second on a lane that runs against it
    and on none that runs with it, but while it turns round, that is from the reverse gear on until 10 m have been driven
    forwards; or the ego has backed for more than 20 m in one such manoeuvre. *Red light*: the front bumper passes the end
    of a lane whose signal for the way taken is red, before and after the step; yellow is none. *Right of way*: the front
    bumper enters a junction and a vehicle that the ego had to let pass, on a way that crosses or meets the ego's, would be
    there within 2 s at its present speed or is in the first half of its way through; or such a vehicle brakes with more
    than 4 m/s^2 while the ego is in the junction. *Put back*: SUMO had taken the ego off the road. What has not been seen
    for a second is over; if it comes again, it is a new event.
    """

    def __init__(self, rights: Rights, ways: Ways) -> None:
        self._rights = rights
        self._last_s: dict[str, float] = {}  # when each condition was last seen
        self._against_since_s = math.inf
        self._steady_since_s = 0.0
        self._crossing = Crossing(rights, ways)

    def look(self, m: Moment) -> tuple[Event, ...]:
        """The events that begin in this step."""
        crossing = self._crossing.look(m)
        return (*self._conditions(m), *self._collisions(m), *crossing)

    def _begins(self, key: str, t_s: float) -> bool:
        """Notes that a condition holds; True if it did not hold within the last second."""
        last = self._last_s.get(key, -math.inf)
        self._last_s[key] = t_s
        return t_s - last > OVER_S + 1e-6

    def _conditions(self, m: Moment) -> Iterator[Event]:
        truth = m.truth
        on_road = truth.lane >= 0 and not truth.in_junction
        against = m.against and truth.speed_mps > MOVING_MPS and not m.turns_round
        backs = m.backed_m > LONG_M and truth.speed_mps < -MOVING_MPS
        wrong = on_road and (against or backs)
        self._against_since_s = min(self._against_since_s, truth.t_s) if wrong else math.inf
        outside = on_road and truth.wheel_outside_m > TOLERANCE_M
        if outside or not on_road or m.turns_round:
            self._steady_since_s = truth.t_s
        for kind, holds, text in (
            (EventKind.KERB, truth.off_paving_m > TOLERANCE_M, "a wheel off the paving"),
            (EventKind.LEFT_LANE, outside, "a wheel outside of the lane"),
            (EventKind.LEFT_ROAD, m.off_road, "the vehicle off the road"),
            (EventKind.WRONG_WAY, truth.t_s - self._against_since_s >= WRONG_WAY_S - 1e-6, "against the traffic"),
            (EventKind.BUILDING, m.building, "ran into a building"),
        ):
            if holds and self._begins(kind, truth.t_s):
                yield event(kind, truth, text)
        if m.put_back:
            yield event(EventKind.PUT_BACK, truth, "SUMO had taken the ego off the road", at_fault=False)

    def _collisions(self, m: Moment) -> Iterator[Event]:
        truth, rows = m.truth, touching(m.truth.pose_m, m.users)
        for row in rows.tolist():
            name = m.users.names[row]
            if self._begins(f"collision {name}", truth.t_s):
                at_fault, text = is_at_fault(self._circumstances(m, row))
                yield event(EventKind.COLLISION, truth, text, name, at_fault)

    def _circumstances(self, m: Moment, row: int) -> Circumstances:
        truth, other = m.truth, m.user_lanes[row]
        x, y, heading = m.users.poses_m[row, :3].tolist()
        own = [lane for lane in (truth.lane, m.front_lane) if lane in self._rights.junction_of]
        first = any(self._rights.must_yield(other, lane) and not self._rights.must_yield(lane, other) for lane in own)
        keeps = not own and (truth.t_s - self._steady_since_s >= STEADY_S or abs(truth.speed_mps) < MOVING_MPS)
        return Circumstances(
            pose_m=truth.pose_m,
            speed_mps=truth.speed_mps,
            other_m=(x, y, heading),
            other_mps=float(m.users.speed_mps[row]),
            in_own_lane=m.strip_outside_m <= SWING_M and not m.against,
            keeps_lane=keeps,
            same_lane=other in m.line,
            ways_cross=any(self._rights.cross(other, lane) for lane in own),
            had_to_yield=first and not self._crossing.on_red(m.front_lane),
        )
