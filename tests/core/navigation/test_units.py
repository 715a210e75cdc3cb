"""Steering, speed, junctions, motion, dashes, track: each against numbers worked out by hand."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation import motion as motions
from hippodrome.core.navigation import track as tracks
from hippodrome.core.navigation.config import DriveConfig, NavigatorConfig, VehicleShape, WatchConfig
from hippodrome.core.navigation.course import make_course, next_gate, next_mouth
from hippodrome.core.navigation.dashes import driven_m, line_levels
from hippodrome.core.navigation.driving import pace
from hippodrome.core.navigation.junctions import gate_speed_mps, room_to_stop_m
from hippodrome.core.navigation.searching import LaneMemory
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.speed import can_stop, following_mps2, stop_mps2, stopping_mps, there_mps2
from hippodrome.core.navigation.steering import lane_curvature_1pm, steering_rad
from hippodrome.core.navigation.types import Lamp, Radar
from hippodrome.core.navigation.watch import SensorHealth, watched
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.roads.paths import Piece
from hippodrome.core.types import Observation
from hippodrome.core.views.config import CameraGeometry
from tests.core.navigation.roads import network_of

DRIVE, VEHICLE, CAMERA = DriveConfig(), VehicleShape(), CameraGeometry()


def test_samsons_law_steers_back_to_the_lane():
    assert lane_curvature_1pm(0.1, 0.0, 0.0, 5.0, DRIVE) == pytest.approx(0.1)
    assert lane_curvature_1pm(0.0, 0.9, 0.0, 5.0, DRIVE) == pytest.approx(-0.9 / 9.0)
    assert lane_curvature_1pm(0.0, 0.0, 0.3, 5.0, DRIVE) == pytest.approx(-2.0 * 0.3 / 3.0)


def test_the_wheels_stand_as_the_bicycle_needs_them_and_never_beyond_their_stop():
    assert steering_rad(0.1, 1.0, DRIVE, VEHICLE) == pytest.approx(math.atan(0.27))
    assert steering_rad(9.0, 0.0, DRIVE, VEHICLE) == VEHICLE.max_steering_rad
    assert steering_rad(0.3, 10.0, DRIVE, VEHICLE) == pytest.approx(math.atan(2.7 * 0.0375))


def test_stopping_is_half_of_the_speed_squared_over_the_braking():
    assert stopping_mps(4.0, 2.0) == 4.0
    assert can_stop(4.0, 4.0, 2.0) and not can_stop(3.9, 4.0, 2.0)
    assert stop_mps2(4.0, 4.0, DRIVE, VEHICLE) == pytest.approx(-2.0)
    assert math.isinf(stop_mps2(4.0, 40.0, DRIVE, VEHICLE)) and math.isinf(stop_mps2(4.0, math.inf, DRIVE, VEHICLE))
    assert there_mps2(0.4, DRIVE) == -DRIVE.braking_mps2 and math.isinf(there_mps2(0.6, DRIVE))


def test_the_intelligent_driver_model_holds_its_gap():
    wanted = DRIVE.jam_gap_m + 10.0 * DRIVE.headway_s
    assert following_mps2(10.0, Radar(wanted, 0.0), DRIVE, VEHICLE) == pytest.approx(0.0)
    assert following_mps2(10.0, Radar(0.5 * wanted, 0.0), DRIVE, VEHICLE) == pytest.approx(-3.0 * DRIVE.following_mps2)
    assert math.isinf(following_mps2(10.0, Radar(), DRIVE, VEHICLE))
    assert following_mps2(10.0, Radar(8.0, 10.0), DRIVE, VEHICLE) == -VEHICLE.max_braking_mps2


@pytest.mark.parametrize(
    ("to_stop_m", "speed", "radar", "stops"),
    [
        (10.0, 5.0, Radar(lamp=Lamp.RED), True),
        (10.0, 5.0, Radar(lamp=Lamp.GREEN), False),
        (10.0, 5.0, Radar(way_is_free=False), True),
        (10.0, 5.0, Radar(), False),
        (1.0, 8.0, Radar(lamp=Lamp.YELLOW), False),  # too late to stop
        (10.0, 8.0, Radar(lamp=Lamp.YELLOW), True),
        (-2.0, 3.0, Radar(lamp=Lamp.RED), False),  # in the junction already
        (60.0, 8.0, Radar(lamp=Lamp.RED), False),  # far off
        (-0.8, 1.4, Radar(way_is_free=False), True),  # beyond the line, and before the mouth still
        (-0.8, 3.0, Radar(way_is_free=False), False),  # it would come to stand in the junction
    ],
)
def test_who_goes_into_a_junction(to_stop_m, speed, radar, stops):
    assert math.isfinite(gate_speed_mps(to_stop_m, speed, radar, DRIVE)[0]) == stops


def test_who_is_beyond_the_line_has_room_up_to_the_mouth():
    assert room_to_stop_m(3.0) == 3.0
    assert room_to_stop_m(-0.6) == pytest.approx(1.0)
    assert room_to_stop_m(-5.0) == 0.0


def test_a_steered_turn_tells_the_scale():
    motion = motions.Motion(speed_mps=4.0, steering_rad=0.4)
    bend = math.tan(0.4) / VEHICLE.wheelbase_m
    for k in range(100):  # the odometry says 2 units per second, the vehicle drives 4 m/s
        seen = Observation(0.1 * (k + 1), 0.1, 2.0, 4.0 * bend)
        motion = motions.sensed(motion, seen, 2.0, VEHICLE)
    assert motion.turned / motion.turning == pytest.approx(2.0)
    assert motion.metres_per_unit(1.6) == pytest.approx(2.0, rel=0.04)


def dashed_road(driven):
    """A frame with a dashed line 1.6 m to the left: dashes of 3 m every 9 m, seen after so many metres."""
    frame = np.full((120, 160, 3), 100, dtype=np.uint8)
    focal, rows = CAMERA.focal_px(160), np.arange(60, 120)
    depth = focal * (CAMERA.height_m - 0.05) / np.maximum(rows - 59.5, 0.5)
    along = depth + CAMERA.forward_m + driven
    for row, far, place in zip(rows, depth, along, strict=True):
        if place % 9.0 < 3.0:
            column = round(79.5 - focal * 1.6 / far)
            frame[row, max(column - 1, 0) : max(column + 2, 0)] = 235
    return frame


@pytest.mark.parametrize("step_m", [0.9, 1.7, 2.6])
def test_passing_dashes_tell_the_metres(step_m):
    before, after = (line_levels(dashed_road(at), CAMERA, 0.0, 0.0, 0.0, 1.0) for at in (4.0, 4.0 + step_m))
    assert driven_m(before, after, 0.6 * step_m) == pytest.approx(step_m, abs=0.15)


def metres_by(frames, metres=60.0, step_m=0.8):
    """The metres that are counted where the localizer's scale is 4 % too large, and how wrong they may be for each metre."""
    senses, counted = Senses(NavigatorConfig(), -1.0, 2.0), 0.0
    senses.memory = LaneMemory(since_m=0.0)
    senses.motion = motions.Motion(told=math.log(2.0 * 1.04), told_m=100.0)
    for k in range(round(metres / step_m)):
        observation = Observation(0.1 * k, 0.1, 10.0 * step_m / 2.0, 0.0, frames(step_m * k))
        moved_m = senses.metres_per_unit * step_m / 2.0
        senses.motion = motions.sensed(senses.motion, observation, senses.metres_per_unit, VEHICLE)
        counted += moved_m + senses._see_dashes(observation, moved_m)
    return counted, senses.drift_sigma


