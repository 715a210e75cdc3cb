"""The pose that is steered by: told, or kept against the localizer until that insists on another lane."""

import numpy as np
import pytest

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.places import Place
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.track import begun, is_elsewhere
from hippodrome.core.navigation.types import Radar
from tests.core.navigation.roads import Bicycle, map_along, ring


def kept(exact=False, aside_m=0.0, seconds=10.0):
    """Where a vehicle takes itself to be that drove straight on, of which the localizer says ``aside_m`` after three seconds."""
    network, car = ring(side=300.0), Bicycle((20.0, 0.0, 0.0))
    config = NavigatorConfig(read_road=False, exact_poses=exact)
    belief = Belief(config, RoutePlanner(map_along(network), network, config), -1.0)
    senses = Senses(config, -1.0, 1.0)
    car.speed = 8.0
    for step in range(round(10 * seconds)):
        car.pose[0] += 0.8
        car.t_s += 0.1
        observation = car.sense(frame=None)
        distance_m = senses.step(observation, Radar(), 1.0)
        estimate = car.step(observation)
        if step > 30:
            estimate.pose[1] += aside_m
        belief.step(observation, estimate, distance_m, senses)
    return belief.track.pose - car.pose


def test_an_exact_pose_is_taken_at_its_word():
    np.testing.assert_allclose(kept(exact=True, aside_m=0.7)[:2], [0.0, 0.7], atol=1e-9)


def test_a_metre_aside_moves_the_pose_slowly():
    assert abs(kept(aside_m=1.0, seconds=5.0)[1]) < 0.5


@pytest.mark.parametrize(
    ("ahead_m", "aside_m", "elsewhere"), [(0.0, 1.5, False), (0.0, 3.2, True), (3.2, 0.0, False), (5.0, 0.0, True)]
)
def test_another_lane_is_another_place_and_a_little_farther_on_is_not(ahead_m, aside_m, elsewhere):
    car = Bicycle((20.0, 0.0, 0.0))
    estimate = car.step(car.sense(frame=None))
    estimate.pose[:2] += ahead_m, aside_m
    track = begun(np.array([20.0, 0.0, 0.0]), np.diag([0.04, 0.04, 1e-4]))
    assert is_elsewhere(track, estimate) is elsewhere


def test_a_place_by_the_road_network_is_known_to_a_metre_along_the_way_and_better_across():
    network, car = ring(side=300.0), Bicycle((300.0, 40.0, 0.5 * np.pi))
    config = NavigatorConfig(read_road=False)
    belief, senses = Belief(config, RoutePlanner(map_along(network), network, config), -1.0), Senses(config, -1.0, 1.0)
    observation = car.sense(frame=None)
    distance_m = senses.step(observation, Radar(), 1.0)
    found = Place(np.array(car.pose), np.diag([0.01, 0.01, 1e-4]), 1.0, 1.0)
    belief.step(observation, car.step(observation), distance_m, senses, found)
    deviations_m = np.sqrt(np.diag(belief.track.covariance)[:2])
    assert deviations_m[1] > 1.0 and deviations_m[0] < 0.3 and belief.track.along_sigma_m == pytest.approx(deviations_m[1], 1e-3)
