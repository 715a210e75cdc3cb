import numpy as np
import pytest

from hippodrome.core.roads.lane_graph import build_lane_graph
from hippodrome.core.roads.lanes_ahead import WAYS, build_search_graph
from tests.core.roads.test_lane_graph import lanes_network
from tests.core.synthetic import grid_network

REACH_M = 25.0


def bins_ahead(graph, bin_):
    """Bin, arc length and lane changes of all bins within reach, by the arithmetic that the search does."""
    found, lane = [], int(graph.lane[bin_])
    for way in range(WAYS):
        entry_m = graph.position_m[bin_] * graph.ahead.entry[WAYS * lane + way]
        for row in graph.ahead.rows[graph.ahead.start[WAYS * lane + way] : graph.ahead.start[WAYS * lane + way + 1]]:
            for n in range(row["bin_count"]):
                metres = row["begin_m"] - entry_m + (n + 0.5) * row["bin_m"]
                if 0.0 < metres <= REACH_M:
                    found.append((int(row["first_bin"]) + n, metres, min(way, 1)))
    return sorted(found)


BEND = lanes_network(
    [[(0, 0), (10, 0)], [(0, 3), (5, 3)], [(10, 0), (10.1, 0)]], [[2], [], []], left=[1, -1, -1], right=[-1, 0, -1]
)


@pytest.mark.parametrize("network", [BEND, grid_network(np.random.default_rng(1), columns=3, rows=2)], ids=["bend", "grid"])
def test_the_lanes_ahead_hold_the_bins_that_the_lane_graph_tabulates(network):
    table, graph = build_lane_graph(network, REACH_M), build_search_graph(network, REACH_M)
    for bin_ in range(0, graph.bin_count, 7):
        row = slice(table.reach_start[bin_], table.reach_start[bin_ + 1])
        expected = sorted(zip(table.reach_bin[row].tolist(), table.reach_m[row], table.reach_changes[row].tolist(), strict=True))
        found = bins_ahead(graph, bin_)
        assert [(one[0], one[2]) for one in found] == [(one[0], one[2]) for one in expected]
        np.testing.assert_allclose([one[1] for one in found], [one[1] for one in expected], atol=1e-5)


def test_lanes_without_length_and_rings_end_the_walk():
    point = lanes_network([[(0, 0), (4, 0)], [(4, 0), (4, 0)], [(4, 0), (0, 0)]], [[1], [2], [0]])
    graph = build_search_graph(point, 9.0)
    assert np.all(graph.ahead.rows["bin_m"] > 0.0)
    assert graph.ahead.rows["begin_m"].max() < 4.0 + 9.0
