import numpy as np
import pytest

from hippodrome.core.types import RoadMatch
from hippodrome.eval.metrics.map_quality import matched_lane_accuracy, matched_lane_ids, score_closures
from hippodrome.eval.metrics.trajectory import MetricError


def test_lanes_by_hand():
    accuracy = matched_lane_accuracy(["a_0", "a_1", None, "b_0", ":j_1_0"], ["a_0", "a_0", "a_0", "c_0", ":j_1_0"])
    assert (accuracy.right, accuracy.wrong, accuracy.unmatched, accuracy.right_edge, accuracy.total) == (2, 2, 1, 3, 5)
    assert (accuracy.share_right, accuracy.precision) == (0.4, 0.5)


def test_nothing_matched_is_no_wrong_match():
    assert matched_lane_accuracy([None, None], ["a_0", "a_0"]).precision == 1.0


def test_lane_ids_of_a_road_match():
    match = RoadMatch(("a_0", "b_0"), np.array([1, -1, 0], np.int32), np.array([1.0, np.nan, 2.0]), np.zeros(3, np.uint8))
    assert matched_lane_ids(match) == ["b_0", None, "a_0"]


def test_lanes_must_pair_up():
    with pytest.raises(MetricError, match="1 estimated lanes for 2 true ones"):
        matched_lane_accuracy(["a_0"], ["a_0", "a_0"])


def two_rounds(heading_rad=0.0):
    """Ten places 20 m apart, driven twice, 100 s between the rounds."""
    x = np.tile(20.0 * np.arange(10.0), 2)
    heading = np.repeat([0.0, heading_rad], 10)
    t_s = np.concatenate([np.arange(10.0), 100.0 + np.arange(10.0)])
    return np.column_stack([x, np.zeros(20), heading]), t_s


def closures(*pairs):
    source, target = np.array(pairs, dtype=np.int32).reshape(-1, 2).T
    return source, target


def test_closures_by_hand():
    found = score_closures(*closures((10, 0), (11, 1), (12, 2), (5, 15), (13, 7)), *two_rounds())
    assert (found.accepted, found.false, found.revisits, found.recalled) == (5, 1, 10, 4)
    assert (found.precision, found.recall) == (0.8, 0.4)


def test_two_closures_of_one_vertex_recall_it_once():
    poses, t_s = two_rounds()
    assert score_closures(*closures((10, 0), (10, 0)), poses, t_s).recalled == 1


def test_the_other_direction_is_another_view():
    found = score_closures(*closures((10, 0)), *two_rounds(np.pi))
    assert (found.false, found.revisits) == (1, 0)


def test_standing_still_is_no_revisit():
    poses = np.zeros((5, 3))
    assert score_closures(*closures(), poses, np.arange(5.0)).revisits == 0


def test_no_closures_and_no_revisits_are_perfect():
    poses, t_s = two_rounds()
    assert score_closures(*closures(), poses, t_s).precision == 1.0
    assert score_closures(*closures(), poses[:10], t_s[:10]).recall == 1.0
