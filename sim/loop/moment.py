"""What the detectors of events look at in one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hippodrome.sim.loop.junction import Comer
from hippodrome.sim.loop.types import Event, EventKind, Truth
from hippodrome.sim.loop.users import Users


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What the detectors look at in one step.

    Args:
        truth: of the ego.
        users: vehicles near it.
        user_lanes: the lanes (k,) they are on, -1 where unknown.
        front_lane: the lane that the front bumper is on, -1 off the road.
        against: the ego's middle lies on a lane that runs against it, and on none that runs with it.
        line: lanes that the ego is on, has just left, or drives along next.
        strip_outside_m: how far the worst wheel is outside of the strips of the ego's lanes, also in junctions.
        off_road: the ego's middle lies neither on a lane nor in a junction nor on a turning place.
        signals: SUMO's letter of the lamp of each first lane inside the junction ahead, as it was before this step and is now.
        coming: vehicles on their way into the junction ahead.
        building: the ego's body touches a building.
        put_back: SUMO had lost the ego.
        turns_round: the ego backs or turns round, as ``turnround.Manoeuvre`` says.
        backed_m: how far it has driven backwards in that manoeuvre.
    """

    truth: Truth
    users: Users
    user_lanes: Sequence[int]
    front_lane: int
    against: bool
    line: frozenset[int]
    strip_outside_m: float
    off_road: bool
    signals: dict[int, tuple[str, str]]
    coming: Sequence[Comer]
    building: bool
    put_back: bool
    turns_round: bool = False
    backed_m: float = 0.0


def event(kind: EventKind, truth: Truth, text: str, other: str = "", at_fault: bool = True) -> Event:
    """An event at the ego's present place."""
    return Event(kind, truth.t_s, truth.x_m, truth.y_m, at_fault, truth.lane_id, other, text)
