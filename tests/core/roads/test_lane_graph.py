import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from hippodrome.core.roads.lane_graph import (
    bin_grid,
    build_lane_graph,
    mirrored,
    reversed_network,
)
from hippodrome.core.roads.network import RoadNetwork
from tests.core.synthetic import grid_network


def lanes_network(lanes, successors, left=None, right=None):
    none = [-1] * len(lanes)
    return RoadNetwork(
        lane_ids=tuple(f"l{i}" for i in range(len(lanes))),
        edge_ids=tuple(f"e{i}" for i in range(len(lanes))),
        lane_edge=np.arange(len(lanes), dtype=np.int32),
        is_internal=np.zeros(len(lanes), dtype=bool),
        width_m=np.full(len(lanes), 3.2),
        speed_limit_mps=np.full(len(lanes), 10.0),
        points_m=np.concatenate([np.array(lane, dtype=float) for lane in lanes]),
        point_start=np.cumsum([0] + [len(lane) for lane in lanes]).astype(np.int32),
        successor=np.array([s for after in successors for s in after], dtype=np.int32),
        successor_start=np.cumsum([0] + [len(after) for after in successors]).astype(np.int32),
        left_lane=np.array(left or none, dtype=np.int32),
        right_lane=np.array(right or none, dtype=np.int32),
    )


def reach(graph, bin_):
    row = slice(graph.reach_start[bin_], graph.reach_start[bin_ + 1])
    return graph.reach_bin[row], graph.reach_m[row], graph.reach_changes[row]


def test_a_very_short_lane_costs_its_true_length():
    graph = build_lane_graph(
        lanes_network([[(0, 0), (2, 0)], [(2, 0), (2.1, 0)], [(2.1, 0), (5.1, 0)]], [[1], [2], []]), reach_limit_m=4.0
    )
    assert graph.lane.tolist() == [0, 0, 1, 2, 2, 2]
    bins, metres, changes = reach(graph, 0)  # centre at 0.5 m
    assert bins.tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(metres, [1.0, 1.55, 2.1, 3.1], atol=1e-6)
    assert not changes.any()
    np.testing.assert_allclose(graph.points_m[:, 0], [0.5, 1.5, 2.05, 2.6, 3.6, 4.6])


def test_lane_changes_lead_to_direct_neighbours_only():
    side_by_side = [[(0, y), (10, y)] for y in (0.0, 3.2, 6.4)]
    graph = build_lane_graph(lanes_network(side_by_side, [[], [], []], left=[1, 2, -1], right=[-1, 0, 1]), reach_limit_m=3.0)
    bins, metres, changes = reach(graph, 0)
    assert sorted(zip(graph.lane[bins].tolist(), changes.tolist(), strict=True)) == [(0, 0)] * 3 + [(1, 1)] * 3
    np.testing.assert_allclose(metres, [1, 1, 2, 2, 3, 3], atol=1e-6)


def test_a_lane_change_scales_the_position_by_the_lengths():
    """In a bend the inner lane is half as long: from 5.5 of 10 m one enters it at 2.75 of 5 m."""
    bend = lanes_network([[(0, 0), (10, 0)], [(0, 3), (5, 3)]], [[], []], left=[1, -1], right=[-1, 0])
    graph = build_lane_graph(bend, reach_limit_m=1.0)
    bins, metres, changes = reach(graph, 5)
    assert sorted(zip(bins.tolist(), metres.round(6).tolist(), changes.tolist(), strict=True)) == [(6, 1.0, 0), (13, 0.75, 1)]


def test_dead_ends_and_loops_end_the_walk():
    loop = [[(0, 0), (1.5, 0)], [(1.5, 0), (0, 0)]]
    graph = build_lane_graph(lanes_network(loop, [[1], [0]]), reach_limit_m=6.0)
    _, metres, _ = reach(graph, 0)
    assert metres.max() <= 6.0
    assert len(metres) == 8  # 4 bins a round, two rounds of 3 m


@pytest.mark.parametrize("seed", [0, 1])
def test_reach_agrees_with_dijkstra(seed):
    network = grid_network(np.random.default_rng(seed), columns=3, rows=3)
    graph = build_lane_graph(network, reach_limit_m=25.0)
    shortest = dijkstra(_bin_steps(network, graph), indices=np.arange(0, graph.bin_count, 97), limit=25.0)
    for row, bin_ in enumerate(range(0, graph.bin_count, 97)):
        expected = shortest[row]
        expected[bin_] = np.inf
        bins, metres, _ = reach(graph, bin_)
        assert np.all(np.diff(metres) >= 0.0)
        found = np.full(graph.bin_count, np.inf)
        np.minimum.at(found, bins, metres)
        np.testing.assert_allclose(found, expected, atol=1e-4)


def _bin_steps(network, graph):
    """Bin-to-bin adjacency built without the code under test."""
    lengths = network.lane_lengths_m()
    source, target, metres = [], [], []
    for lane in range(network.lane_count):
        bins = np.flatnonzero(graph.lane == lane)
        source += bins[:-1].tolist()
        target += bins[1:].tolist()
        metres += np.diff(graph.position_m[bins]).tolist()
        for after in network.successors(lane):
            first = int(np.flatnonzero(graph.lane == after)[0])
            source.append(int(bins[-1]))
            target.append(first)
            metres.append(lengths[lane] - graph.position_m[bins[-1]] + graph.position_m[first])
    return coo_array((metres, (source, target)), shape=(graph.bin_count,) * 2).tocsr()


def test_the_reversed_network_covers_the_same_places_the_other_way():
    network = grid_network(np.random.default_rng(0), columns=3, rows=3)
    graph, back = build_lane_graph(network, 10.0), build_lane_graph(reversed_network(network), 10.0)
    bins = np.arange(graph.bin_count, dtype=np.int32)
    twin = mirrored(graph, bins)
    np.testing.assert_allclose(back.points_m[twin], graph.points_m, atol=1e-9)
    turned = np.abs(np.angle(np.exp(1j * (back.heading_rad[twin] - graph.heading_rad))))
    np.testing.assert_allclose(turned, np.pi, atol=1e-5)
    np.testing.assert_array_equal(mirrored(graph, twin), bins)
    assert mirrored(graph, np.array([-5], dtype=np.int32)).tolist() == [-5]
    ahead = {(int(a), int(b)) for a in bins[::50] for b in reach(graph, a)[0]}
    assert all(int(mirrored(graph, np.array([a]))[0]) in reach(back, mirrored(graph, np.array([b]))[0])[0] for a, b in ahead)


def test_every_bin_lies_in_its_cell():
    graph = build_lane_graph(grid_network(np.random.default_rng(3), columns=3, rows=2), 5.0)
    grid = bin_grid(graph, 10.0)
    assert sorted(grid.bin.tolist()) == list(range(graph.bin_count))
    for cell in range(0, grid.rows * grid.columns, 7):
        inside = graph.points_m[grid.bin[grid.start[cell] : grid.start[cell + 1]]]
        column_row = np.floor((inside - grid.origin_m) / 10.0)
        assert np.all(column_row == [cell % grid.columns, cell // grid.columns])
