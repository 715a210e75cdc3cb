"""Hypotheses of the place: what tells them apart is used, what does not is left open, and the same seed gives the same."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.navigation.agreement import agreed_m, lane_field
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.footing import Footing
from hippodrome.core.navigation.guidance import GUESS, LOOK_M, REASON, Guide
from hippodrome.core.navigation.paving import paving
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.searching import LaneMemory
from hippodrome.core.navigation.track import begun
from hippodrome.core.navigation.types import Radar
from hippodrome.core.navigation.ways import way_poses, ways_ahead
from hippodrome.core.navigation.whereabouts import Whereabouts
from hippodrome.core.navigation.witnesses import Witnesses
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.roads.geometry import road_geometry
from tests.core.navigation.roads import arc, map_along, network_of

STEP_M = 0.5


class Eyes:
    """What a vehicle senses that sees the paving of a network about its true pose; without a network it sees nothing."""

    scale_sigma = 0.05

    def __init__(self, network=None):
        self.pose, self.reading, self.memory, self.ground = np.zeros(3), None, LaneMemory(), self
        self.footing = Footing()
        self._raster = None if network is None else paving(network)

    def kinds_at(self, points_m):
        if self._raster is None:
            return np.zeros(len(points_m), dtype=np.uint8)
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        seen = self.pose[:2] + points_m @ np.array([[cos, sin], [-sin, cos]])
        cells = np.floor((seen - self._raster.corner_m) / self._raster.cell_m).astype(int)
        cells = np.clip(cells, 0, np.array(self._raster.levels.shape) - 1)
        return np.where(self._raster.levels[cells[:, 0], cells[:, 1]] > 2, 1, 2).astype(np.uint8)

    def around(self, reach_m):
        return np.zeros((1, 1), dtype=np.uint8), self.pose[:2]

    def in_view(self, points_m):
        return np.ones(len(points_m), dtype=bool)

    def off_road_share(self, points_m):
        return float(np.mean(self.kinds_at(points_m) == 2)) if self._raster is not None else 0.0


def bends(*places):
    """Roads of 60 m that bend by 90 degrees with 15 m radius and go on for 60 m: (x, y, +1 left or -1 right) of each."""
    lines, onward = [], []
    for x, y, side in places:
        turn = arc((x + 60.0, y + 15.0 * side), 15.0, -90 * side, 0)
        lines += [[(x, y), (x + 60.0, y)], turn, [(x + 75.0, y + 15.0 * side), (x + 75.0, y + 75.0 * side)]]
        onward += [(len(lines) - 3, len(lines) - 2), (len(lines) - 2, len(lines) - 1)]
    return network_of(lines, onward)


def drive(hypotheses, eyes, pose, way):
    """Drive from a pose over pairs of metres and the angle turned on them."""
    eyes.pose = np.array(pose, dtype=float)
    for length_m, turn_rad in way:
        count = round(length_m / STEP_M)
        for _ in range(count):
            chord = eyes.pose[2] + 0.5 * turn_rad / count
            eyes.pose = eyes.pose + np.array([STEP_M * math.cos(chord), STEP_M * math.sin(chord), turn_rad / count])
            hypotheses(STEP_M, turn_rad / count, eyes)
    return eyes.pose


def stepping(where):
    return lambda distance_m, turned_rad, eyes: where.step(distance_m, turned_rad, eyes, 0.05)


LEFT = [(40.0, 0.0), (23.5, 0.5 * math.pi), (20.0, 0.0)]


def test_the_turned_angle_tells_a_left_bend_from_a_right_one():
    where = Whereabouts(road_geometry(bends((0.0, 0.0, 1.0), (0.0, 300.0, -1.0))))
    truth = drive(stepping(where), Eyes(), (20.0, 0.0, 0.0), LEFT)
    best = where.best()
    assert best.share > 0.95 and np.hypot(*(best.pose - truth)[:2]) < 6.0


def test_the_ground_tells_how_far_along_the_way():
    network = bends((0.0, 0.0, 1.0), (0.0, 300.0, -1.0))
    where = Whereabouts(road_geometry(network))
    truth = drive(stepping(where), Eyes(network), (20.0, 0.0, 0.0), LEFT)
    best = where.best()
    assert best.share > 0.99 and np.hypot(*(best.pose - truth)[:2]) < 1.0 and where.fits > 0.9


def test_a_junction_leaves_all_its_ways_open_until_one_is_driven():
    lines = [
        [(0.0, 0.0), (60.0, 0.0)], [(76.0, 0.0), (136.0, 0.0)], [(68.0, 8.0), (68.0, 68.0)], [(60.0, 0.0), (76.0, 0.0)],
        arc((60.0, 8.0), 8.0, -90, 0),
    ]  # fmt: skip
    network = network_of(lines, [(0, 3), (3, 1), (0, 4), (4, 2)], internal=(3, 4))
    where, eyes = Whereabouts(road_geometry(network)), Eyes(network)
    truth = drive(stepping(where), eyes, (20.0, 0.0, 0.0), [(36.0, 0.0)])
    assert where.near(truth).share > 0.3
    truth = drive(stepping(where), eyes, truth, [(4.0, 0.0), (12.5, 0.5 * math.pi), (10.0, 0.0)])
    assert where.near(truth).share > 0.95


def twins():
    return bends((0.0, 0.0, 1.0), (0.0, 300.0, 1.0))


def guide_on(network):
    config = NavigatorConfig()
    return Guide(config, RoutePlanner(map_along(network), network, config))


def test_two_roads_that_are_alike_stay_two_and_give_no_fix_but_a_way():
    network = twins()
    guide, eyes = guide_on(network), Eyes(network)
    here = drive(lambda d, t, eyes: guide.step(d, t, eyes, None, None), eyes, (20.0, 0.0, 0.0), LEFT)
    other = here + np.array([0.0, 300.0, 0.0])
    assert guide.fix is None
    assert 0.2 < guide.whereabouts.near(here).share < 0.8 and 0.2 < guide.whereabouts.near(other).share < 0.8
    assert guide.agreed_m > 15.0 and guide.plan is not None  # both have the bend


def test_what_tells_them_apart_gives_a_fix_at_the_right_place():
    network = bends((0.0, 0.0, 1.0), (0.0, 300.0, -1.0))
    guide, eyes = guide_on(network), Eyes(network)
    truth = drive(lambda d, t, eyes: guide.step(d, t, eyes, None, None), eyes, (20.0, 0.0, 0.0), [*LEFT[:2], (10.0, 0.0)])
    assert guide.fix is not None and np.hypot(*(guide.fix.pose - truth)[:2]) < 1.5
    here, there = (begun(truth + np.array([0.0, y, 0.0]), np.diag([0.04, 0.04, 1e-4])) for y in (0.0, 300.0))
    assert guide.vouches(here, Witnesses(), 1.5) and not guide.vouches(there, Witnesses(), 1.5)
    guide.whereabouts.fits = 0.8
    assert not guide.vouches(here, Witnesses(), 1.5)  # the ground is not as the network has it ..
    assert guide.vouches(here, Witnesses(views=4.0), 1.5)  # .. but in fog that is so, and views have been recognised
    assert not guide.vouches(here, Witnesses(views=4.0), 0.1)  # known well enough it must be all the same


def test_a_recognised_view_decides_between_roads_that_are_alike():
    network = twins()
    guide, eyes = guide_on(network), Eyes(network)
    drive(lambda d, t, eyes: guide.step(d, t, eyes, eyes.pose.copy(), None), eyes, (20.0, 0.0, 0.0), [(38.0, 0.0)])
    assert guide.fix is not None and abs(guide.fix.pose[1]) < 1.0


@pytest.mark.parametrize("turn_rad", [0.5 * math.pi, -0.5 * math.pi])
def test_a_road_that_the_network_does_not_have_gives_no_fix(turn_rad):
    """The vehicle sees and drives a road that bends after 20 m: the network's bends are elsewhere."""
    network, guide = twins(), guide_on(twins())
    side = math.copysign(1.0, turn_rad)
    eyes = Eyes(network_of([[(0.0, 0.0), (40.0, 0.0)], [(40.0, 0.0), (40.0, 90.0 * side)]], [(0, 1)]))
    drive(
        lambda d, t, eyes: guide.step(d, t, eyes, None, None), eyes, (20.0, 0.0, 0.0), [(18.0, 0.0), (4.0, turn_rad), (60.0, 0.0)]
    )
    assert guide.fix is None
    assert guide.whereabouts.restarts > 0 or guide.place.share < 0.99
    assert network.lane_count == 6


