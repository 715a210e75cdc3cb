"""The filter is its formula on small graphs, follows roads across junctions and closures, and starts only with statistics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core.views.config import SequenceConfig
from hippodrome.core.views.graph import (
    CellGraph,
    Paths,
    Predecessors,
    graph_of,
    neighbourhood,
    walk_back,
)
from hippodrome.core.views.sequence import NO_EVIDENCE, Evidence, Step, filter_step, margin_over, peak, propagate, standardise

CONFIG = SequenceConfig(memory=0.5)


def chain(count, spacing=5.0):
    return graph_of(np.arange(count), np.full(count, spacing), np.zeros(count), 0.6 * spacing)


def evidence(values):
    filtered = np.array(values, dtype=np.float32)
    return Evidence(filtered, filtered, np.full(len(filtered), -1, dtype=np.int32))


def z(*values):
    return np.array(values, dtype=np.float32)


def step(before, scores, graph, travelled=5.0, turned_rad=0.0, config=CONFIG):
    return filter_step(before, scores, graph.links, travelled, turned_rad, 5.0, config)


def test_one_step_along_a_chain_by_hand():
    after = step(evidence([2.0, -4.0, 1.0]), z(1.0, 1.0, 1.0), chain(3))
    assert_allclose(after.filtered, [0.5, 0.5 + 1.0, 0.5])  # cell 2's predecessor holds -4: max with 0
    assert_array_equal(after.predecessor, [-1, 0, -1])


def test_a_predecessor_must_lie_about_one_driven_step_behind():
    graph, before = chain(4), evidence([4.0, 0.0, 0.0, 0.0])
    assert step(before, z(0, 0, 0, 0), graph, travelled=5.0).filtered.argmax() == 1
    assert step(before, z(0, 0, 0, 0), graph, travelled=10.0).filtered.argmax() == 2
    assert step(before, z(0, 0, 0, 0), graph, travelled=1.0).filtered.argmax() == 0  # hardly moved: the cell itself


def test_the_driven_turn_chooses_the_leg_of_a_junction():
    graph = CellGraph()
    for _ in range(3):
        graph.add_cell()
    graph.link(0, 1, 5.0, 0.0)
    graph.link(0, 2, 5.0, 1.2)
    before = evidence([4.0, 0.0, 0.0])
    assert step(before, z(0, 0, 0), graph, turned_rad=0.1).filtered.argmax() == 1
    assert step(before, z(0, 0, 0), graph, turned_rad=1.0).filtered.argmax() == 2


def test_evidence_crosses_a_loop_closure():
    cells = np.array([0, 1, 2, 3, 4, 1, 5])  # the sixth visit shares cell 1, then leaves on a new road
    graph = graph_of(cells, np.full(7, 5.0), np.zeros(7), 3.0)
    after = step(evidence([0, 4.0, 0, 0, 0, 0]), z(0, 0, 0, 0, 0, 0), graph)
    assert_array_equal(np.flatnonzero(after.filtered), [2, 5])


def test_cells_stored_since_the_last_view_bring_no_evidence():
    after = step(evidence([1.0]), z(1.0, 1.0, 1.0), chain(3))
    assert_allclose(after.filtered, [0.5, 1.0, 0.5])


def test_evidence_runs_along_paths_that_were_laid_out():
    paths = Paths(np.array([0, 0, 1], np.int32), np.array([0.0, 5.0, 0.0]), np.zeros(3))
    predecessors, tolerance = Predecessors(np.array([0, 1, 3], np.int32), paths), Step(3.0, 0.5)
    before, scores, cells = z(2.0, 0.0), z(0.5, 1.0), np.arange(2, dtype=np.int32)
    moved = propagate(before, cells, scores, predecessors, Step(5.0, 0.0), tolerance, np.float32(0.5))
    assert_allclose(moved, [0.25, 1.5])
    turned = propagate(before, cells, scores, predecessors, Step(5.0, 1.0), tolerance, np.float32(0.5))
    assert_allclose(turned, [0.25, 0.5])
    second = propagate(before, cells[1:], scores[1:], predecessors, Step(5.0, 0.0), tolerance, np.float32(0.5))
    assert_allclose(second, [0.0, 1.5])


def test_the_graph_that_grows_and_the_paths_that_were_laid_out_give_the_same_evidence():
    rng, count = np.random.default_rng(1), 60
    graph = graph_of(rng.integers(0, count, 400), rng.uniform(3.0, 7.0, 400), rng.normal(0.0, 0.4, 400), 3.0)
    before, scores = rng.normal(size=(2, graph.cell_count)).astype(np.float32)
    walks = [walk_back(graph.links, cell, 5.0 + 0.6 * 5.0) for cell in range(graph.cell_count)]
    start = np.cumsum([0, *(len(walk.source) for walk in walks)]).astype(np.int32)
    paths = Paths(*(np.concatenate(parts) for parts in zip(*walks, strict=True)))
    driven, tolerance = Step(5.0, 0.1), Step(CONFIG.length_tolerance * 5.0, CONFIG.turn_tolerance_rad)
    cells = np.arange(graph.cell_count, dtype=np.int32)
    laid_out = propagate(before, cells, scores, Predecessors(start, paths), driven, tolerance, np.float32(CONFIG.memory))
    assert_array_equal(step(evidence(before), scores, graph, turned_rad=0.1).filtered, laid_out)


def test_a_handful_of_cells_makes_no_statistics():
    assert_array_equal(standardise(np.arange(29, dtype=np.float32), 30, 0.03), np.zeros(29))
    assert standardise(np.arange(30, dtype=np.float32), 30, 0.03).max() > 1.0


def test_equal_scores_do_not_divide_by_zero():
    scores = np.full(50, 0.3, dtype=np.float32)
    scores[7] += 0.03
    assert_allclose(standardise(scores, 30, 0.03)[7], 1.0, atol=0.05)


def test_the_margin_ignores_the_neighbourhood_of_the_best():
    best = peak(evidence([0.0, 3.0, 9.0, 8.0, 0.0, 0.0, 5.0, 1.0]), chain(8).links, reach=15.0)
    assert best.cell == 2
    assert best.margin == pytest.approx(4.0)


def test_no_rivals_mean_no_margin():
    assert margin_over(z(3.0, 1.0), 0, np.array([False, False])) == 0.0
    assert peak(NO_EVIDENCE, CellGraph().links, 15.0).cell == -1


def test_a_chain_of_fair_views_beats_one_excellent_stray():
    graph, rng = chain(200), np.random.default_rng(0)
    state = NO_EVIDENCE
    for t in range(12):
        scores = rng.normal(size=200).astype(np.float32)
        scores[100 + t] = 4.0
        scores[int(rng.integers(0, 80))] = 6.0
        state = step(state, scores, graph)
    found = peak(state, graph.links, 15.0)
    assert found.cell == 111
    assert found.margin > 0.0


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=30), st.floats(0.0, 0.9))
def test_evidence_never_exceeds_what_it_is_made_of(scores, memory):
    config, graph = SequenceConfig(memory=memory), chain(len(scores))
    first = step(NO_EVIDENCE, z(*scores), graph, config=config)
    second = step(first, z(*scores), graph, config=config)
    assert second.filtered.max() <= max(0.0, *scores) + 1e-5


def test_walks_and_neighbourhoods_have_the_lengths_of_their_paths():
    graph = chain(10)
    cells, lengths, turns = walk_back(graph.links, 6, 15.0)
    assert_array_equal(cells, [6, 5, 4, 3])
    assert_allclose(lengths, [0, 5, 10, 15])
    assert_allclose(turns, 0.0)
    assert_array_equal(np.flatnonzero(neighbourhood(graph.links, 6, 10.0)), [4, 5, 6, 7, 8])


def test_a_path_that_exists_is_not_laid_twice():
    cells = np.concatenate([np.arange(20)] * 5)
    graph = graph_of(cells, np.full(100, 5.0), np.zeros(100), 3.0)
    assert len(graph.links.source) == 20  # 19 along the road, 1 from its end back to its start


def test_a_graph_of_many_cells_keeps_its_links_while_it_grows():
    graph = chain(1000)
    assert_array_equal(graph.links.source, np.arange(999))
    assert_array_equal(graph.links.target, np.arange(1, 1000))


@pytest.mark.parametrize("wrong", [{"memory": 1.0}, {"min_cells": 1}, {"sigma_floor": 0.0}])
def test_impossible_settings_are_rejected(wrong):
    with pytest.raises(ValueError, match="sequence"):
        SequenceConfig(**wrong)
