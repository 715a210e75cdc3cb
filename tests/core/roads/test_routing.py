"""Route distances by hand and against SciPy's Dijkstra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from hippodrome.core.roads.geometry import road_geometry
from hippodrome.core.roads.routing import carriageways, route_distances_m, route_table
from tests.core.synthetic import grid_network, lanes_of


def table_of(network, bound_m=1000.0):
    geometry = road_geometry(network)
    return route_table(geometry, np.arange(network.lane_count), bound_m)


def distance_m(table, a, b):
    """Driving distance from one (lane, arc length) to another: two vertices with one candidate each."""
    lanes, positions = np.array([a[0], b[0]], dtype=np.int32), np.array([a[1], b[1]])
    first, distances = route_distances_m(table, np.array([0, 1, 2], dtype=np.int32), lanes, positions)
    assert first.tolist() == [0, 1]
    return distances[0]


CHAIN = lanes_of([(0, 0), (10, 0)], [(10, 0), (10, 4)], [(10, 4), (30, 4)], successor=[(0, 1), (1, 2), (2, 0)])


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ((0, 2.0), (0, 7.0), 5.0),
        ((0, 6.0), (1, 3.0), 7.0),
        ((0, 6.0), (2, 5.0), 13.0),
        ((2, 15.0), (1, 1.0), 16.0),  # over lane 0
        ((0, 7.0), (0, 6.5), 0.5),  # a projection that steps back
        ((0, 7.0), (0, 2.0), 29.0),  # once round
    ],
)
def test_by_hand(a, b, expected):
    assert distance_m(table_of(CHAIN), a, b) == pytest.approx(expected)


def test_beyond_the_bound_and_off_the_graph_there_is_no_route():
    assert distance_m(table_of(CHAIN, bound_m=3.0), (0, 6.0), (2, 5.0)) == np.inf
    apart = lanes_of([(0, 0), (10, 0)], [(20, 0), (30, 0)])
    assert distance_m(table_of(apart), (0, 6.0), (1, 5.0)) == np.inf


def test_lanes_beside_each_other_are_one_carriageway():
    """Only the right lane goes on; a drive may begin on the left one."""
    network = lanes_of([(0, 0), (10, 0)], [(0, 3), (10, 3)], [(10, 0), (20, 0)], successor=[(0, 2)])
    network = replace(network, left_lane=np.array([1, -1, -1], np.int32), right_lane=np.array([-1, 0, -1], np.int32))
    label, length = carriageways(road_geometry(network))
    assert label[0] == label[1] != label[2]
    assert length[label] == pytest.approx([10.0, 10.0, 10.0])
    assert distance_m(table_of(network), (1, 4.0), (2, 5.0)) == pytest.approx(11.0)
    assert distance_m(table_of(network), (1, 4.0), (0, 9.0)) == pytest.approx(5.0)


def test_distances_of_all_candidates_in_their_order():
    """Two candidates, then one, then two: rows by the candidate that the drive begins at, then by the one where it ends."""
    start = np.array([0, 2, 3, 5], dtype=np.int32)
    lane, position = np.array([0, 1, 1, 2, 0], dtype=np.int32), np.array([6.0, 1.0, 3.0, 5.0, 1.0])
    first, distances = route_distances_m(table_of(CHAIN), start, lane, position)
    assert first.tolist() == [0, 2, 4]
    assert distances == pytest.approx([7.0, 2.0, 6.0, 22.0])


def test_equals_scipy_on_a_grid():
    network = grid_network(np.random.default_rng(3), columns=4, rows=3)
    lengths = network.lane_lengths_m()
    source = np.repeat(np.arange(network.lane_count), np.diff(network.successor_start))
    graph = csr_array((lengths[source], (source, network.successor)), shape=(network.lane_count,) * 2)
    from_begin = dijkstra(graph)
    table = table_of(network, bound_m=250.0)
    for a in range(0, network.lane_count, 5):
        for b in range(network.lane_count):
            if a == b:
                continue
            expected = from_begin[a, b] - 0.25 * lengths[a] + 0.5 * lengths[b]
            within = from_begin[a, b] - lengths[a] <= 250.0
            found = distance_m(table, (a, 0.25 * lengths[a]), (b, 0.5 * lengths[b]))
            assert found == pytest.approx(expected if within else np.inf)
