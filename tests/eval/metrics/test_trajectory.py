"""APE and RPE: hand-computed figures, and evo as the independent reference."""

import numpy as np
import pytest
from evo.core import metrics as evo_metrics
from evo.core.filters import FilterException
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.metrics.trajectory import (
    MetricError,
    ape,
    path_length_m,
    pool,
    rpe,
)

TOLERANCE_M = 1e-9
FAST = settings(max_examples=40, deadline=None)


@st.composite
def drives(draw):
    """A random drive and a noisy, scaled, turned estimate of it."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(12, 80))
    steps = np.column_stack([rng.uniform(1.0, 6.0, count), np.zeros(count), rng.normal(0.0, 0.3, count)])
    steps[rng.uniform(size=count) < draw(st.sampled_from([0.0, 0.2])), :2] = 0.0  # stops
    true = se2.integrate(np.array([*rng.uniform(-2e3, 2e3, 2), rng.uniform(-3, 3)]), steps)
    scale, offset = draw(st.sampled_from([1.0, 0.5])), np.array([*rng.uniform(-50, 50, 2), rng.uniform(-3, 3)])
    scaled = np.column_stack([scale * true[:, :2], true[:, 2]])
    noise = rng.normal(0.0, 1.0, (count, 3)) * np.array([2.0, 2.0, 0.1])
    t_s = np.cumsum(rng.uniform(0.05, 0.2, count))
    return Trajectory(t_s, se2.compose(offset, scaled) + noise), Trajectory(t_s, true)


def as_evo(trajectory):
    t_s, (x, y, heading) = trajectory.t_s, trajectory.poses.T
    zero = np.zeros(len(t_s))
    quaternions = np.column_stack([np.cos(heading / 2.0), zero, zero, np.sin(heading / 2.0)])
    return PoseTrajectory3D(positions_xyz=np.column_stack([x, y, zero]), orientations_quat_wxyz=quaternions, timestamps=t_s)


def evo_errors(metric, estimate, reference, align=None):
    estimate, reference = as_evo(estimate), as_evo(reference)
    if align == "start":
        estimate.align_origin(reference)
    elif align is not None:
        estimate.align(reference, correct_scale=align == "sim3")
    metric.process_data((reference, estimate))
    return metric


@given(drive=drives(), alignment=st.sampled_from(["none", "start", "se3", "sim3"]))
@FAST
def test_ape_equals_evo(drive, alignment):
    metric = evo_errors(
        evo_metrics.APE(evo_metrics.PoseRelation.translation_part), *drive, align=None if alignment == "none" else alignment
    )
    score = ape(*drive, alignment)
    assert np.abs(score.errors_m - metric.error).max() < TOLERANCE_M
    statistics = metric.get_all_statistics()
    assert score.rmse_m == pytest.approx(statistics["rmse"], abs=TOLERANCE_M)
    assert score.mean_m == pytest.approx(statistics["mean"], abs=TOLERANCE_M)
    assert score.median_m == pytest.approx(statistics["median"], abs=TOLERANCE_M)
    assert score.max_m == pytest.approx(statistics["max"], abs=TOLERANCE_M)


@given(drive=drives(), delta_m=st.sampled_from([None, 5.0, 20.0]), pairing=st.sampled_from(["all", "chained"]))
@FAST
def test_rpe_equals_evo(drive, delta_m, pairing):
    metric = evo_metrics.RPE(
        evo_metrics.PoseRelation.translation_part,
        delta=1 if delta_m is None else delta_m,
        delta_unit=evo_metrics.Unit.frames if delta_m is None else evo_metrics.Unit.meters,
        all_pairs=pairing == "all" and delta_m is not None,
        pairs_from_reference=True,
    )
    try:
        expected = evo_errors(metric, *drive).error
    except FilterException:  # the drive is shorter than the delta: both refuse
        with pytest.raises(MetricError):
            rpe(*drive, delta_m, pairing=pairing)
        return
    assert np.abs(rpe(*drive, delta_m, pairing=pairing).errors_m - expected).max() < TOLERANCE_M


def line(count=5, step_m=2.0, side_m=0.0, scale=1.0):
    t_s = 0.1 * np.arange(count)
    return Trajectory(t_s, np.column_stack([scale * step_m * np.arange(count), np.full(count, side_m), np.zeros(count)]))


def test_ape_by_hand():
    score = ape(line(side_m=3.0), line())
    assert score.errors_m.tolist() == [3.0] * 5
    assert (score.count, score.matched, score.total) == (5, 5, 5)
    assert ape(line(scale=0.5), line(), "start").errors_m.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_statistics_by_hand():
    score = ape(line(scale=0.5), line())
    assert (score.mean_m, score.median_m, score.max_m, score.rmse_m) == (2.0, 2.0, 4.0, np.sqrt(6.0))
    assert score.p95_m == pytest.approx(3.8)


def test_rpe_by_hand():
    assert rpe(line(scale=0.5), line()).errors_m.tolist() == [1.0] * 4
    assert rpe(line(scale=0.5), line(), 4.0).errors_m.tolist() == [2.0] * 3
    assert rpe(line(scale=0.5), line(), 4.0, pairing="chained").errors_m.tolist() == [2.0] * 2


def test_rpe_does_not_depend_on_a_rigid_offset():
    moved = Trajectory(line().t_s, se2.compose(np.array([100.0, -50.0, 2.0]), line(scale=0.9).poses))
    assert np.allclose(rpe(moved, line(), 4.0).errors_m, rpe(line(scale=0.9), line(), 4.0).errors_m, atol=1e-12)


def test_pairs_never_cross_a_gap_of_the_reference():
    whole = line(count=40)
    kept = np.r_[0:15, 25:40]
    reference = Trajectory(whole.t_s[kept], whole.poses[kept])
    broken = rpe(Trajectory(whole.t_s[kept], whole.poses[kept]), reference)
    assert broken.count == 14 + 14  # consecutive in the estimate, but the reference is unknown in between
    assert rpe(reference, reference, 4.0).count == 13 + 13


def test_pairs_never_skip_an_unmatched_sample():
    estimate = line(count=41)
    reference = Trajectory(np.delete(estimate.t_s, [20]), np.delete(estimate.poses, [20], axis=0))
    score = rpe(estimate, reference, max_gap_s=0.15)
    assert (score.count, score.matched, score.total) == (38, 40, 41)


def test_no_pair_is_an_error_not_an_empty_score():
    with pytest.raises(MetricError, match=r"delta 500 m .* no such pair among 5 samples"):
        rpe(line(), line(), 500.0)


def test_definitions_name_alignment_delta_unit_and_pairing():
    assert "alignment Sim(2)" in ape(line(side_m=1.0), line(), "sim2").definition
    definition = rpe(line(), line(), 4.0).definition
    assert all(
        word in definition for word in ("delta 4 m of reference path", "all pairs within 10%", "no scale correction", "m;")
    )
    assert "consecutive samples" in rpe(line(), line()).definition
    assert len({rpe(line(), line(), 4.0, pairing=how).definition for how in ("all", "chained")}) == 2


def test_scores_of_different_definitions_refuse_pooling():
    free, aligned = ape(line(side_m=1.0), line()), ape(line(side_m=1.0), line(), "start")
    with pytest.raises(MetricError, match=r"different definitions cannot be compared: 'APE.*none.*' and 'APE.*start"):
        pool([free, aligned])


def test_pooling_weighs_samples_not_runs():
    short, long = ape(line(count=2, side_m=10.0), line(count=2)), ape(line(count=8, side_m=0.0), line(count=8))
    pooled = pool([short, long])
    assert (pooled.mean_m, pooled.count, pooled.total) == (2.0, 10, 10)
    assert pooled.rmse_m == pytest.approx(np.sqrt(20.0))  # the mean of the RMSEs would be 5


def test_arguments_are_not_changed():
    estimate, reference = line(scale=0.5, side_m=2.0), line()
    before = estimate.poses.copy(), reference.poses.copy()
    ape(estimate, reference, "start")
    rpe(estimate, reference, 4.0)
    assert np.array_equal(estimate.poses, before[0])
    assert np.array_equal(reference.poses, before[1])


def test_path_length():
    assert path_length_m(np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 1.0], [3.0, 4.0, 2.0]])).tolist() == [0.0, 5.0, 5.0]
