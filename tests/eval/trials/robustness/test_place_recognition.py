"""Place recognition alone: who counts as mapped, right and recalled, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.types import ViewCells
from hippodrome.eval.trials.robustness.figures import draw_curves
from hippodrome.eval.trials.robustness.place_recognition import Answers, half_known, judged
from hippodrome.eval.trials.robustness.recall import PlaceResult, curve, recall_at, side_by_side
from hippodrome.eval.trials.robustness.tables import places_markdown
from tests.core.looped_world import Pictures, topometric_map

PLACES_M = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [100.0, 0.0, 0.0]])


def answers(score, right, mapped):
    right = np.array(right)
    return Answers("x", np.array(score, dtype=float), right, right, np.array(mapped))


def test_answers_are_right_near_and_mapped_by_their_distances():
    queries_m = np.array([[1.0, 0.0, 0.1], [1.0, 0.0, 0.1], [1.0, 0.0, 0.1], [112.0, 0.0, 0.0], [1.0, 0.0, np.pi]])
    found = judged("x", np.array([0, 1, 2, 2, 0]), np.zeros(5), queries_m, PLACES_M)
    assert found.right.tolist() == [True, True, False, True, False]  # the next place, 9 m on, shows the same street
    assert found.near.tolist() == [True, False, False, False, False]
    assert found.mapped.tolist() == [True, True, True, False, False]  # beyond the end of the road; the opposite way


def test_precision_and_recall_by_hand():
    found = curve(answers([5, 4, 3, 2, 1], [True, True, False, True, False], [True, True, False, True, True]))
    np.testing.assert_allclose(found.precision, [1, 1, 2 / 3, 3 / 4, 3 / 5])
    np.testing.assert_allclose(found.recall, [1 / 4, 1 / 2, 1 / 2, 3 / 4, 3 / 4])
    assert recall_at(found) == 0.5
    assert recall_at(found, 0.7) == 0.75


def test_an_answer_on_an_unmapped_road_spoils_precision():
    confident = answers([9, 5, 4], [False, True, True], [False, True, True])
    assert recall_at(curve(confident)) == 0.0
    assert recall_at(curve(answers([1, 5, 4], [False, True, True], [False, True, True]))) == 1.0


def test_equal_scores_are_accepted_together():
    found = curve(answers([1, 1, 1, 1], [True, True, True, False], [True] * 4))
    assert (found.precision.tolist(), found.recall.tolist()) == ([0.75], [0.75])


def test_a_quarter_of_the_places_is_struck_and_the_rest_keep_their_views():
    whole = topometric_map(Pictures(seed=3), np.random.default_rng(3))
    known = half_known(whole)
    kept = whole.poses[:, 0] > np.quantile(whole.poses[:, 0], 0.25)
    assert len(known.poses) == pytest.approx(0.75 * len(whole.poses), abs=2)
    assert isinstance(known.view_cells, ViewCells)
    np.testing.assert_array_equal(known.view_cells.templates[known.view_cell], whole.view_cells.templates[kept])


def test_a_method_that_fails_under_one_condition_keeps_its_column_and_the_cause_is_named(tmp_path):
    ours, theirs = answers([3, 2], [True, True], [True, True]), replace(answers([2, 1], [True, False], [True, True]), method="y")
    results = [PlaceResult("same", (ours,), {"y": "no vector", "z": "no program"}), PlaceResult("winter", (ours, theirs))]
    text = places_markdown(results)
    assert "| condition | looks (mapped) | x | y | z |" in text
    assert "| same | 2 (2) | 100 % (100 %) | failed | failed |" in text
    assert "| winter | 2 (2) | 100 % (100 %) | 50 % (50 %) | - |" in text
    assert text.rstrip().endswith("- y, same: no vector\n- z, same: no program")
    assert results[0].summary()["failed_methods"] == {"y": "no vector", "z": "no program"}
    assert "failed_methods" not in results[1].summary()
    draw_curves(tmp_path / "curves.png", "town", results)


def test_a_method_that_fails_in_one_town_fails_in_all_together_and_says_where():
    ours, theirs = answers([3, 2], [True, True], [True, True]), replace(answers([2, 1], [True, False], [True, True]), method="y")
    pooled = side_by_side([PlaceResult("same", (ours, theirs)), PlaceResult("same", (ours,), {"y": "no vector"})])
    assert [(one.method, len(one.score)) for one in pooled.answers] == [("x", 4)]
    assert pooled.failed == {"y": "in town 2: no vector"}
