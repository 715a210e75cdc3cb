"""Beside an oncoming lane: whose borders are read, and what follows where they are the oncoming lane's for long."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.placing import lane_of, lane_that_is_read, speaks_for_oncoming
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.track import begun
from hippodrome.core.navigation.types import Radar
from hippodrome.core.reading.types import RoadReading
from hippodrome.core.roads.geometry import road_geometry
from tests.core.navigation.roads import GREY, Bicycle, map_along, network_of, street

OWN, ONCOMING = (0.03, 0.97), (0.97, 0.03)  # how likely the left and the right border are edges, where traffic keeps right


def reading(offset_m, edges=OWN):
    return RoadReading(offset_m, 0.01, 0.0, 0.001, 0.0, 1e-4, 3.2, left_edge=edges[0], right_edge=edges[1])


@pytest.mark.parametrize(
    ("aside_m", "offset_m", "edges", "lane"),
    [
        (0.0, 0.1, OWN, 0),
        (0.0, 0.0, ONCOMING, 0),  # one glance does not move the vehicle by a lane
        (3.2, 0.0, ONCOMING, 1),
        (2.4, -0.7, ONCOMING, 1),
        (1.4, 1.5, OWN, 0),
        (1.8, -1.4, (math.nan, math.nan), 0),  # a pose that is wrong beside the road reads the same
    ],
)
def test_a_reading_in_a_wide_swing_is_of_the_oncoming_lane(aside_m, offset_m, edges, lane):
    roads = road_geometry(street())
    pose = np.array([30.0, -1.6 + aside_m, 0.0])
    place = lane_of(roads, np.array([30.0, -1.6, 0.0]))
    place = replace(place, offset_m=aside_m)
    read = lane_that_is_read(roads, pose, place, reading(offset_m, edges))
    assert read.lane == lane and abs(math.remainder(read.heading_rad, math.tau)) < 1e-9
    assert read.offset_m == pytest.approx(aside_m if lane == 0 else aside_m - 3.2)


def test_a_road_for_one_direction_says_nothing_of_an_oncoming_lane():
    roads = road_geometry(network_of([[(0.0, 0.0), (80.0, 0.0)], [(0.0, 3.2), (80.0, 3.2)]], [], left=[1, -1], right=[-1, 0]))
    place = lane_of(roads, np.array([30.0, 0.0, 0.0]))
    assert lane_that_is_read(roads, np.array([30.0, 0.0, 0.0]), place, reading(0.0)).lane == 0
    assert speaks_for_oncoming(road_geometry(street()), place, reading(0.0, ONCOMING)) > 0.9
    assert speaks_for_oncoming(road_geometry(street()), place, reading(0.0, OWN)) < -0.9


@pytest.mark.parametrize(("edges", "y_m"), [(OWN, -1.6), (ONCOMING, 1.6), ((math.nan, math.nan), -1.6)])
def test_who_reads_the_oncoming_lanes_borders_for_long_is_there(edges, y_m):
    network, car = street(), Bicycle((10.0, y_m, 0.0))
    config = NavigatorConfig()
    belief = Belief(config, RoutePlanner(map_along(network), network, config), -1.0)
    belief.track = begun(np.array([10.0, -1.6, 0.0]), np.diag([0.04, 0.04, 1e-4]))
    senses = Senses(replace(config, read_road=False), -1.0, 1.0)
    car.speed = 6.0
    for _ in range(50):
        car.pose[0] += 0.6
        car.t_s += 0.1
        observation = car.sense(frame=GREY)
        distance_m = senses.step(observation, Radar(), 1.0)
        senses.reading = reading(0.0, edges)
        estimate = car.step(observation)
        estimate.pose[1] = -1.6  # the localizer is of the same wrong mind
        belief.step(observation, estimate, distance_m, senses)
    assert belief.track.pose[1] == pytest.approx(y_m, abs=0.3)
