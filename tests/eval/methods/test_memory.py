"""Memory of a method that shares our process."""

import numpy as np
import pytest

from hippodrome.eval.methods import memory
from hippodrome.eval.methods.memory import Growth, held_by_libraries


def test_what_a_method_held_and_freed_again_is_counted():
    if not memory.FORGET.exists():
        pytest.skip("this system does not let a process forget its peak")
    growth = Growth()
    held = np.ones(50_000_000, dtype=np.uint8)
    del held
    grown = growth.as_if_alone_bytes() - held_by_libraries()
    assert 45e6 < grown < 80e6
    small = Growth()
    assert small.as_if_alone_bytes() - held_by_libraries() < 10e6  # the earlier peak is forgotten


def test_where_nothing_can_be_known_nothing_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "FORGET", tmp_path / "absent" / "clear_refs")
    assert Growth().as_if_alone_bytes() is None
