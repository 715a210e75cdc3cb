"""Viterbi against every path tried out, and its breaks."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core.matching.hmm.viterbi import viterbi


def trellis(counts, rng, missing=0.0):
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    moves = np.array(counts[:-1], dtype=np.int64) * np.array(counts[1:], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(moves, dtype=np.int64)])
    transition = rng.normal(size=first[-1])
    transition[rng.random(first[-1]) < missing] = -np.inf
    return start, rng.normal(size=start[-1]), first, transition


def score(path, start, emission, first, transition):
    """Log probability of a path of own states, one for each step."""
    total = sum(emission[start[t] + state] for t, state in enumerate(path))
    for t in range(len(path) - 1):
        width = start[t + 2] - start[t + 1]
        total += transition[first[t] + path[t] * width + path[t + 1]]
    return total


@settings(max_examples=60, deadline=None)
@given(
    counts=st.lists(st.integers(1, 4), min_size=1, max_size=6), seed=st.integers(0, 10_000), missing=st.sampled_from([0.0, 0.3])
)
def test_equals_brute_force(counts, seed, missing):
    model = trellis(counts, np.random.default_rng(seed), missing)
    best = max(score(path, *model) for path in product(*(range(count) for count in counts)))
    path, part = viterbi(*model)
    if np.isfinite(best):
        assert part.max() == 0
        assert score(path - model[0][:-1], *model) == pytest.approx(best)
    else:
        assert part.max() > 0  # no path leads through, and it says so


def test_by_hand():
    """The better beginning leads nowhere good: state 1 first, though state 0 looks better at step 0."""
    emission = np.log(np.array([0.6, 0.4, 0.5, 0.5]))
    transition = np.log(np.array([0.1, 0.1, 0.9, 0.2]))
    path, part = viterbi(np.array([0, 2, 4]), emission, np.array([0, 4]), transition)
    assert path.tolist() == [1, 2]
    assert part.tolist() == [0, 0]


def test_a_step_without_states_begins_a_new_part():
    path, part = viterbi(np.array([0, 1, 1, 2, 3]), np.zeros(3), np.array([0, 0, 0, 1]), np.zeros(1))
    assert path.tolist() == [0, -1, 1, 2]
    assert part.tolist() == [0, -1, 1, 1]


def test_no_way_on_begins_a_new_part_and_neither_ends_short():
    transition = np.array([-np.inf, -np.inf, -np.inf, -np.inf, -1.0, -2.0, -0.5, -3.0])
    emission = np.array([-1.0, -2.0, 0.0, 0.0, 0.0, 0.0])
    path, part = viterbi(np.array([0, 2, 4, 6]), emission, np.array([0, 4, 8]), transition)
    assert path.tolist() == [0, 3, 4]
    assert part.tolist() == [0, 1, 1]


def test_a_hundred_thousand_steps_do_not_underflow():
    count = 100_000
    start, first = np.arange(count + 1, dtype=np.int32), np.arange(count)
    path, part = viterbi(start, np.full(count, -50.0), first, np.full(count - 1, -50.0))
    assert np.array_equal(path, np.arange(count))
    assert part.max() == 0