def test_metres_are_those_of_the_dashes_where_there_are_some():
    counted, drift = metres_by(dashed_road)
    blind, more_drift = metres_by(lambda driven: np.full((120, 160, 3), 100, dtype=np.uint8))
    assert counted == pytest.approx(60.0, abs=1.3)  # until some have passed the scale tells, and the painter's dashes are coarse
    assert blind == pytest.approx(62.4, abs=0.3)
    assert drift < 0.7 * more_drift


def test_what_was_told_long_ago_tells_less_of_the_scale():
    told = motions.Motion(told=math.log(2.0), told_m=100.0)
    later = motions.sensed(told, Observation(0.1, 0.1, 3000.0, 0.0), 2.0, VEHICLE)
    assert later.scale_sigma(1.6) > 1.5 * told.scale_sigma(1.6)


def test_plain_asphalt_tells_nothing():
    plain = line_levels(np.full((120, 160, 3), 100, dtype=np.uint8), CAMERA, 0.0, 0.0, 0.0, 1.0)
    assert math.isnan(driven_m(plain, plain, 1.5))


def test_the_lane_corrects_across_and_its_end_along():
    track = tracks.begun(np.array([10.0, 0.6, 0.0]), np.diag([4.0, 1.0, 0.01]))
    reading = RoadReading(offset_m=0.0, offset_variance_m2=0.01, heading_rad=0.0, heading_variance_rad2=1e-4)
    across, fits = tracks.with_lane(track, reading, np.array([10.0, 0.0]), 0.0)
    assert fits and abs(across.pose[1]) < 0.03 and across.pose[0] == pytest.approx(10.0)
    line = RoadReading(end_m=7.1, end_variance_m2=0.01, end=LaneEnd.STOP_LINE)  # 8 m to the end of the lane, 10 m were believed
    along, fits = tracks.with_end(track, line, 10.0, 0.0)
    assert fits and along.pose[0] == pytest.approx(12.0, abs=0.15) and along.pose[1] == pytest.approx(0.6)


