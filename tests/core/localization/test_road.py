"""The road right ahead as a measurement of the pose, on a street of one lane each way and on one of two."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.localization.road import BEFORE_END_M, RoadSense
from hippodrome.core.roads.geometry import road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError
from hippodrome.core.views.config import CameraGeometry
from tests.core.looped_world import Pictures, topometric_map
from tests.core.reading.painted import camera, road

VIEW = camera()
SURE = np.diag([0.5**2, 0.3**2, 0.03**2])
SAME = (0.0, 0.0)  # moved and turned since the frame before


def street(lanes_m, length_m=60.0):
    """Lanes along x at these places left of it, those above 2 m (1 lane) or 6 m (2 lanes) leading back."""
    points, oncoming = [], 1.5 if len(lanes_m) == 2 else 5.0
    for y in lanes_m:
        points += [[0.0, y], [length_m, y]] if y < oncoming else [[length_m, y], [0.0, y]]
    count = len(lanes_m)
    left = [i + 1 if i + 1 < count and lanes_m[i + 1] < oncoming else -1 for i in range(count)]
    right = [left.index(i) if i in left else -1 for i in range(count)]
    return RoadNetwork(
        lane_ids=tuple(f"lane{i}" for i in range(count)),
        edge_ids=tuple(f"edge{i}" for i in range(count)),
        lane_edge=np.arange(count, dtype=np.int32),
        is_internal=np.zeros(count, dtype=np.bool_),
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 8.0),
        points_m=np.array(points),
        point_start=np.arange(0, 2 * count + 1, 2, dtype=np.int32),
        successor=np.zeros(0, np.int32),
        successor_start=np.zeros(count + 1, np.int32),
        left_lane=np.array(left, np.int32),
        right_lane=np.array(right, np.int32),
    )


def sense(network):
    return RoadSense(road_geometry(network), CameraGeometry())


ONE_EACH_WAY = street([0.0, 3.2])


def test_the_place_in_the_lane_is_measured_and_the_place_along_it_is_not():
    frame = road(VIEW, offset_m=0.4, heading_rad=0.02)
    measured = sense(ONE_EACH_WAY).measure(frame, *SAME, np.array([20.0, 0.0, 0.0]), SURE)
    assert measured.pose == pytest.approx([20.0, 0.4, 0.02], abs=0.06)
    sigma = np.sqrt(np.diag(measured.covariance))
    assert sigma[0] > 50.0 and sigma[1] < 0.2 and sigma[2] < 0.05
    np.linalg.cholesky(measured.covariance)


def test_a_stop_line_tells_how_far_along_it_is():
    frame = road(VIEW, bars=[(8.0, 8.4)])
    measured = sense(ONE_EACH_WAY).measure(frame, *SAME, np.array([50.0, 0.0, 0.0]), SURE)
    assert measured.pose[0] == pytest.approx(60.0 - BEFORE_END_M - 8.0, abs=0.3)
    assert np.sqrt(measured.covariance[0, 0]) < 0.5


def test_after_a_lanes_end_was_read_views_are_trusted_less_for_some_way():
    road_sense = sense(ONE_EACH_WAY)
    assert road_sense.distrust() == 1.0
    road_sense.measure(road(VIEW, bars=[(8.0, 8.4)]), *SAME, np.array([51.0, 0.0, 0.0]), SURE)
    at_once = road_sense.distrust()
    road_sense.move(100.0)
    assert at_once > 2.0 and road_sense.distrust() < 1.2


@pytest.mark.parametrize(
    ("pose", "frame"),
    [
        ((20.0, 0.0, 0.0), np.zeros((120, 160, 3), np.uint8)),
        ((20.0, 40.0, 0.0), road(VIEW)),  # no lane of the network is near
        ((20.0, 0.0, 1.5), road(VIEW)),  # none leads this way
        ((20.0, -2.2, 0.0), road(VIEW)),  # another lane, or another street
    ],
)
def test_nothing_is_measured_where_frame_or_network_tell_nothing(pose, frame):
    assert sense(ONE_EACH_WAY).measure(frame, *SAME, np.array(pose), SURE) is None


def test_a_lane_is_not_measured_again_before_some_way_was_driven():
    road_sense, pose = sense(ONE_EACH_WAY), np.array([20.0, 0.0, 0.0])
    assert road_sense.measure(road(VIEW), *SAME, pose, SURE) is not None
    assert road_sense.measure(road(VIEW), *SAME, pose, SURE) is None
    road_sense.move(3.0)
    assert road_sense.measure(road(VIEW), *SAME, pose, SURE) is not None


TWO_EACH_WAY = street([0.0, 3.2, 6.4, 9.6])
RIGHT_LANE = ((-1.4, 0), (1.6, 9), (4.8, 9), (11.0, 0))
LEFT_LANE = tuple((place - 3.2, period) for place, period in RIGHT_LANE)


def driven(lines, y_m, frames):
    """What is measured of the y of a vehicle that is believed at ``y_m``, frame by frame; nan: nothing."""
    road_sense, measured = sense(TWO_EACH_WAY), []
    for i in range(frames):
        # the dashes lie still on the road
        frame = road(VIEW, lines=lines, along_m=float(i))
        result = road_sense.measure(frame, 1.0, 0.0, np.array([10.0 + i, y_m, 0.0]), SURE)
        road_sense.move(1.0)
        measured.append(np.nan if result is None else result.pose[1])
    return np.array(measured)


def test_of_two_lanes_the_borders_confirm_the_believed_one():
    measured = driven(RIGHT_LANE, 0.0, 16)
    assert np.sum(np.isfinite(measured)) >= 3
    assert np.nanmax(np.abs(measured)) < 0.1


def test_of_two_lanes_the_borders_correct_a_wrong_belief_but_not_at_once():
    measured = driven(LEFT_LANE, 0.0, 24)
    assert np.all(np.isnan(measured[:5]))
    assert np.nanmedian(measured) == pytest.approx(3.2, abs=0.15)


def test_without_a_road_network_it_is_refused():
    cognitive_map = topometric_map(Pictures(seed=3), np.random.default_rng(3))
    with pytest.raises(HippodromeError, match="road_reading"):
        Localizer(cognitive_map, None, LocalizerConfig(road_reading=True))


def test_is_off_if_not_asked_for():
    assert LocalizerConfig().road_reading is False
    assert replace(LocalizerConfig(), road_reading=True).road_reading
