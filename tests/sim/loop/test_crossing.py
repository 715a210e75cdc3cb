"""Rights of way and red signals are judged by the way that the ego took, which shows when it leaves the junction."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.sim.loop.crossing import Crossing
from hippodrome.sim.loop.junction import Comer
from hippodrome.sim.loop.types import EventKind

BEFORE, RIGHT, AHEAD, BEYOND, THEIRS = 0, 10, 11, 5, 20
ENTERED_S = 3.0


class Rights:
    """One junction: who goes straight ahead lets the others pass, who turns right need not."""

    junction_of = {RIGHT: "j", AHEAD: "j", THEIRS: "j"}  # noqa: RUF012
    ways_from = {BEFORE: [RIGHT, AHEAD]}  # noqa: RUF012

    def __init__(self, all_yield=False):
        self.all_yield = all_yield

    def must_yield(self, lane, other):
        return (self.all_yield or lane == AHEAD) and other == THEIRS

    def same_link(self, lane, other):
        return lane == other


def moment(t_s, front_lane, in_junction=False, coming=(), signals=None, speed_mps=5.0):
    truth = SimpleNamespace(t_s=t_s, x_m=0.0, y_m=0.0, lane_id="l", in_junction=in_junction)
    users = SimpleNamespace(names=("b1",), speed_mps=np.array([speed_mps]))
    return SimpleNamespace(truth=truth, front_lane=front_lane, coming=coming, signals=signals or {}, users=users)


def events(fronts, coming=(), signals=None, speeds=None, rights=None):
    """What is logged while the front is on lanes, one step each from when it enters."""
    crossing, found = Crossing(rights or Rights()), []
    for k, front in enumerate((BEFORE, *fronts)):
        entering = k == 1
        at_s, inside = ENTERED_S + 0.1 * (k - 1), k > 2 and front != BEYOND
        speed = 5.0 if speeds is None else speeds[k]
        found += crossing.look(moment(at_s, front, inside, coming if entering else (), signals if entering else None, speed))
    return found


def comer(distance_m=4.0, speed_mps=5.0):
    return Comer("b1", 0, THEIRS, distance_m, distance_m + 20.0, speed_mps, False, 0.0)


@pytest.mark.parametrize(
    "fronts", [[RIGHT, AHEAD, AHEAD, AHEAD, RIGHT, RIGHT, BEYOND], [RIGHT, AHEAD, AHEAD, AHEAD, RIGHT, BEYOND]]
)
def test_who_goes_straight_on_before_a_sharp_corner_is_judged_by_the_corner(fronts):
    assert events(fronts, [comer()]) == []


def test_a_right_of_way_is_taken_where_the_way_taken_had_to_yield():
    (found,) = events([RIGHT, AHEAD, AHEAD, AHEAD, BEYOND, BEYOND], [comer()])
    assert (found.kind, found.t_s, found.other) == (EventKind.RIGHT_OF_WAY, ENTERED_S, "b1")


@pytest.mark.parametrize(("fronts", "taken"), [([AHEAD] * 4 + [BEYOND] * 2, 1), ([AHEAD] * 3 + [RIGHT] + [BEYOND] * 2, 0)])
def test_who_makes_somebody_brake_is_judged_by_the_way_taken_too(fronts, taken):
    speeds = [8.0, 8.0, 8.0, 7.0, 6.5, 6.0, 6.0]
    found = events(fronts, [comer(40.0, 8.0)], speeds=speeds)
    assert [(one.kind, one.t_s) for one in found] == [(EventKind.RIGHT_OF_WAY, ENTERED_S + 0.2)] * taken


def test_a_red_signal_is_that_of_the_way_taken_and_told_at_once_where_all_are_red():
    only_ahead = {AHEAD: ("r", "r"), RIGHT: ("g", "g")}
    assert events([AHEAD, AHEAD, AHEAD, RIGHT, BEYOND], signals=only_ahead) == []
    assert [one.kind for one in events([RIGHT, AHEAD, AHEAD, BEYOND], signals=only_ahead)] == [EventKind.RED_LIGHT]
    assert [one.kind for one in events([AHEAD], signals={AHEAD: ("r", "r"), RIGHT: ("r", "r")})] == [EventKind.RED_LIGHT]


def test_it_is_told_in_the_junction_where_it_would_be_the_same_on_all_ways():
    assert events([AHEAD, AHEAD, AHEAD], [comer()]) == []
    (found,) = events([AHEAD, AHEAD, AHEAD], [comer()], rights=Rights(all_yield=True))
    assert found.kind is EventKind.RIGHT_OF_WAY and found.t_s == ENTERED_S