def test_a_reading_of_another_lane_is_left_out():
    track = tracks.begun(np.array([10.0, 0.0, 0.0]), np.diag([0.04, 0.04, 1e-4]))
    reading = RoadReading(offset_m=3.0, offset_variance_m2=0.01)
    assert not tracks.with_lane(track, reading, np.array([10.0, 0.0]), 0.0)[1]


def test_what_a_wrong_scale_does_grows_with_the_way_and_goes_into_the_next_street():
    track = tracks.begun(np.zeros(3), np.diag([1e-4, 1e-4, 1e-6]))
    for _ in range(100):
        track = tracks.moved(track, 1.0, 0.0)
    way = 100.0 / tracks.SCALE_MEMORY_M  # the integral of a Gauss-Markov process: 2 s^2 L^2 (d/L - 1 + exp(-d/L))
    scale_m = tracks.SCALE_SIGMA * tracks.SCALE_MEMORY_M * math.sqrt(2.0 * (way - 1.0 + math.exp(-way)))
    assert track.along_sigma_m == pytest.approx(math.hypot(scale_m, math.sqrt(100 * tracks.ALONG_PER_M)), rel=0.05)
    turned = tracks.moved(track, 0.01, 0.5 * math.pi)
    reading = RoadReading(offset_m=0.0, offset_variance_m2=0.01)
    known = tracks.with_lane(turned, reading, turned.pose[:2], 0.5 * math.pi)[0]
    assert turned.covariance[0, 0] > 1.0 and known.covariance[0, 0] < 0.05


def test_a_place_along_the_way_tells_of_the_scale_unless_it_is_a_surprise():
    track = tracks.begun(np.zeros(3), np.diag([0.01, 0.01, 1e-6]))
    for _ in range(40):
        track = tracks.moved(track, 1.0, 0.0)
    axis, sigma_m = track.worst_axis()
    np.testing.assert_allclose(axis, [1.0, 0.0], atol=0.01)
    ahead = tracks.known_along(track, axis, 0.5, 0.04)
    assert ahead.pose[0] == pytest.approx(40.5, abs=0.01) and ahead.covariance[0, 0] == pytest.approx(0.04, rel=0.01)
    share = track.covariance[0, 3] / track.covariance[0, 0]  # the scale follows the place as the covariance has it
    assert ahead.metres_off == pytest.approx(0.5 * share, rel=0.01) and 0.08 < ahead.metres_off < 0.8
    far = tracks.known_along(track, axis, 8.0, 0.04)  # seven standard deviations: the pose was wrong, and the scale need not be
    assert far.pose[0] == pytest.approx(48.0, abs=0.01) and far.metres_off < 8.0 * share / 20.0
    assert sigma_m < 1.3 and np.linalg.eigvalsh(far.covariance).min() > -1e-9


def failing(observe, radar=Radar(), seconds=5.0, speed=5.0, wheels=0.0):
    health = SensorHealth()
    for k in range(round(10 * seconds)):
        health = watched(health, observe(k), radar, speed, wheels, WatchConfig(), VEHICLE)
    return health.complaint(WatchConfig())


def test_what_a_measurement_told_is_what_it_left():
    before = tracks.begun(np.zeros(3), np.diag([1.0, 1.0, 1e-6]))
    after = tracks.known_along(before, np.array([1.0, 0.0]), 0.1, 0.2)
    assert tracks.told_along_m(before, after) == pytest.approx(0.5)  # 1 / (1 / .2 - 1 / 1) = .25
    assert tracks.told_along_m(before, before) == math.inf


