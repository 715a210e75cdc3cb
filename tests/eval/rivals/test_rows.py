"""The ablation changes nothing but what it leaves out; the stereo camera sees the same drive."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import map_drive
from hippodrome.core.types import HippodromeError, Observation
from hippodrome.eval.rivals.orbslam3.method import OrbSlam3
from hippodrome.eval.rivals.rows import (
    RatSlamMethod,
    map_without_attractor,
    run_ratslam,
    save_ratslam,
)
from hippodrome.eval.trials.rivals.stage import seen_as_needed
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.record import RecordingPlan, prepare
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec


def circling(laps, views=150):
    """Round a circle of ``views`` steps, each of which has a picture of its own."""
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 256, (views, 12, 16), dtype=np.uint8).repeat(10, axis=1).repeat(10, axis=2)
    turn = 2 * np.pi / views / 0.6
    return [Observation(0.6 * (i + 1), 0.6, 5.0, turn, pictures[i % views]) for i in range(laps * views)]


def test_the_map_without_attractors_has_the_same_vertices_edges_and_poses():
    drive = circling(2)
    whole = map_drive(drive, MapperConfig())
    without, cpu_s = map_without_attractor(drive, MapperConfig())
    assert cpu_s > 0.0
    assert_array_equal(without.poses, whole.poses)
    assert_array_equal(without.edges.motion, whole.edges.motion)
    assert_array_equal(without.view_cell, whole.view_cell)
    assert without.attractors.grid_period.size == 0
    assert not without.attractors.head_mean_rad.any()


def test_the_map_without_attractors_is_a_smaller_file_that_loads(tmp_path):
    drive = circling(2)
    whole = save_map(tmp_path / "whole.pbstream", map_drive(drive, MapperConfig()), {})
    without, _ = map_without_attractor(drive, MapperConfig())
    assert save_map(tmp_path / "without.pbstream", without, {}) < whole
    assert_array_equal(load_map(tmp_path / "without.pbstream")[0].poses, without.poses)


def test_ratslam_s_map_is_written_whole_and_the_same_each_time(tmp_path):
    found, _ = run_ratslam(circling(2))
    sizes = [save_ratslam(tmp_path / name, found) for name in ("a.npz", "b.npz")]
    assert sizes[0] == (tmp_path / "a.npz").stat().st_size
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    stored = np.load(tmp_path / "a.npz")
    assert_array_equal(stored["images"], found.images)
    assert stored["link_ends"].shape == (2, len(found.links.source))


def test_the_stereo_camera_sees_the_same_drive(tmp_path):
    town = TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9)
    drive = DriveSpec(tour=TourSpec(length_m=150.0), traffic=TrafficSpec(vehicles=2))
    scenario = Scenario(name="pair", seed=5, town=town, mapping=drive)
    stereo = seen_as_needed(scenario, OrbSlam3.needs)
    assert (stereo.camera.width, stereo.camera.rate_hz) == (640, scenario.odometry_rate_hz)
    assert stereo.camera.stereo_baseline_m == 0.5
    plans = [RecordingPlan(one, "mapping", tmp_path) for one in (scenario, stereo)]
    for plan in plans:
        prepare(plan)
    assert plans[0].folder() != plans[1].folder()
    drives = [(plan.folder() / "drive.npz").read_bytes() for plan in plans]
    assert drives[0] == drives[1]


def test_a_drive_too_long_for_ratslam_is_a_row_that_says_so():
    with pytest.raises(HippodromeError, match="not run: the drive takes 4000 s"):
        RatSlamMethod().map(iter(()), SimpleNamespace(duration_s=4000.0))
