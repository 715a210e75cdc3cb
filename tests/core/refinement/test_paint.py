"""Paint along the lane's borders as factors between keyframes."""

import numpy as np
import pytest

from hippodrome.core.reading import RoadReader
from hippodrome.core.reading.dashes import NO_PAINT
from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.paint import LATER, PAINT_EDGE, passed_factors, passed_m, revisits
from tests.core.reading.painted import camera, road

VIEW = camera()
STREET = ((-1.4, 0), (1.6, 9), (4.6, 0))
ASPHALT_BETWEEN = 3.2  # from one lane's middle to the next


def paint(along_m, lines=STREET):
    reader = RoadReader(VIEW)
    return reader.paint(reader.read(road(VIEW, along_m=along_m, lines=lines)))


def state(poses):
    return State(np.array(poses, dtype=float), np.zeros(len(poses)), np.zeros(3))


def believed(at_m, wrong_m, y_m=0.0, heading_rad=0.0):
    return [at_m + wrong_m, y_m, heading_rad]


def test_what_passed_tells_the_way_to_the_next_keyframe():
    at_m = [3.0, 6.0, 10.0, 13.5]  # the last step shows no end of a dash twice
    seen = np.stack([paint(x) for x in at_m])
    way_m = passed_m(seen, state([believed(x, wrong) for x, wrong in zip(at_m, (0.0, 0.3, -0.1, 0.2), strict=True)]))
    assert way_m == pytest.approx([3.0, 4.0, np.nan], abs=0.2, nan_ok=True)
    assert np.isnan(passed_m(np.stack([seen[0], NO_PAINT, seen[2], seen[3]]), state([believed(x, 0.0) for x in at_m]))[:2]).all()


def again(later, pose, first=0.0):
    """Edges found between a keyframe at x = ``first`` and a much later one, which saw ``later`` and is believed at ``pose``."""
    between = [[1e3 + 100.0 * k, 0.0, 0.0] for k in range(LATER)]
    seen = np.stack([paint(first), *[NO_PAINT] * LATER, later])
    return revisits(seen, state([[first, 0.0, 0.0], *between, pose]))


def test_who_comes_by_again_sees_the_same_dashes():
    edges = again(paint(2.0), believed(2.0, 1.3))
    assert (edges.source.tolist(), edges.target.tolist(), edges.kind.tolist()) == ([0], [LATER + 1], [PAINT_EDGE])
    assert edges.motion[0, 0] == pytest.approx(2.0, abs=0.2)


def test_so_does_who_comes_by_in_the_lane_beside():
    edges = again(paint(2.0, ((-4.6, 0), (-1.6, 9), (1.6, 0))), believed(2.0, -0.8, ASPHALT_BETWEEN))
    assert edges.motion[0, 0] == pytest.approx(2.0, abs=0.2)


def test_so_does_who_comes_the_other_way():
    """He is at x = 17 and looks back along the line whose dashes begin, in his direction, where they end in the other."""
    ahead_m = 17.0
    begin = -5.0  # a dash as ``road`` draws it covers -5 m to -2 m, and so on each 9 m
    mirrored = -(begin + 3.0)  # where a dash begins for one who looks the other way from x = 0
    edges = again(paint(-ahead_m + begin - mirrored), believed(ahead_m, 0.9, ASPHALT_BETWEEN, np.pi))
    assert edges.motion[0, 0] == pytest.approx(ahead_m, abs=0.3)


@pytest.mark.parametrize("pose", [(2.0, 30.0, 0.0), (2.0, 0.0, 1.5), (25.0, 0.0, 0.0), (2.0, 1.6, 0.0)])
def test_other_places_are_not_compared(pose):
    assert len(again(paint(2.0), pose).source) == 0


def test_keyframes_without_paint_have_no_edges():
    assert len(revisits(np.stack([NO_PAINT] * 3), state([[0.0, 0.0, 0.0]] * 3)).source) == 0


def test_the_factors_of_what_passed_have_the_right_jacobians():
    way_m = np.array([4.1, np.nan, 3.9])
    poses = np.array([[0.0, 0.0, 0.1], [4.0, 0.3, 0.1], [8.0, 0.9, 0.2], [11.9, 1.0, 0.2]])
    factors = passed_factors(state(poses), way_m, 3)
    assert factors.residual[1] == 0.0 and not factors.target[1].any()
    for row, sign, part in ((0, 0, factors.source), (0, 1, factors.target)):
        for axis in (0, 1):
            moved = poses.copy()
            moved[row + sign, axis] += 1e-6
            # the robust weight changes by less than the step allows to see
            change = (passed_factors(state(moved), way_m, 3).residual - factors.residual)[row, 0] / 1e-6
            assert change == pytest.approx(part[row, 0, axis], rel=0.35, abs=0.05)
