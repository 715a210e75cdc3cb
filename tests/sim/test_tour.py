from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.sparse.csgraph import connected_components

from hippodrome.sim.tour import coverage_and_revisits, plan_tour, tour_graph, toured_area
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    town = build_town(TownSpec(kind="grid", road_km=8.0, width_m=450.0, height_m=450.0), 1, tmp_path_factory.mktemp("town"))
    return tour_graph(town.network)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), length_m=st.floats(100.0, 6000.0), revisit=st.floats(0.0, 0.9))
def test_tours_are_connected_and_long_enough(graph, seed, length_m, revisit):
    area = toured_area(graph, (1.0 - revisit) * length_m)
    tour = plan_tour(graph, area, length_m, np.random.default_rng(seed))
    links = {(int(a), int(b)) for a, b in zip(*graph.cost_m.nonzero(), strict=True)}
    assert set(zip(tour[:-1].tolist(), tour[1:].tolist(), strict=True)) <= links
    assert (graph.length_m + graph.junction_m)[tour].sum() >= length_m


@settings(max_examples=20, deadline=None)
@given(length_m=st.floats(10.0, 5000.0))
def test_toured_areas_are_nested_and_strongly_connected(graph, length_m):
    area, larger = toured_area(graph, length_m), toured_area(graph, 1.5 * length_m)
    assert set(area) <= set(larger)
    inside = graph.cost_m.tocsr()[area][:, area]
    parts, _ = connected_components(inside, connection="strong")
    assert parts == 1


def test_a_long_tour_covers_everything_in_both_directions(graph):
    tour = plan_tour(graph, toured_area(graph, 1e9), 16000.0, np.random.default_rng(0))
    coverage, revisits = coverage_and_revisits(tour, graph)
    assert coverage == pytest.approx(1.0)
    assert 0.3 < revisits < 0.8


def test_seeds_make_different_tours_of_the_same_area_and_repeat_themselves(graph):
    area = toured_area(graph, 1800.0)
    one, same, other = (plan_tour(graph, area, 3000.0, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    common = min(len(one), len(other))
    assert np.mean(one[:common] == other[:common]) < 0.3
    turns = [set(zip(tour[:-2].tolist(), tour[1:-1].tolist(), tour[2:].tolist(), strict=True)) for tour in (one, other)]
    assert turns[0] != turns[1]
    assert len(set(one) & set(other)) > 0.5 * len(set(one))


@pytest.mark.parametrize("wanted", [0.2, 0.4, 0.6])
def test_revisit_share_is_near_what_was_wanted(graph, wanted):
    area = toured_area(graph, (1.0 - wanted) * 2500.0)
    shares = [coverage_and_revisits(plan_tour(graph, area, 2500.0, np.random.default_rng(s)), graph)[1] for s in range(5)]
    assert np.mean(shares) == pytest.approx(wanted, abs=0.15)  # areas grow by whole loops


def test_rest_of_a_tour_starts_where_told_and_prefers_what_was_not_visited(graph):
    visits = np.ones(len(graph.edges), dtype=np.int32)
    left_out = [3, 11]
    visits[left_out] = 0
    rest = plan_tour(graph, np.arange(len(graph.edges)), 12000.0, np.random.default_rng(0), visits, start=7)
    assert rest[0] == 7
    first = {edge: int(np.flatnonzero(rest == edge)[0]) for edge in left_out}
    assert max(first.values()) < 0.6 * len(rest)


def test_no_u_turns_where_there_is_another_way(graph):
    tour = plan_tour(graph, toured_area(graph, 1e9), 5000.0, np.random.default_rng(3))
    costs = np.array([graph.cost_m[a, b] for a, b in pairwise(tour)])
    assert (costs - graph.length_m[tour[1:]]).max() < 300.0


def test_coverage_and_revisits_by_hand(graph):
    length = graph.length_m
    coverage, revisits = coverage_and_revisits([0, 1, 0], graph)
    assert coverage == pytest.approx((length[0] + length[1]) / length.sum())
    assert revisits == pytest.approx(length[0] / (2 * length[0] + length[1]))


def test_planned_length_by_distance_time_or_default():
    assert TourSpec(length_m=500.0).planned_length_m() == 500.0
    assert TourSpec(duration_s=1315.0).planned_length_m() == pytest.approx(7232.5)  # the paper's drive is about 7.2 km
    assert TourSpec().planned_length_m() > 3000.0
    with pytest.raises(ValidationError):
        TourSpec(length_m=-1.0)
