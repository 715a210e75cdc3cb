"""Frames of painted roads whose geometry is known, and frames that show no road."""

import math
from itertools import pairwise

import numpy as np
import pytest

from hippodrome.core.reading import LaneEnd, ReaderConfig, RoadReader
from tests.core.reading.painted import camera, in_lane, road

VIEW = camera()


def read(frame, view=VIEW):
    return RoadReader(view).read(frame)


@pytest.mark.parametrize("offset_m", [-0.6, -0.2, 0.0, 0.3, 0.6])
@pytest.mark.parametrize("heading_rad", [-0.06, 0.0, 0.03])
def test_place_in_a_straight_lane(offset_m, heading_rad):
    reading = read(road(VIEW, offset_m=offset_m, heading_rad=heading_rad))
    assert reading.offset_m == pytest.approx(offset_m, abs=0.06)
    assert reading.heading_rad == pytest.approx(heading_rad, abs=0.02)
    assert reading.curvature_1pm == pytest.approx(0.0, abs=0.005)
    assert reading.lane_width_m == pytest.approx(3.2, abs=0.08)
    assert abs(reading.offset_m - offset_m) < 4.0 * math.sqrt(reading.offset_variance_m2)
    assert reading.end is LaneEnd.NOTHING and reading.end_variance_m2 == math.inf


@pytest.mark.parametrize("curvature_1pm", [-0.04, -0.02, 0.02, 0.04])
def test_bends(curvature_1pm):
    reading = read(road(VIEW, offset_m=0.2, curvature_1pm=curvature_1pm))
    assert reading.offset_m == pytest.approx(0.2, abs=0.12)
    assert reading.curvature_1pm == pytest.approx(curvature_1pm, abs=0.012)


@pytest.mark.parametrize(
    ("size", "options"),
    [
        ((320, 240), {}),
        ((640, 480), {"fov_deg": 70.0}),
        ((160, 120), {"height_m": 2.2, "forward_m": 0.5}),
        ((160, 120), {"pitch": -0.1}),
        ((160, 90), {"pitch": -0.15, "fov_deg": 100.0}),
        ((160, 120), {"yaw": 0.08}),
    ],
)
def test_other_cameras(size, options):
    view = camera(*size, **options)
    reading = read(road(view, size, offset_m=-0.3, heading_rad=0.02), view)
    assert reading.offset_m == pytest.approx(-0.3, abs=0.08)
    assert reading.heading_rad == pytest.approx(0.02, abs=0.02)


@pytest.mark.parametrize("options", [{"offset_m": 0.25, "heading_rad": 0.04}, {"offset_m": -0.3, "curvature_1pm": 0.03}])
def test_a_mirrored_frame_gives_the_mirrored_reading(options):
    frame = road(VIEW, **options)
    here, there = read(frame), read(np.ascontiguousarray(frame[:, ::-1]))
    assert there.offset_m == pytest.approx(-here.offset_m, abs=0.02)
    assert there.heading_rad == pytest.approx(-here.heading_rad, abs=0.005)
    assert there.curvature_1pm == pytest.approx(-here.curvature_1pm, abs=0.003)
    assert there.lane_width_m == pytest.approx(here.lane_width_m, abs=0.02)


def test_a_grey_frame_reads_as_the_coloured_one():
    frame = road(VIEW, offset_m=0.2)
    assert read(frame[:, :, 0]).offset_m == pytest.approx(read(frame).offset_m, abs=1e-3)


@pytest.mark.parametrize("level", [0, 90, 255])
def test_a_plain_frame_shows_nothing(level):
    reading = read(np.full((120, 160, 3), level, np.uint8))
    assert not reading.sees_lane and reading.end is LaneEnd.NOTHING and math.isnan(reading.offset_m)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigma", [5.0, 40.0])
def test_noise_shows_nothing(seed, sigma):
    noise = np.random.default_rng(seed).normal(110.0, sigma, (120, 160, 1)).clip(0, 255)
    assert not read(np.repeat(noise, 3, axis=2).astype(np.uint8)).sees_lane


def test_an_unmarked_road_shows_nothing():
    assert not read(road(VIEW, lines=())).sees_lane


def test_lines_under_noise_and_in_fog_are_read():
    assert read(road(VIEW, offset_m=0.3, noise=6.0)).offset_m == pytest.approx(0.3, abs=0.15)
    assert read(road(VIEW, offset_m=0.3, asphalt=150.0, paint=190.0)).offset_m == pytest.approx(0.3, abs=0.1)


