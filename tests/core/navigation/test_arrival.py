"""A goal that cannot be vouched for: a look at the end of its street, if that is near, and back; else the way round."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.navigation.arrival import LOOK_MPS, Arrival
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.pilot import RoutePlanner, advanced
from hippodrome.core.navigation.types import DrivingState, Goal, Radar
from tests.core.navigation.roads import map_along, ring

SIDE_END_M = 92.0  # of the ring's first side, along the x axis


def at_goal(goal_m, sigma_m=2.0, since_fix_m=100.0, is_free_behind=True):
    """Stands at a goal on the first side of the ring: the arrival, the belief, and what was backed."""
    network, config, backed = ring(), NavigatorConfig(), []
    planner = RoutePlanner(map_along(network), network, config)
    planner.set_goal(Goal(goal_m, 0.0, 0.0))
    pose = np.array([goal_m, 0.0, 0.0])
    track = SimpleNamespace(pose=pose, along_sigma_m=sigma_m)
    belief = SimpleNamespace(track=track, since_fix_m=since_fix_m, witnesses=None, plan=planner.plan(pose, 0.0))
    escape = SimpleNamespace(to_road=lambda back_m, radar: backed.append(back_m) or is_free_behind)
    return Arrival(config, belief, planner, escape, None), belief, backed


def stood(arrival, seconds=1.5):
    said = [arrival.at_goal(0.1)[0] for _ in range(round(10 * seconds))]
    return said[-1]


def drive_on(arrival, belief, until_m):
    """Drive on along the plan up to a place, by the speeds that are told, and what is told there."""
    for x in np.arange(belief.track.pose[0], until_m, 0.1):
        belief.track.pose = np.array([x, 0.0, 0.0])
        belief.plan = advanced(belief.plan, belief.track.pose)
        told = arrival.look_mps(belief.plan, 1.0, Radar()) if arrival.looks(belief.plan) else LOOK_MPS
        if told == 0.0:
            break
    return arrival.look_mps(belief.plan, 0.0, Radar())


def test_a_place_that_is_known_is_the_goal():
    arrival, _, _ = at_goal(70.0, sigma_m=1.0)
    assert stood(arrival, 0.1) is DrivingState.ARRIVED and arrival.arrived


def test_who_does_not_know_it_looks_at_the_end_of_the_street_and_backs_to_before_the_goal():
    arrival, belief, backed = at_goal(70.0)
    assert stood(arrival, 1.2) is DrivingState.DOUBTING and not arrival.arrived
    assert arrival.looks(belief.plan)
    belief.track.along_sigma_m = 1.4  # known well enough to say so, but not to back first and say so then
    assert drive_on(arrival, belief, 90.0) is None
    assert belief.track.pose[0] == pytest.approx(SIDE_END_M - 8.5, abs=0.6)
    assert backed == [pytest.approx(belief.track.pose[0] - 70.0 + 2.5, abs=0.3)] and belief.plan is None


def test_it_looks_no_farther_than_is_needed():
    arrival, belief, backed = at_goal(70.0)
    stood(arrival, 1.2)
    belief.track.along_sigma_m = 0.5
    assert arrival.look_mps(belief.plan, 2.0, Radar()) == 0.0
    assert arrival.look_mps(belief.plan, 0.0, Radar()) is None and backed == [pytest.approx(2.5, abs=0.3)]


def test_it_does_not_back_where_the_end_of_the_street_told_nothing():
    arrival, belief, backed = at_goal(70.0)
    stood(arrival, 1.2)
    assert drive_on(arrival, belief, 90.0) == LOOK_MPS
    assert not backed and not arrival.looks(belief.plan) and belief.plan is not None


@pytest.mark.parametrize("goal_m", [40.0, 83.0])
def test_it_does_not_look_where_the_end_is_far_or_was_seen(goal_m):
    arrival, belief, _ = at_goal(goal_m)
    stood(arrival, 1.2)
    assert not arrival.looks(belief.plan) and belief.plan is not None


def test_with_somebody_behind_it_drives_round_and_does_not_look_twice():
    arrival, belief, backed = at_goal(70.0, is_free_behind=False)
    stood(arrival, 1.2)
    belief.track.along_sigma_m = 1.4
    assert drive_on(arrival, belief, 90.0) == LOOK_MPS
    belief.track.along_sigma_m = 2.0
    assert len(backed) == 1 and not arrival.looks(belief.plan) and belief.plan is not None
    assert stood(arrival, 1.2) is DrivingState.DOUBTING and not arrival.looks(belief.plan)
