"""What is said of the worst places: lanes, closures and neighbours as the map has them."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.types import EdgeKind
from hippodrome.eval.report.evidence import Layer
from hippodrome.eval.report.places import _vertex_facts
from hippodrome.eval.report.why import OTHER_PASS, place_of, read_why
from hippodrome.eval.results.model import ResultsError

COUNT = 40  # vertices 5 m apart: out along a street for the first half, and back 2 m beside it
OUT = np.arange(COUNT // 2) * 5.0
X_M, Y_M = np.concatenate([OUT, OUT[::-1]]), np.repeat([0.0, 2.0], COUNT // 2)
T_S = np.arange(COUNT) * 1.0
ERRORS_M = [float(i) for i in range(COUNT)]
LAYER = Layer(name="topometric", t_s=T_S.tolist(), x_m=X_M.tolist(), y_m=Y_M.tolist(), error_m=ERRORS_M, worst=[35])


def a_map(**fields):
    lanes = np.full(COUNT, 0)
    lanes[3] = -1
    whole = {
        "t_s": T_S,
        "poses": np.column_stack([X_M, Y_M, np.zeros(COUNT)]),
        "covariance": np.tile(np.diag([4.0, 1.0, 0.1]), (COUNT, 1, 1)),
        "edges": SimpleNamespace(
            source=np.array([0, 7]), target=np.array([1, 32]), kind=np.array([EdgeKind.ODOMETRY, EdgeKind.CLOSURE], np.uint8)
        ),
        "road_match": SimpleNamespace(lane_ids=("a_0",), lane=lanes, position_m=X_M, status=np.zeros(COUNT, np.uint8)),
    }
    return SimpleNamespace(**{**whole, **fields})


def test_a_place_says_what_the_map_knows():
    place = place_of(LAYER, 35, a_map())
    assert (place.status, place.lane, place.position_m) == ("matched", "a_0", X_M[35])
    assert place.sure_m == pytest.approx(2.0 * 2.4477, abs=0.01)
    assert (place.since_closure_m, place.closed_with_s) == (15.0, 7.0)
    assert [one.vertex for one in place.neighbours] == [4, 3, 5]
    assert place.neighbours[0].apart_m == 2.0 and place.neighbours[0].error_m == 4.0


def test_what_is_not_known_is_left_out():
    bare = place_of(LAYER, 3, a_map(covariance=None))
    assert (bare.lane, bare.position_m, bare.sure_m, bare.since_closure_m) == (None, None, None, None)
    unmatched = place_of(LAYER, 3, a_map(road_match=None))
    assert unmatched.status == "unknown"
    assert np.isfinite(place_of(LAYER, 35, a_map()).sure_m)
    unsure = place_of(LAYER, 35, a_map(covariance=np.full((COUNT, 3, 3), np.nan)))
    assert unsure.sure_m is None


def test_half_of_a_closure_is_none():
    place = place_of(LAYER, 35, a_map())
    for unknown in ("since_closure_m", "closed_with_s"):
        facts = _vertex_facts(place.model_copy(update={unknown: None}))
        assert "No loop had been closed before." in facts


def test_a_pass_is_no_neighbour_of_itself():
    place = place_of(LAYER, 20, a_map())  # where the drive turned round
    assert all(abs(one.vertex - 20) >= OTHER_PASS for one in place.neighbours)


@pytest.mark.parametrize("content", ["", "[]", '{"places": [{}]}'])
def test_a_broken_file_is_an_error_that_names_it(tmp_path, content):
    (tmp_path / "why.json").write_text(content)
    with pytest.raises(ResultsError, match=r"why\.json: .*run `hippodrome eval` again"):
        read_why(tmp_path / "why.json")
