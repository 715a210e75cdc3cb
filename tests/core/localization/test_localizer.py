"""The localizer in a looped world, and its parts by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.localization.beliefs.attractor import AttractorBelief
from hippodrome.core.localization.beliefs.kalman import KalmanBelief
from hippodrome.core.localization.beliefs.motion import PoseMeasurement
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig, localize
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, LocalizationStatus, Observation
from hippodrome.core.views.config import SearchConfig
from tests.core.looped_world import Pictures, drive, loop_length, loop_pose, topometric_map

PICTURES = Pictures(seed=3)
MAP = topometric_map(PICTURES, np.random.default_rng(3))


def run(mode="coupled", cognitive_map=MAP, seed=11, length_m=700.0, metres_per_unit=2.5, **driving):
    observations, truth = drive(
        PICTURES, np.random.default_rng(seed), 137.0, length_m, metres_per_unit=metres_per_unit, **driving
    )
    estimates = localize(observations, cognitive_map, None, LocalizerConfig(mode=mode))
    localized = np.array([estimate.localized for estimate in estimates])
    error_m = np.linalg.norm(np.array([estimate.pose for estimate in estimates])[:, :2] - truth[:, :2], axis=1)
    return estimates, truth, localized, error_m


@pytest.fixture(scope="module")
def default_run():
    return run()


@pytest.fixture(scope="module")
def kalman_run():
    return run("kalman")


def test_finds_itself_from_an_unknown_start_although_the_scale_is_a_quarter_off(default_run):
    _, _, localized, error_m = default_run
    first = int(np.argmax(localized))
    assert 0 < first * 0.8 < 50.0  # metres driven
    assert localized[first:].mean() > 0.95
    assert error_m[localized].mean() < 1.2
    assert error_m[localized].max() < 6.0


def test_default_matches_the_kalman_yardstick(default_run, kalman_run):
    _, _, localized, error_m = default_run
    _, _, kalman_localized, kalman_error_m = kalman_run
    assert error_m[localized].mean() < 1.1 * kalman_error_m[kalman_localized].mean() + 0.05


def test_covariance_is_honest(default_run):
    estimates, truth, localized, _ = default_run
    nees = []
    for estimate, true, known in zip(estimates, truth, localized, strict=True):
        np.linalg.cholesky(estimate.covariance)
        error = estimate.pose[:2] - true[:2]
        if known:
            nees.append(error @ np.linalg.solve(estimate.covariance[:2, :2], error))
    assert 0.5 < np.mean(nees) < 4.0  # 2 for two degrees of freedom


def test_moves_smoothly_between_views(default_run):
    estimates, _, localized, _ = default_run
    first = int(np.argmax(localized)) + 1
    steps = np.linalg.norm(np.diff([estimate.pose[:2] for estimate in estimates[first:]], axis=0), axis=1)
    assert np.median(steps) == pytest.approx(0.8, rel=0.1)
    assert steps.max() < 3.5


def test_kidnapping_is_noticed_and_recovered_from():
    _, _, localized, error_m = run(kidnap=(400.0, 60.0))
    after = 500  # steps of 0.8 m
    assert error_m[after] > 100.0
    wrong = np.flatnonzero(localized[after:] & (error_m[after:] > 20.0))
    recovered = np.flatnonzero(localized[after:] & (error_m[after:] < 5.0))
    assert len(wrong) < 25
    assert recovered[0] * 0.8 < 60.0
    assert error_m[after + recovered[0] :].max() < 8.0


def test_another_town_is_never_taken_for_this_one():
    observations, _ = drive(Pictures(seed=99), np.random.default_rng(0), 0.0, 500.0)
    assert not any(estimate.localized for estimate in localize(observations, MAP, None, LocalizerConfig()))


def test_leaving_the_mapped_road_is_reported_once_dead_reckoning_is_spent():
    part = topometric_map(PICTURES, np.random.default_rng(3), span_m=0.35 * loop_length())
    _, _, localized, error_m = run(cognitive_map=part, length_m=720.0)
    assert localized[:200].mean() > 0.9
    assert not np.any(localized & (error_m > 20.0))
    assert not localized[int((0.95 * loop_length() - 137.0) / 0.8)]


def test_off_the_map_is_said_while_dead_reckoning_still_knows_where():
    part = topometric_map(PICTURES, np.random.default_rng(3), span_m=0.35 * loop_length())
    estimates, _, _, _ = run(cognitive_map=part, length_m=350.0)
    left = int((0.35 * loop_length() - 137.0) / 0.8)  # the step at which the mapped road ends
    assert {estimate.status for estimate in estimates[100:left]} == {LocalizationStatus.LOCALIZED}
    off = [estimate.status is LocalizationStatus.OFF_MAP for estimate in estimates]
    assert left < np.argmax(off) < left + 50
    assert all(off[left + 50 : left + 80])


def test_dead_reckoning_that_leads_off_the_roads_is_doubted():
    part = topometric_map(PICTURES, np.random.default_rng(3), span_m=0.35 * loop_length())
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 350.0)
    left = int((0.35 * loop_length() - 137.0) / 0.8) + 10
    across_fields = (replace(one, yaw_rate_radps=0.0) for one in observations[left:])
    estimates = localize([*observations[:left], *across_fields], part, loop_road(), LocalizerConfig())
    assert estimates[left + 30].status is LocalizationStatus.OFF_MAP
    assert estimates[-1].status is LocalizationStatus.DOUBTED
    assert localize(observations, part, loop_road(), LocalizerConfig())[-1].status is LocalizationStatus.OFF_MAP


def test_standing_adds_no_doubt_and_no_uncertainty():
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 150.0)
    other = PICTURES.frame(600.0, np.random.default_rng(0))  # a lorry pulls up: nothing of the street is seen any more
    still = [Observation(observations[-1].t_s + 0.1 * k, 0.1, 0.0, 0.0, other) for k in range(1, 300)]
    estimates = localize([*observations, *still], MAP, None, LocalizerConfig())[len(observations) - 1 :]
    assert all(estimate.localized for estimate in estimates)
    assert np.trace(estimates[-1].covariance[:2, :2]) < 1.5 * np.trace(estimates[0].covariance[:2, :2])


def test_a_second_query_frame_from_the_same_spot_is_no_second_witness():
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 100.0)
    still = [replace(observation, speed=0.01, yaw_rate_radps=0.0) for observation in observations]
    shuffled = [replace(one, frame=observations[1].frame) for one in still if one.frame is not None]
    assert not any(estimate.localized for estimate in localize(shuffled, MAP, None, LocalizerConfig()))


def test_a_place_that_is_not_what_is_seen_is_doubted():
    localizer = Localizer(MAP, None, LocalizerConfig())
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 240.0)
    for observation in observations[:750]:
        estimate = localizer.step(observation)
    assert estimate.localized
    elsewhere = Pictures(seed=99)  # nothing that is mapped: no challenger, no margin
    others, _ = drive(elsewhere, np.random.default_rng(12), 377.0, 60.0)
    statuses = [localizer.step(replace(other, t_s=estimate.t_s + other.t_s)).status for other in others]
    assert LocalizationStatus.DOUBTED in statuses
    assert statuses.index(LocalizationStatus.DOUBTED) * 0.8 < 50.0


@pytest.mark.parametrize("belief_type", [AttractorBelief, KalmanBelief])
def test_an_outlier_in_the_same_place_neither_unseats_nor_drags_the_incumbent(belief_type):
    localizer = Localizer(MAP, None, LocalizerConfig(mode="coupled" if belief_type is AttractorBelief else "kalman"))
    observations, truth = drive(PICTURES, np.random.default_rng(5), 137.0, 100.0)
    for observation in observations:
        before = localizer.step(observation)
    off = PoseMeasurement(truth[-1] + [9.0, 0.0, 0.5], np.diag([1.0, 0.25, 0.01]))
    localizer._take(off, replace(localizer._match, margin=5.0), weight=1.0)
    after = localizer._estimate(0.0)
    assert before.localized and after.localized
    assert np.linalg.norm(after.pose[:2] - before.pose[:2]) < 2.0


def test_map_error_is_added_where_the_map_states_it():
    sure = replace(MAP, covariance=np.tile(np.diag([0.01, 0.01, 1e-4]), (len(MAP.poses), 1, 1)))
    vague = replace(MAP, covariance=np.tile(np.diag([4.0, 9.0, 0.01]), (len(MAP.poses), 1, 1)))
    covariances = [run(cognitive_map=one, length_m=60.0)[0][-1].covariance for one in (sure, vague)]
    assert_allclose(covariances[1] - covariances[0], np.diag([3.99, 8.99, 0.0099]), atol=1e-9)


def loop_road():
    """The loop as one lane that leads into itself."""
    points = np.array([loop_pose(s)[:2] for s in np.linspace(0.0, loop_length(), 400, endpoint=False)])
    nobody, own = np.full(1, -1, dtype=np.int32), np.zeros(1, dtype=np.int32)
    return RoadNetwork(
        lane_ids=("loop_0",), edge_ids=("loop",), lane_edge=own, is_internal=np.zeros(1, dtype=bool), width_m=np.full(1, 3.2),
        speed_limit_mps=np.full(1, 13.9), points_m=points, point_start=np.array([0, 400], dtype=np.int32), successor=own,
        successor_start=np.array([0, 1], dtype=np.int32), left_lane=nobody, right_lane=nobody,
    )  # fmt: skip


def test_the_filter_on_lanes_finds_itself_and_stays_on_the_road():
    observations, truth = drive(PICTURES, np.random.default_rng(11), 137.0, 500.0, metres_per_unit=2.5, kidnap=(300.0, 60.0))
    estimates = localize(observations, MAP, loop_road(), LocalizerConfig(mode="lanes"))
    localized = np.array([estimate.localized for estimate in estimates])
    error_m = np.linalg.norm(np.array([estimate.pose for estimate in estimates])[:, :2] - truth[:, :2], axis=1)
    assert 0 < np.argmax(localized) * 0.8 < 50.0
    before = slice(int(np.argmax(localized)), 370)
    assert error_m[before].mean() < 1.5
    assert localized[450:].all() and error_m[450:].mean() < 1.5  # carried off after 375 steps, and found again
    with pytest.raises(HippodromeError, match="give the network"):
        Localizer(MAP, None, LocalizerConfig(mode="lanes"))


def test_paper_mode_follows_the_views_but_not_the_scale():
    _, _, localized, error_m = run("paper", metres_per_unit=2.0)
    settled = error_m[np.argmax(localized) + 100 :].mean()
    _, _, localized, error_m = run("paper", metres_per_unit=2.5)
    off_scale = error_m[np.argmax(localized) + 100 :].mean()
    assert settled < 1.5
    assert off_scale > 2.5


def test_same_input_same_answer(default_run):
    again = run()[0]
    assert all(np.array_equal(a.pose, b.pose) for a, b in zip(default_run[0], again, strict=True))


@pytest.mark.parametrize("mode", ["coupled", "paper"])
def test_frames_that_are_not_looked_at_may_be_left_out(mode):
    observations, _ = drive(PICTURES, np.random.default_rng(12), 137.0, 100.0, metres_per_unit=2.5)
    localizer, looks, answers = Localizer(MAP, None, LocalizerConfig(mode=mode)), 0, []
    for observation in observations:
        looks += (looked := localizer.looks_at(observation))
        answers.append(localizer.step(observation if looked else replace(observation, frame=None)))
    assert 2 <= looks < len(observations)
    for answer, whole in zip(answers, localize(observations, MAP, None, LocalizerConfig(mode=mode)), strict=True):
        assert (answer.view_cell, answer.confidence, answer.status) == (whole.view_cell, whole.confidence, whole.status)
        assert answer.pose.tobytes() == whole.pose.tobytes() and answer.covariance.tobytes() == whole.covariance.tobytes()


def test_needs_a_map_in_the_network_frame():
    with pytest.raises(HippodromeError, match="semi-metric"):
        Localizer(replace(MAP, frame="semi-metric"), None, LocalizerConfig())


def test_the_sketched_search_localizes_like_the_exhaustive_one(default_run):
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 700.0, metres_per_unit=2.5)
    sketched = LocalizerConfig(search=SearchConfig(exhaustive_cells=50, candidates=12, hypotheses=8, sketch_size=48))
    estimates = localize(observations, MAP, None, sketched)
    exhaustive = default_run[0]
    apart_m = [np.linalg.norm(a.pose[:2] - b.pose[:2]) for a, b in zip(estimates, exhaustive, strict=True) if b.localized]
    assert np.mean([estimate.localized for estimate in estimates]) > np.mean([one.localized for one in exhaustive]) - 0.02
    assert np.median(apart_m) < 0.1
    assert np.max(apart_m) < 3.0


def test_a_localizer_that_backs_keeps_its_place():
    observations, _ = drive(PICTURES, np.random.default_rng(11), 137.0, 300.0, metres_per_unit=2.5)
    localizer = Localizer(MAP, None, LocalizerConfig())
    for observation in observations:
        before = localizer.step(observation)
    assert before.localized
    last = observations[-1]
    for k in range(1, 21):
        t_s = last.t_s + k * last.dt_s
        estimate = localizer.step(Observation(t_s, last.dt_s, -last.speed, 0.0, last.frame if k % 5 == 0 else None))
    back_m = 20 * last.dt_s * last.speed * localizer.metres_per_unit
    apart = estimate.pose[:2] - before.pose[:2]
    along = np.array([np.cos(before.pose[2]), np.sin(before.pose[2])])
    assert apart @ along == pytest.approx(-back_m, rel=0.35)
    assert np.isfinite(estimate.covariance).all()