def test_the_same_observations_give_the_same_hypotheses():
    first, second = (Whereabouts(road_geometry(twins())) for _ in range(2))
    for where in (first, second):
        drive(stepping(where), Eyes(twins()), (20.0, 0.0, 0.0), LEFT)
    np.testing.assert_array_equal(first.sample(50), second.sample(50))


def test_the_end_of_all_lanes_and_standing_still_do_no_harm():
    where = Whereabouts(road_geometry(twins()))
    drive(stepping(where), Eyes(), (20.0, 0.0, 0.0), [(400.0, 0.0)])
    where.step(0.0, 0.0, SimpleNamespace(reading=None), 0.05)
    assert np.isfinite(where.best().pose).all()


def test_agreement_ends_where_the_roads_part():
    network = bends((0.0, 0.0, 1.0), (0.0, 300.0, -1.0))
    ways = way_poses(network, ways_ahead(network, network.lane_lengths_m(), 0, 45.0, LOOK_M)[0], np.arange(0.0, 27.0, 2.0), 45.0)
    ahead = ways - np.array([45.0, 0.0, 0.0])
    field = lane_field(network)
    both = field.agreed(ahead[None], np.array([[45.0, 0.0, 0.0], [45.0, 300.0, 0.0]]))[0]
    assert agreed_m(both, 0.4) >= 24.0 and 14.0 <= agreed_m(both, 0.9) <= 22.0


