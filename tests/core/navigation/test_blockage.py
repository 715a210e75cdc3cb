"""What bars the way while the place is only likely: the road is closed for that place, and open again for another one."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.blockage import Blockage
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.motion import Motion
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.track import begun
from hippodrome.core.navigation.types import Goal, Lamp, Radar
from hippodrome.core.navigation.whereabouts import Whereabouts
from hippodrome.core.roads.geometry import road_geometry
from tests.core.navigation.roads import map_along, ring, street
from tests.core.navigation.test_whereabouts import Eyes, drive, stepping


class Guessed:
    """A guide that drives the way to the goal from a likely place."""

    places_given_up = 0

    def __init__(self, plan, pose):
        self.way_to_goal, self.has_planned_anew = (plan, pose), False

    def plan_anew(self):
        self.has_planned_anew, self.way_to_goal = True, (None, None)


def blocked(network, pose, goal, gap_m=4.0, lamp=Lamp.NONE, seconds=40.0):
    config = NavigatorConfig()
    planner = RoutePlanner(map_along(network), network, config)
    planner.set_goal(goal)
    guide = Guessed(planner.plan(np.array(pose), 0.0), np.array(pose))
    turns = []
    escape = SimpleNamespace(barred=lambda gap_m: turns.append(gap_m) or True)
    senses = SimpleNamespace(motion=Motion())
    watch = Blockage(config, senses, Belief(config, planner, -1.0), planner, escape, guide)
    for _ in range(round(10 * seconds)):
        watch.step(Radar(gap_m=gap_m, lamp=lamp), False, 0.1)
    return watch, planner, guide, turns


def test_a_street_that_is_barred_is_closed_for_the_likely_place_and_it_turns_round():
    network = street()
    watch, planner, guide, turns = blocked(network, (50.0, -1.6, 0.0), Goal(75.0, -1.6, 0.0), seconds=31.0)
    assert turns == [4.0] and planner.closed == frozenset({0})
    guide.places_given_up = 1
    watch.step(Radar(), False, 0.1)
    assert planner.closed == frozenset()


def test_nothing_is_closed_at_a_red_lamp_nor_before_somebody_far_ahead():
    for gap_m, lamp in ((4.0, Lamp.RED), (30.0, Lamp.NONE)):
        _, planner, _, turns = blocked(street(), (50.0, -1.6, 0.0), Goal(75.0, -1.6, 0.0), gap_m, lamp)
        assert not planner.closed and not turns


@pytest.mark.parametrize(("begin_m", "turns_s"), [(20.0, 15.0), (50.0, 30.0)])
def test_what_stands_far_before_a_junction_is_no_queue_and_is_not_waited_for_so_long(begin_m, turns_s):
    network, config, turns = ring(), NavigatorConfig(), []
    planner = RoutePlanner(map_along(network), network, config)
    planner.set_goal(Goal(100.0, 60.0, 0.5 * math.pi))
    belief = Belief(config, planner, -1.0)
    pose = np.array([begin_m, 0.0, 0.0])
    belief.track, belief.plan = begun(pose, np.diag([0.1, 0.1, 0.01])), planner.plan(pose, 0.0)
    escape = SimpleNamespace(barred=lambda gap_m: turns.append(gap_m) or True)
    watch = Blockage(config, SimpleNamespace(motion=Motion()), belief, planner, escape, None)
    times = []
    for k in range(400):
        watch.step(Radar(gap_m=4.0), False, 0.1)
        times += [0.1 * (k + 1)] * (len(turns) - len(times))
    assert times[0] == pytest.approx(turns_s, abs=0.3)


def test_after_turning_round_the_hypotheses_are_on_the_lane_of_the_other_direction():
    network = street(onward=False)
    where = Whereabouts(road_geometry(network))
    eyes = Eyes(network)
    here = drive(stepping(where), eyes, (20.0, -1.6, 0.0), [(20.0, 0.0), (3.2 * math.pi / 2.0, math.pi)])
    where.turn_round()
    drive(stepping(where), eyes, here, [(15.0, 0.0)])
    best = where.best()
    assert best.agreement > 0.9 and abs(math.remainder(float(best.pose[2]) - math.pi, math.tau)) < 0.2
    assert best.pose[1] == pytest.approx(1.6, abs=1.0)