def test_sensors_that_fail_are_named():
    frame = np.full((120, 160, 3), 90, dtype=np.uint8)

    def fine(k):
        return Observation(0.1 * (k + 1), 0.1, 5.0, 1e-3 * math.sin(k), frame)

    assert failing(fine) == (False, "")
    assert failing(lambda k: Observation(0.1 * (k + 1), 0.1, 5.0, 1e-3 * k)) == (True, "there are no frames")
    black = np.zeros((120, 160, 3), dtype=np.uint8)
    assert failing(lambda k: Observation(0.1 * (k + 1), 0.1, 5.0, 1e-3 * k, black)) == (True, "the frames are black")
    assert failing(lambda k: Observation(0.1 * (k + 1), 0.1, 5.0, 1e-3, frame)) == (True, "the gyro is frozen")
    assert failing(fine, wheels=0.3) == (True, "the gyro does not tell how the vehicle turns")
    assert failing(fine, Radar(blind=True)) == (True, "the radar is blind")


def test_dashes_that_turns_contradict_are_dropped():
    """A dash that is taken for the next one tells a wrong scale with great certainty."""
    turned = motions.Motion(turned=2.0, turning=1.0, turned_rad=1.0)
    right, wrong = motions.seen(turned, 20.4, 10.0), motions.seen(turned, 15.0, 10.0)
    assert right.dashes_fit(1.6) and right.metres_per_unit(1.6) == pytest.approx(2.04, rel=0.01)
    assert not wrong.dashes_fit(1.6) and wrong.metres_per_unit(1.6) == pytest.approx(2.0, rel=0.03)
    assert motions.seen(motions.Motion(), 15.0, 10.0).dashes_fit(1.6)  # nothing contradicts them yet
    assert not motions.unseen(wrong).dashes_fit(1.6)


def test_a_scale_that_is_told_anew_is_heard_as_at_the_first_time():
    known = motions.Motion()
    for _ in range(200):
        known = motions.told(known, 2.0, 1.0)
    again = motions.told(motions.untold(known), 1.0, 1.0)
    expected = motions.told(motions.Motion(), 1.0, 1.0)
    assert again.scale_without_dashes(1.5) == expected.scale_without_dashes(1.5)
    assert known.scale_without_dashes(1.5)[1] < 0.5 * again.scale_without_dashes(1.5)[1]


def test_nobody_is_waited_for_where_one_road_merely_goes_on_as_another():
    """Lane 0, 1 inside, 2 a road that bends on; 3 inside, 4: a crossing, which lane 5 crosses inside."""
    lines = [
        [(0.0, 0.0), (40.0, 0.0)], [(40.0, 0.0), (44.0, 0.0)], [(44.0, 0.0), (80.0, 0.0)], [(80.0, 0.0), (94.0, 0.0)],
        [(94.0, 0.0), (150.0, 0.0)], [(87.0, -7.0), (87.0, 7.0)],
    ]  # fmt: skip
    network = network_of(lines, [(0, 1), (1, 2), (2, 3), (3, 4)], internal=(1, 3, 5))
    pieces = [Piece(lane, 0.0, math.dist(*line), False, 10.0) for lane, line in enumerate(lines[:5])]
    course = make_course(network, pieces, 4, 50.0, NavigatorConfig().drive, NavigatorConfig().vehicle)
    assert [gate.meets_others for gate in course.gates] == [False, True]
    assert next_gate(course, 30.0).entry_u_m == pytest.approx(40.0, abs=0.5)
    assert next_mouth(course, 30.0).entry_u_m == pytest.approx(80.0, abs=0.5)
    config = NavigatorConfig()
    step = pace(course, 34.0, 5.0, Radar(way_is_free=False), 0.0, config.drive, config.vehicle)
    assert step.reason == "" and step.speed_mps > 5.0  # who comes has the right of way at the crossing, 40 m ahead
    step = pace(course, 72.0, 2.0, Radar(way_is_free=False), 0.0, config.drive, config.vehicle)
    assert step.reason == "gives way"
    step = pace(course, 34.0, 5.0, Radar(lamp=Lamp.RED), 0.0, config.drive, config.vehicle)
    assert step.reason == "waits at a red light"  # a signal may stand anywhere
