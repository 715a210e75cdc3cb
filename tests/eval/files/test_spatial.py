"""Poses in space come level into the plane, whatever their frame; held against evo."""

import dataclasses
import gzip
from pathlib import Path

import numpy as np
import pytest
from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hippodrome.core.types import Trajectory
from hippodrome.eval.files.spatial import SpatialPoses, flatten, level, lifted, motion_in_body, read_poses
from hippodrome.eval.files.trajectories import read_tum, write_tum
from hippodrome.eval.metrics.association import TrajectoryError
from hippodrome.eval.metrics.trajectory import ape

KITTI = Path(__file__).parents[3].parent / "shared" / "real" / "kitti"
CAMERA_IN_BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x right, y down, z forward


def drive(count=200, radius_m=40.0):
    """A figure of eight with a heading along it."""
    s = np.linspace(0.0, 2.0 * np.pi, count)
    xy = radius_m * np.column_stack([np.sin(s), np.sin(s) * np.cos(s)])
    d = np.gradient(xy, axis=0)
    return Trajectory(0.1 * np.arange(count), np.column_stack([xy, np.arctan2(d[:, 1], d[:, 0])]))


def seen(trajectory, world, mounting):
    """The drive as a tracker tells it: in a world turned by ``world``, of a camera turned in the body by ``mounting``."""
    flat = lifted(trajectory)
    rotations = np.einsum("ij,njk,kl->nil", world, flat.rotations, mounting)
    return SpatialPoses(flat.t_s, flat.positions @ world.T, rotations, "camera")


def tum(path, poses):
    quaternions = Rotation.from_matrix(poses.rotations).as_quat()
    np.savetxt(path, np.column_stack([poses.t_s, poses.positions, quaternions]), fmt="%.12f")
    return path


@given(seed=st.integers(0, 2**32 - 1), pitch_deg=st.floats(-20.0, 20.0))
@settings(max_examples=30, deadline=None)
def test_a_pitched_camera_in_any_world_makes_no_error(seed, pitch_deg):
    world = Rotation.random(random_state=seed).as_matrix()
    mounting = CAMERA_IN_BODY @ Rotation.from_euler("x", pitch_deg, degrees=True).as_matrix()
    truth = drive()
    poses = seen(truth, world, mounting)
    for found in (flatten(poses), flatten(poses, lifted(truth))):
        assert ape(found, truth, "se2").max_m < 1e-6
        turn = np.diff(np.unwrap(found.poses[:, 2])) - np.diff(np.unwrap(truth.poses[:, 2]))
        assert np.abs(turn).max() < 1e-6


def test_a_straight_drive_is_levelled_by_its_attitudes_and_its_errors_are_not_hidden():
    """A fit in space could turn the drift sideways into the height, where nobody looks."""
    t_s = 0.1 * np.arange(100)
    truth = Trajectory(t_s, np.column_stack([t_s * 10.0, np.zeros(100), np.zeros(100)]))
    drifting = Trajectory(t_s, np.column_stack([t_s * 10.0, 0.02 * t_s**2, np.zeros(100)]))
    poses = seen(drifting, np.eye(3), CAMERA_IN_BODY)
    bumpy = dataclasses.replace(poses, positions=poses.positions + np.array([[0.0, 0.0, 1e-3]]) * np.sin(t_s)[:, None])
    expected = ape(drifting, truth, "se2").mean_m
    assert ape(flatten(bumpy, lifted(truth)), truth, "se2").mean_m == pytest.approx(expected, rel=1e-3)


def test_poses_of_the_plane_stay_as_they_are(tmp_path):
    write_tum(tmp_path / "a.tum", drive())
    assert np.array_equal(flatten(read_poses(tmp_path / "a.tum")).poses[:, :2], drive().poses[:, :2])
    assert np.allclose(flatten(read_poses(tmp_path / "a.tum")).poses, read_tum(tmp_path / "a.tum").poses, atol=1e-12)


def test_a_road_that_climbs_is_not_laid_flat():
    t_s = 0.1 * np.arange(100)
    slope = np.radians(2.5)
    flat = lifted(Trajectory(t_s, np.column_stack([t_s * 10.0, np.zeros(100), np.zeros(100)])))
    turn = Rotation.from_euler("y", -slope).as_matrix()
    climbing = SpatialPoses(t_s, flat.positions @ turn.T, turn @ flat.rotations, "body")
    assert np.array_equal(level(climbing), np.eye(3))


def test_positions_alone_take_their_heading_from_the_motion(tmp_path):
    truth = drive()
    rest = np.tile([0.0, 0.0, 0.0, 0.0, 1.0], (len(truth.t_s), 1))
    np.savetxt(tmp_path / "a.tum", np.column_stack([truth.t_s, truth.poses[:, :2], rest]))
    found = read_poses(tmp_path / "a.tum")
    assert "direction of motion" in found.notes[0]
    assert np.abs(np.angle(np.exp(1j * (flatten(found).poses[:, 2] - truth.poses[:, 2])))).max() < 0.05


