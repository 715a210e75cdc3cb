"""What the player shows of the second drive: the belief as it was, sampled, and frames at their times."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.types import LocalizationEstimate, LocalizationStatus, Trajectory
from hippodrome.eval.methods.method import TOPOMETRIC
from hippodrome.eval.report.belief import (
    SETTLING_S,
    SETTLING_STEP_S,
    STEP_S,
    belief_of,
    read_second_drive,
    write_second_drive,
)
from hippodrome.eval.results.model import ResultsError

STEPS, STEP, FIX = 400, 0.1, 60
TRUTH = Trajectory(np.arange(STEPS) * STEP, np.column_stack([np.arange(STEPS) * 1.0, np.zeros(STEPS), np.zeros(STEPS)]))


def estimate(step, sigma_m=2.0, off_m=3.0):
    known = step >= FIX
    return LocalizationEstimate(
        t_s=step * STEP,
        pose=np.array([step + off_m, 0.0, 0.1]),
        covariance=np.diag([sigma_m**2, 1.0, 0.01] if known else [np.inf] * 3),
        localized=known,
        confidence=1.5,
        view_cell=step % 3 - 1,
        head_direction_rad=np.array([0.1, 0.2]),
        head_reliability=np.array([4.0, 5.0]),
        grid_phase_rad=np.arange(12.0).reshape(3, 2, 2),
        grid_reliability=np.full((3, 2, 2), 7.0),
        status=LocalizationStatus.LOCALIZED if known else LocalizationStatus.UNKNOWN,
    )


COGNITIVE_MAP = SimpleNamespace(
    t_s=np.array([1.0, 2.0, 3.0]),
    poses=np.array([[5.0, 6.0, 0.0], [7.0, 8.0, 0.0], [9.0, 9.0, 0.0]]),
    view_cell=np.array([1, 0, 0]),
    view_cells=SimpleNamespace(templates=[]),
)


def test_the_belief_is_what_the_localizer_said():
    made = belief_of("topometric", [estimate(step) for step in range(STEPS)], TRUTH, COGNITIVE_MAP)
    steps_s = np.diff(made.t_s)
    assert made.t_s[0] == 0.0 and made.t_s[-1] == pytest.approx(STEP * (STEPS - 1))
    assert max(steps_s[np.array(made.t_s[1:]) <= SETTLING_S]) == pytest.approx(SETTLING_STEP_S)
    assert max(steps_s) == pytest.approx(STEP_S)
    assert made.localized == [t_s >= FIX * STEP - 1e-9 for t_s in made.t_s]
    assert set(made.error_m) == {3.0}
    assert made.covariance_m2[-1] == (4.0, 0.0, 1.0)
    assert made.grid_rad[0] == list(range(12)) and made.head_reliability[0] == [4.0, 5.0]


def test_the_worst_moment_that_was_declared_localized_is_kept_whatever_the_sampling():
    estimates = [estimate(step, off_m=90.0 if step in (3, 303) else 3.0) for step in range(STEPS)]  # the first is no declaration
    made = belief_of("topometric", estimates, TRUTH, COGNITIVE_MAP)
    assert [t_s for t_s, error_m in zip(made.t_s, made.error_m, strict=True) if error_m == 90.0] == [pytest.approx(303 * STEP)]
    assert made.t_s == sorted(made.t_s) and STEP * 303 % STEP_S > 1e-6


def test_the_view_that_fired_is_the_first_vertex_that_has_it():
    made = belief_of("topometric", [estimate(step) for step in range(3)], TRUTH, COGNITIVE_MAP)
    assert (made.view_s[0], made.view_m[0]) == (None, None)  # no cell is active
    assert (made.view_s[-1], made.view_m[-1]) == (1.0, (5.0, 6.0))


def test_what_is_infinite_or_without_truth_stays_readable():
    made = belief_of("other", [estimate(0), estimate(STEPS + 50)], TRUTH, None)
    assert all(np.isfinite(made.covariance_m2[0]))
    assert made.error_m == [3.0, None]
    assert made.view_s == [None, None]


@pytest.fixture
def written(tmp_path):
    times_s = TRUTH.t_s
    drive = SimpleNamespace(
        frame_count=STEPS, samples=SimpleNamespace(t_s=times_s, frame_steps=np.arange(STEPS)), ground_truth=lambda: TRUTH,
        frame=lambda number: np.full((30, 40, 3), number % 256, np.uint8),
    )  # fmt: skip
    outcome = SimpleNamespace(
        localization=SimpleNamespace(estimates=[estimate(step) for step in range(STEPS)]), refined=COGNITIVE_MAP
    )
    scenario = SimpleNamespace(localizer=LocalizerConfig())
    write_second_drive(SimpleNamespace(folder=tmp_path, drive=drive, scenario=scenario), {TOPOMETRIC: outcome})
    return tmp_path


def test_files_come_back_and_tiles_are_the_frames_of_their_times(written):
    content = read_second_drive(written / "belief.json")
    assert [one.name for one in content.beliefs] == ["topometric"]
    assert content.beliefs[0].periods_m == (97.0, 131.0, 173.0)
    tiles, sheet = content.frames, cv2.imread(str(written / "frames-second.jpg"))
    assert sheet.shape[1] == tiles.columns * tiles.width
    for place in (0, 7, len(tiles.t_s) - 1):
        row, column = divmod(place, tiles.columns)
        centre = sheet[int((row + 0.5) * tiles.height), int((column + 0.5) * tiles.width)]
        assert int(centre[0]) == pytest.approx(round(tiles.t_s[place] / STEP) % 256, abs=3)  # JPEG


def test_a_drive_that_nobody_localized_writes_nothing(tmp_path):
    write_second_drive(SimpleNamespace(folder=tmp_path), {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("change", [lambda text: text[:40], lambda text: text.replace('"error_m":[3.0,', '"error_m":[')])
def test_a_broken_file_is_an_error_that_names_it(written, change):
    path = written / "belief.json"
    path.write_text(change(path.read_text()))
    with pytest.raises(ResultsError, match=r"belief\.json: .*run `hippodrome eval` again"):
        read_second_drive(path)


def test_a_method_that_states_no_covariance_has_none():
    bare = replace(estimate(FIX), covariance=np.zeros((3, 3)))
    assert belief_of("other", [bare], TRUTH, None).covariance_m2 == [None]
