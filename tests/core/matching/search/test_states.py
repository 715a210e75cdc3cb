"""The table of states: memory of its own, whatever its size."""

import numpy as np
import pytest

from hippodrome.core.matching.search import states
from hippodrome.core.matching.search.problem import compiled_model
from hippodrome.core.matching.search.states import empty_states
from tests.core.matching.search.test_successors import problem


@pytest.mark.parametrize("most", [1, 1_000_000])
def test_a_large_table_is_as_empty_and_as_writable_as_a_small_one(monkeypatch, most):
    monkeypatch.setattr(states, "_MANY_STATES", most)
    table = empty_states(compiled_model(problem(log_scale=(0.0, 0.1))))
    assert table.dtype == np.int32
    assert len(table) == 2 * problem().graph.bin_count
    assert not table.any()
    table[-1] = 7
    assert table[-1] == 7