def test_axes_and_order_of_columns_are_told_by_the_motion(tmp_path):
    truth = drive()
    camera = tum(tmp_path / "cam.tum", seen(truth, np.eye(3), CAMERA_IN_BODY))
    with pytest.raises(TrajectoryError, match="give --axes camera"):
        read_poses(camera)
    assert motion_in_body(read_poses(camera, "camera"))[2] > 0.99
    table = np.loadtxt(tum(tmp_path / "body.tum", lifted(truth)))
    np.savetxt(tmp_path / "wxyz.tum", table[:, [0, 1, 2, 3, 7, 4, 5, 6]], fmt="%.12f")
    with pytest.raises(TrajectoryError, match=r"order qx qy qz qw|--axes"):
        read_poses(tmp_path / "wxyz.tum")


def test_degrees_and_nanoseconds_are_refused_and_a_parked_car_is_not(tmp_path):
    t_s = np.arange(100.0)
    rest = np.tile([0.0, 0.0, 0.0, 0.0, 1.0], (100, 1))
    degrees = np.column_stack([t_s, 49.0 + 1e-5 * t_s, np.full(100, 8.4), rest])
    np.savetxt(tmp_path / "gps.tum", degrees)
    with pytest.raises(TrajectoryError, match="latitude and longitude"):
        read_poses(tmp_path / "gps.tum")
    np.savetxt(tmp_path / "ns.tum", np.column_stack([1e9 * t_s, t_s, t_s, rest]))
    with pytest.raises(TrajectoryError, match="nanoseconds"):
        read_poses(tmp_path / "ns.tum")
    np.savetxt(tmp_path / "parked.tum", np.column_stack([t_s, np.full(100, 3.0), np.full(100, 2.0), rest]))
    assert len(read_poses(tmp_path / "parked.tum").t_s) == 100


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no poses"),
        ("1 2 3\n", "line 1: 3 columns, expected 8"),
        ("1 2 3 0 0 0 0 1\n2 2 3\n", "line 2: 3 columns"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n", "give --times"),
        ("1 2 3 0 0 0 0 9\n", "not a unit quaternion"),
        ("1 2 nan 0 0 0 0 1\n", "sample 0: its position is not finite"),
        ("2 2 3 0 0 0 0 1\n1 2 3 0 0 0 0 1\n", "does not increase"),
    ],
)
def test_what_are_no_poses_is_refused(tmp_path, text, complaint):
    (tmp_path / "a.tum").write_text(text)
    with pytest.raises(TrajectoryError, match=complaint):
        read_poses(tmp_path / "a.tum")


def test_repeated_rows_are_left_out_and_counted(tmp_path):
    (tmp_path / "a.tum").write_text("\ufeff  # a comment\n1 2 3 0 0 0 0 1\n1 2 3 0 0 0 0 1\n2 2 3 0 0 0 0 1\n")
    found = read_poses(tmp_path / "a.tum")
    assert found.t_s.tolist() == [1.0, 2.0]
    assert "1 row(s)" in found.notes[0]


def _unpacked(name, folder):
    (folder / name).write_bytes(gzip.decompress((KITTI / f"{name}.gz").read_bytes()))
    return folder / name


@pytest.mark.skipif(not KITTI.is_dir(), reason=f"{KITTI} is not there: real drives are not part of this repository")
def test_orb_slam_on_kitti_00_as_evo_scores_it(tmp_path):
    times = _unpacked("KITTI_00_gt_times.txt", tmp_path)
    truth = read_poses(_unpacked("00.txt", tmp_path), None, times)
    estimate = read_poses(_unpacked("KITTI_00_ORB.txt", tmp_path), None, times)
    flat = flatten(truth)
    ours = ape(flatten(estimate, lifted(flat)), flat, "se2")
    evo = []
    for poses in (truth, estimate):
        quaternions = np.roll(Rotation.from_matrix(poses.rotations).as_quat(), 1, axis=1)
        evo.append(PoseTrajectory3D(poses.positions, quaternions, poses.t_s))
    evo[1].align(evo[0])
    theirs = metrics.APE(metrics.PoseRelation.translation_part)
    theirs.process_data(tuple(evo))
    mean_m = theirs.get_statistic(metrics.StatisticsType.mean)
    assert 1.0 < mean_m < 1.3  # of all three axes
    assert ours.mean_m == pytest.approx(1.01, abs=0.02)  # of the two that a car drives in
    vertical = np.abs(evo[1].positions_xyz[:, 1] - evo[0].positions_xyz[:, 1])
    assert ours.rmse_m**2 + np.mean(vertical**2) == pytest.approx(
        theirs.get_statistic(metrics.StatisticsType.rmse) ** 2, rel=0.03
    )