def test_the_middle_lane_of_three_between_dashes():
    lines = ((-4.6, 0), (-1.6, 9), (1.6, 9), (4.6, 0))
    reading = read(road(VIEW, offset_m=0.15, lines=lines))
    assert reading.offset_m == pytest.approx(0.15, abs=0.1)
    assert reading.lane_width_m == pytest.approx(3.2, abs=0.15)


def test_keeping_left():
    assert read(road(VIEW, offset_m=-0.2, lines=((-4.6, 0), (-1.6, 9), (1.4, 0)))).offset_m == pytest.approx(-0.2, abs=0.12)


@pytest.mark.parametrize("distance_m", [4.5, 6.0, 8.0, 10.0])
def test_a_stop_line(distance_m):
    reading = read(road(VIEW, offset_m=0.1, bars=[(distance_m, distance_m + 0.4)]))
    assert reading.end is LaneEnd.STOP_LINE
    assert reading.end_m == pytest.approx(distance_m, abs=0.3)
    assert abs(reading.end_m - distance_m) < 4.0 * math.sqrt(reading.end_variance_m2)


def test_stripes_along_the_lane_and_thin_lines_across_are_no_stop_line():
    zebra = [(-1.4, 0), (1.6, 9), *((place, 0) for place in (-0.8, -0.2, 0.4, 1.0))]
    assert read(road(VIEW, lines=zebra)).end is not LaneEnd.STOP_LINE
    assert read(road(VIEW, bars=[(8.0, 8.12)])).end is not LaneEnd.STOP_LINE
    assert read(road(VIEW, bars=[(7.0, 9.5)])).end is not LaneEnd.STOP_LINE


@pytest.mark.parametrize("distance_m", [6.0, 8.0])
def test_the_mouth_of_a_junction(distance_m):
    reader = RoadReader(VIEW)
    for before_m in (4.0, 3.0, 2.0, 1.0, 0.0):
        reading = reader.read(road(VIEW, end_m=distance_m + before_m), 1.0, 0.0)
    assert reading.end is LaneEnd.MOUTH
    assert reading.end_m == pytest.approx(distance_m, abs=0.35)


def test_what_was_passed_tells_the_place_of_the_rear_axle():
    """Along a bend that ends, the frame alone extrapolates; with the way told, what lies beside the axle has been seen."""

    def pose(s):
        turned = 0.05 * min(s, 12.0)
        bent = np.array([np.sin(turned), 1.0 - np.cos(turned)]) / 0.05
        return turned, bent + max(s - 12.0, 0.0) * np.array([np.cos(turned), np.sin(turned)])

    reader, alone = RoadReader(VIEW), []
    for before, s in pairwise(np.arange(0.0, 20.0, 0.8)):
        frame = road(VIEW, curvature_1pm=0.05 if s < 12.0 else 0.0)
        moved = float(np.linalg.norm(pose(s)[1] - pose(before)[1]))
        reading = reader.read(frame, moved, pose(s)[0] - pose(before)[0])
        alone.append(abs(reading.offset_m))
    assert alone[-1] < 0.05


def test_after_a_lane_has_ended_nothing_is_told_of_it():
    reader = RoadReader(VIEW)
    seen = [reader.read(road(VIEW, end_m=12.0 - s), 1.0 if s else math.nan, 0.0).sees_lane for s in range(16)]
    assert all(seen[:11]) and not any(seen[14:])


def test_a_frame_that_shows_no_road_says_nothing():
    view = camera(160, 120, pitch=1.0)
    assert not read(np.zeros((120, 160, 3), np.uint8), view).sees_lane
    assert not read(np.zeros((16, 16, 3), np.uint8), camera(16, 16)).sees_lane


def test_lengths_must_be_positive():
    with pytest.raises(ValueError, match="far_m"):
        ReaderConfig(far_m=0.0)


def test_the_frames_are_drawn_as_they_say():
    along, left = in_lane(np.array([10.0]), np.array([0.0]), 0.0, 0.0, 0.05)
    assert along[0] == pytest.approx(20.0 * math.atan2(10.0, 20.0))
    assert left[0] == pytest.approx(20.0 - math.hypot(10.0, 20.0))
