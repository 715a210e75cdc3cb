"""Memory that all steps of the compiled search share: which hypothesis is in which state, bin and scale bin."""

from __future__ import annotations

import mmap
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from hippodrome.core.matching.search.hypotheses import SUCCESSOR, Hypotheses, Successors
from hippodrome.core.matching.search.model import SearchModel
from hippodrome.core.matching.search.successors import MOST_SUCCESSORS
from hippodrome.core.roads.lanes_ahead import WAYS
from hippodrome.core.types import IntArray

_MANY_STATES: Final = 1_000_000  # 4 MB, from which on NumPy asks for large pages


class Scratch(NamedTuple):
    """Arrays that all steps use, so that no step has to allocate them; both tables are as empty between steps as at first."""

    number_of_state: IntArray  # (N * K,) 1 + row of the hypothesis in each state, bin by bin; 0: there is none
    index_of_lane: IntArray  # (L,) which of the hypotheses that leave the network is on each lane; -1: none
    successors: Successors  # (MOST_SUCCESSORS,)
    scale_count: int  # K


def empty_states(model: SearchModel) -> IntArray:
    """The table of states (N * K,) without any hypothesis.

    The system gives memory to those pages only that are written to. A search touches few of the states of a large network.
    NumPy would ask for pages of 2 MB, which are touched almost all; so the memory is not NumPy's own.
    """
    count = len(model.graph.lane) * len(model.scales)
    if count < _MANY_STATES or not hasattr(mmap, "MAP_PRIVATE"):
        return np.zeros(count, np.int32)
    pages = mmap.mmap(-1, 4 * count, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    try:  # noqa: SIM105  # core imports numbers only
        pages.madvise(mmap.MADV_NOHUGEPAGE)
    except (AttributeError, OSError):  # a system without large pages does not know them
        pass
    return np.frombuffer(pages, np.int32)


@njit(cache=True, error_model="numpy")
def make_scratch(model: SearchModel, empty: IntArray) -> Scratch:
    """Allocate the memory that the steps share, around an empty table of states."""
    index_of_lane = np.full(model.graph.ahead.entry.shape[0] // WAYS, -1, np.int32)
    return Scratch(empty, index_of_lane, np.empty(MOST_SUCCESSORS, SUCCESSOR), model.scales.shape[0])


@njit(cache=True, error_model="numpy", inline="always")
def state_of(row: Any, scratch: Scratch) -> int:
    """Number of the state, bin and scale bin, of a hypothesis on the network or of a successor."""
    return int(row.bin * scratch.scale_count + row.scale_bin)


@njit(cache=True, error_model="numpy")
def forget_states(hypotheses: Hypotheses, scratch: Scratch) -> None:
    """Empty the entries of these hypotheses in the table of states, for the next step."""
    for i in range(hypotheses.shape[0]):
        if hypotheses[i].bin >= 0:
            scratch.number_of_state[state_of(hypotheses[i], scratch)] = 0