def test_ways_ahead_are_all_ways_on_but_turning_back():
    back = [(60.0, 0.0), (62.0, 0.1), (62.3, 1.6), (62.0, 3.1), (60.0, 3.2)]
    lines = [
        [(0.0, 0.0), (60.0, 0.0)],
        [(60.0, 3.2), (0.0, 3.2)],
        back,
        [(60.0, 0.0), (100.0, 0.0)],
        [(60.0, 0.0), (60.0, -50.0)],
    ]
    network = network_of(lines, [(0, 2), (2, 1), (0, 3), (0, 4)], internal=(2,))
    ways = ways_ahead(network, network.lane_lengths_m(), 0, 50.0, 26.0)
    assert sorted(way[-1].lane for way in ways) == [3, 4]


def guided(eyes):
    """A guide on one of two roads that are alike, 18 m before their ends."""
    guide = guide_on(twins())
    drive(lambda d, t, eyes: guide.step(d, t, eyes, None, None), eyes, (20.0, 0.0, 0.0), LEFT)
    return guide


def test_a_stop_line_that_is_seen_holds_the_vehicle_where_no_hypothesis_has_one():
    eyes = Eyes(twins())
    guide = guided(eyes)
    free, taken = Radar(), Radar(way_is_free=False)
    assert guide.command(taken, 5.0).acceleration_mps2 == guide.command(free, 5.0).acceleration_mps2
    eyes.reading = RoadReading(end_m=9.0, end_variance_m2=0.1, end=LaneEnd.STOP_LINE)
    guide.step(0.1, 0.0, eyes, None, None)
    assert guide.command(taken, 5.0).acceleration_mps2 < -1.0 and guide.command(taken, 5.0).reason == "gives way"
    assert guide.command(free, 5.0).acceleration_mps2 > -1.0
    guide.step(12.0, 0.0, eyes, None, None)  # passed, and no more seen
    eyes.reading = None
    guide.step(0.1, 0.0, eyes, None, None)


@pytest.mark.parametrize("sees", [True, False])
def test_where_all_places_fit_badly_it_drives_as_far_as_it_sees_road_and_nowhere_else(sees):
    eyes = Eyes(twins())
    guide = guided(eyes)
    assert guide.command(Radar(), 1.0).reason == REASON
    guide.whereabouts.fits = 0.8
    if not sees:
        eyes.kinds_at = lambda points_m: np.zeros(len(points_m), dtype=np.uint8)
    guide.step(1.1, 0.0, eyes, None, None)
    guide.whereabouts.fits = 0.8
    command = guide.command(Radar(), 3.0)
    assert (command is not None) is sees
    if sees:
        assert command.reason == GUESS and guide.command(Radar(), 5.5).acceleration_mps2 < 0.0 < command.acceleration_mps2
        far = eyes.kinds_at
        eyes.kinds_at = lambda points_m: np.where(points_m[:, 0] < 6.0, far(points_m), 0).astype(np.uint8)
        guide.step(1.1, 0.0, eyes, None, None)
        guide.whereabouts.fits = 0.8
        assert guide.command(Radar(), 3.0).acceleration_mps2 < 0.0


def test_a_recognised_view_that_no_hypothesis_has_becomes_one():
    network = bends((0.0, 0.0, 1), (0.0, 300.0, 1))
    where, eyes = Whereabouts(road_geometry(network)), Eyes(network)
    drive(stepping(where), eyes, (5.0, 0.0, 0.0), [(20.0, 0.0)])
    where._rows[: where.count, 1] += 1000.0  # all are elsewhere
    assert where.about(eyes.pose, 5.0)[0] == 0.0
    drive(lambda d, t, seen: where.step(d, t, seen, 0.05, seen.pose.copy()), eyes, eyes.pose, [(8.0, 0.0)])
    assert where.about(eyes.pose, 5.0)[0] > 0.9


def test_ground_that_is_misread_does_not_make_the_pose_that_is_steered_by_forgotten():
    network = bends((0.0, 0.0, 1), (0.0, 300.0, 1))
    for held in (False, True):
        where, eyes = Whereabouts(road_geometry(network)), Eyes(network)
        drive(stepping(where), eyes, (5.0, 0.0, 0.0), [(20.0, 0.0)])
        there = eyes.pose.copy()
        eyes.kinds_at = lambda points_m: (1 + np.arange(len(points_m)) % 2).astype(np.uint8)  # noise
        for _ in range(200):
            where.step(0.1, 0.0, eyes, 0.05, None, there if held else None)
            there[0] += 0.1
            if where.restarts:
                break
        share = where.about(there, 5.0)[0]
        assert where.restarts == 1 and (share > 0.45 if held else share < 0.2)
