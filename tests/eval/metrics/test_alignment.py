import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.metrics.alignment import (
    DegenerateAlignment,
    apply_to_positions,
    apply_to_trajectory,
    find_alignment,
    start_alignment,
    umeyama,
)

seeds = st.integers(0, 2**32 - 1)


def drive(seed, count=30):
    rng = np.random.default_rng(seed)
    steps = np.column_stack([rng.uniform(1.0, 5.0, count), np.zeros(count), rng.normal(0.0, 0.5, count)])
    return se2.integrate(rng.normal(size=3), steps)


def moved(poses, seed, scale):
    rng = np.random.default_rng(seed)
    scaled = np.column_stack([scale * poses[:, :2], poses[:, 2]])
    return se2.compose(np.array([*rng.uniform(-500, 500, 2), rng.uniform(-3, 3)]), scaled)


@given(seed=seeds, scale=st.floats(0.1, 10.0), name=st.sampled_from(["sim2", "sim3"]))
@settings(deadline=None)
def test_similarity_alignment_undoes_a_similarity(seed, scale, name):
    true = drive(seed)
    transform = find_alignment(name, moved(true, seed + 1, scale), true)
    assert transform.scale == pytest.approx(1.0 / scale, rel=1e-9)
    found = apply_to_positions(transform, moved(true, seed + 1, scale)[:, :2])
    assert np.abs(found[:, :2] - true[:, :2]).max() < 1e-8


@given(seed=seeds, name=st.sampled_from(["se2", "start"]))
@settings(deadline=None)
def test_rigid_alignment_undoes_a_rigid_motion_of_whole_poses(seed, name):
    true = drive(seed)
    estimate = moved(true, seed + 1, 1.0)
    aligned = apply_to_trajectory(find_alignment(name, estimate, true), Trajectory(np.arange(30.0), estimate))
    assert np.abs(aligned.poses[:, :2] - true[:, :2]).max() < 1e-8
    assert np.abs(se2.wrap(aligned.poses[:, 2] - true[:, 2])).max() < 1e-9


@given(seed=seeds)
@settings(deadline=None)
def test_more_freedom_never_fits_worse(seed):
    rng = np.random.default_rng(seed)
    true = drive(seed)
    estimate = moved(true, seed, 0.7) + rng.normal(0.0, 2.0, true.shape)

    def residual(name):
        found = apply_to_positions(find_alignment(name, estimate, true), estimate[:, :2])
        return np.sum((found[:, :2] - true[:, :2]) ** 2)

    slack = 1.0 + 1e-9
    assert residual("sim2") <= slack * residual("se2") <= slack**2 * residual("start")
    assert residual("se3") <= slack * residual("se2")


def test_start_alignment_by_hand():
    transform = start_alignment(np.array([1.0, 0.0, 0.0]), np.array([10.0, 20.0, np.pi / 2]))
    found = apply_to_positions(transform, np.array([[1.0, 0.0], [3.0, 1.0]]))
    assert np.allclose(found, [[10.0, 20.0], [9.0, 22.0]])


def test_planar_fit_never_mirrors():
    true = drive(3)
    mirrored = true * np.array([1.0, -1.0, -1.0])
    assert np.linalg.det(find_alignment("se2", mirrored, true).rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["se2", "sim2", "se3", "sim3"])
@pytest.mark.parametrize("which", [0, 1])
def test_points_that_coincide_are_degenerate(name, which):
    poses = [drive(1), drive(1)]
    poses[which] = np.tile([5e3, -2e3, 0.1], (30, 1))
    with pytest.raises(DegenerateAlignment, match=r"they coincide \(rank 0"):
        find_alignment(name, *poses)


def test_points_on_a_line_fix_a_planar_transform_but_no_spatial_one():
    poses = np.column_stack([np.arange(10.0), 2.0 * np.arange(10.0), np.zeros(10)])
    assert find_alignment("sim2", poses, poses).scale == pytest.approx(1.0)
    with pytest.raises(DegenerateAlignment, match=r"they lie on a line \(rank 1, needed 2\)"):
        find_alignment("se3", poses, poses)


def test_a_single_point_has_no_fit():
    with pytest.raises(DegenerateAlignment):
        umeyama(np.ones((1, 2)), np.ones((1, 2)), with_scale=False)


def test_poses_refuse_a_spatial_transform():
    true = drive(1)
    with pytest.raises(ValueError, match="planar transform"):
        apply_to_trajectory(find_alignment("se3", true, true), Trajectory(np.arange(30.0), true))


def test_an_unknown_name_is_not_taken_for_another():
    with pytest.raises(ValueError, match=r"alignment 'SE\(2\)' is unknown, use one of none, start, se2"):
        find_alignment("SE(2)", drive(1), drive(1))
