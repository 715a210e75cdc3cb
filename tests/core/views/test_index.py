"""The sketched search against the exhaustive one, on views that have as few degrees of freedom as those of a town."""

import numpy as np
import pytest

from hippodrome.core.views.config import SearchConfig, ViewCellConfig
from hippodrome.core.views.index import candidates, index_of, search
from hippodrome.core.views.scoring import make_bank, score, start_query_mean, template_mean

VIEWS = ViewCellConfig()
NOTHING = np.zeros(0, np.int32)


def town_of_views(rng, count):
    """Templates (count, D): blends of 80 patterns and a little noise."""
    size = int(np.prod(VIEWS.shape))
    patterns, weights = rng.uniform(0.0, 60.0, (80, size)), rng.dirichlet(np.full(80, 0.1), count)
    return np.clip(weights @ patterns + rng.normal(0.0, 2.0, (count, size)), 0, 127).astype(np.int8)


@pytest.fixture(scope="module")
def bank():
    templates = town_of_views(np.random.default_rng(0), 1500)
    return make_bank("gradient", VIEWS.shape, templates, template_mean("gradient", templates))


def queries(bank, rng, count):
    for cell in rng.choice(len(bank.templates), count, replace=False):
        seen = np.clip(bank.templates[cell] + rng.normal(0.0, 4.0, bank.templates.shape[1]), 0, 127).astype(np.int8)
        yield cell, (seen, start_query_mean(bank.mean))


def test_small_banks_are_searched_exhaustively(bank):
    config = SearchConfig()
    assert index_of(bank, config) is None
    _, query = next(queries(bank, np.random.default_rng(1), 1))
    found = search(bank, None, NOTHING, query, VIEWS, config)
    exact = score(bank, *query, VIEWS).max(axis=1)
    np.testing.assert_array_equal(found.similarity, exact)
    np.testing.assert_array_equal(found.cells, np.arange(1500))
    assert (found.mean, found.spread) == (exact.mean(), exact.std())


def test_the_best_match_is_among_the_candidates_and_scored_exactly(bank):
    config = SearchConfig(exhaustive_cells=100, candidates=30, sample=500)
    index = index_of(bank, config)
    hits, spread = 0, []
    for _, query in queries(bank, np.random.default_rng(2), 100):
        exact = score(bank, *query, VIEWS).max(axis=1)
        found = search(bank, index, NOTHING, query, VIEWS, config)
        np.testing.assert_array_equal(found.similarity, exact[found.cells])
        assert len(found.cells) == 30
        spread.append(found.spread / exact.std())
        hits += int(np.argmax(exact)) in found.cells
    assert hits >= 99
    assert np.mean(spread) == pytest.approx(1.0, abs=0.1)


def test_expected_cells_are_scored_whatever_their_sketch(bank):
    config = SearchConfig(exhaustive_cells=100, candidates=10)
    index = index_of(bank, config)
    _, query = next(queries(bank, np.random.default_rng(3), 1))
    found = search(bank, index, np.array([1400, 3, 3], np.int32), query, VIEWS, config)
    assert {3, 1400} <= set(found.cells)
    assert np.all(np.diff(found.cells) > 0)


def test_a_moved_view_is_found_as_well(bank):
    config = SearchConfig(exhaustive_cells=100, candidates=30)
    index = index_of(bank, config)
    rows = int(np.prod(VIEWS.shape[1:]))
    moved = np.concatenate([bank.templates[700][rows:], bank.mean[-rows:].astype(np.int8)])
    assert 700 in candidates(bank, index, (moved, start_query_mean(bank.mean)), VIEWS, 30)


def test_rejects_empty_searches():
    with pytest.raises(ValueError, match="at least 1"):
        SearchConfig(candidates=0)
