"""Beside the road: noticed within metres by the ground under the vehicle, and the pose and the hypotheses of it are given up."""

import numpy as np
import pytest

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.border import OTHER, ROAD, UNKNOWN
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.footing import BESIDE_M, OFF_M, Footing, stepped
from hippodrome.core.navigation.guidance import Guide
from hippodrome.core.navigation.navigator import BESIDE_ROAD, Navigator
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.track import begun
from hippodrome.core.navigation.types import Goal, Radar
from tests.core.navigation.roads import Bicycle, map_along, ring

ON_ROAD = Footing()


class Strip:
    """Ground that is road to the left of a line, ``border_m`` to the left of the vehicle, and none to the right of it."""

    def __init__(self, border_m):
        self.border_m = border_m

    def kinds_at(self, points_m):
        return np.where(points_m[:, 1] > self.border_m, ROAD, OTHER).astype(np.uint8)


def footing_after(ground, metres, footing=ON_ROAD):
    for _ in range(round(metres / 0.5)):
        footing = stepped(footing, ground, 0.5)
    return footing


@pytest.mark.parametrize(
    ("border_m", "metres", "doubtful", "off"),
    [
        (-1.5, 50.0, False, False),  # in the lane
        (-0.6, 4.0, False, False),  # a wheel over the kerb, as in a corner that is cut
        (-0.6, 7.0, True, False),  # longer than any corner
        (-0.6, BESIDE_M + 1.0, True, True),  # and so on and on
        (1.5, OFF_M + 1.0, True, True),  # the whole vehicle
    ],
)
def test_it_takes_some_metres_to_be_beside_the_road(border_m, metres, doubtful, off):
    footing = footing_after(Strip(border_m), metres)
    assert (footing.is_doubtful, footing.is_off_road) == (doubtful, off)


def test_what_was_driven_on_road_since_makes_up_for_it():
    assert footing_after(Strip(-1.5), 12.0, footing_after(Strip(-0.6), 9.0)) == Footing()


def test_a_pavement_that_looks_like_road_does_not_make_up_for_having_come_off_it():
    off = footing_after(Strip(-0.6), BESIDE_M + 1.0)
    assert footing_after(Strip(-1.5), 4.0, off).is_off_road
    assert footing_after(Strip(-1.5), 50.0, off).beside_m == 2.0 * BESIDE_M
    assert stepped(off, Strip(-1.5), -1.0) == off
    assert not off.is_on_road and ON_ROAD.is_on_road


def test_neither_unknown_ground_nor_backing_off_tells_anything():
    class Dark:
        def kinds_at(self, points_m):
            return np.full(len(points_m), UNKNOWN, dtype=np.uint8)

    assert footing_after(Dark(), 50.0) == Footing()
    assert stepped(Footing(3.0, 1.0), Strip(1.5), -1.0) == Footing(3.0, 1.0)


@pytest.mark.parametrize("exact", [False, True])
def test_a_pose_on_the_road_is_given_up_beside_it_unless_it_is_told(exact):
    network, car = ring(), Bicycle((20.0, 0.0, 0.0))
    config = NavigatorConfig(read_road=False, exact_poses=exact)
    belief, senses = Belief(config, RoutePlanner(map_along(network), network, config), -1.0), Senses(config, -1.0, 1.0)
    belief.track = begun(np.array([20.0, 0.0, 0.0]), np.diag([0.04, 0.04, 1e-4]))
    observation = car.sense(frame=None)
    belief.step(observation, car.step(observation), 0.0, senses)
    assert belief.track is not None
    senses.footing = Footing(BESIDE_M + 1.0)
    belief.step(observation, car.step(observation), 0.0, senses)
    assert (belief.track is not None) is exact


def test_the_vehicle_stops_beside_the_road_and_backs_the_way_it_came():
    network, car = ring(side=300.0), Bicycle((20.0, 0.0, 0.0))
    navigator = Navigator(map_along(network), network, NavigatorConfig(read_road=False), poses=car)
    navigator.set_goal(Goal(250.0, 0.0, 0.0))
    said, ahead_m = [], []
    for step in range(200):
        command = navigator.step(car.sense(), Radar())
        said.append(command.reason)
        assert step != 40 or navigator.track is not None
        if step >= 40 and "backs off" not in said:  # the ground under it is no road until it stands
            navigator._senses.footing = Footing(BESIDE_M + 1.0)
        ahead_m.append(float(car.pose[0]))
        car.drive(command)
    first, back = said.index(BESIDE_ROAD), said.index("backs off")
    assert first == 41 and ahead_m[back] - ahead_m[first] < 20.0
    assert min(ahead_m[back:]) < ahead_m[back] - 8.0
    assert navigator._senses.footing == Footing()


def test_no_place_is_a_fix_in_doubt_and_the_hypotheses_are_spread_beside_the_road():
    network, config = ring(), NavigatorConfig(read_road=False)
    guide, senses = Guide(config, RoutePlanner(map_along(network), network, config)), Senses(config, -1.0, 1.0)
    guide._sure_m, guide.pose, guide.place = 50.0, np.zeros(3), guide.whereabouts.best()
    assert guide.fix is not None
    before = guide.whereabouts.sample(200)
    guide._check_footing(True)
    assert guide.fix is None and guide.pose is None
    apart_m = np.hypot(*(guide.whereabouts.sample(200) - before)[:, :2].T)
    assert 1.0 < np.median(apart_m) < 5.0
    guide._sure_m, senses.footing = 50.0, Footing(BESIDE_M - 1.0)
    guide._look(senses, False)
    assert guide.fix is None
