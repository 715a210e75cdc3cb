"""The most likely path through a hidden Markov model whose states differ from step to step. It knows nothing of roads.

The method is the Viterbi algorithm in log space (A. J. Viterbi 1967; as in L. R. Rabiner, "A tutorial on hidden Markov models",
1989, III.B), with one addition: where no state of the next step can be reached, the path ends and a new one begins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, IntArray


class _Trellis(NamedTuple):
    """States of all steps and the transitions between them, as ``viterbi`` takes them."""

    state_start: IntArray  # (T + 1,)
    log_emission: FloatArray  # (K,)
    transition_start: NDArray[np.int64]  # (T,)
    log_transition: FloatArray


def viterbi(
    state_start: IntArray, log_emission: FloatArray, transition_start: NDArray[np.int64], log_transition: FloatArray
) -> tuple[IntArray, IntArray]:
    """Most likely state at each of T steps, in log space.

    Args:
        state_start: (T + 1,) step ``t`` owns the states ``state_start[t]:state_start[t + 1]``.
        log_emission: (K,) log emission probability of each state.
        transition_start: (T,) step ``t`` owns the transitions ``transition_start[t]:transition_start[t + 1]`` to ``t + 1``.
        log_transition: log transition probabilities, ordered by state of ``t``, then of ``t + 1``; -inf where there is none.

    Returns:
        The state (T,) of each step as an index into ``log_emission``, -1 where a step has none; and the part (T,) of the path
        that each step belongs to, counted up where no state could be reached and a new path begins, -1 where there is no state.
    """
    path, part = _viterbi(_Trellis(state_start, log_emission, transition_start, log_transition))
    return path, part


@njit(cache=True)
def _viterbi(trellis: _Trellis) -> tuple[IntArray, IntArray]:
    """Forward recursion over all steps, then the path traced back from the best state at the end of each part."""
    state_start, log_emission = trellis.state_start, trellis.log_emission
    steps = len(state_start) - 1
    part = np.full(steps, -1, dtype=np.int32)
    score = log_emission.copy()
    predecessor = np.full(len(log_emission), -1, dtype=np.int32)
    parts = 0
    for t in range(steps):
        begin, end = state_start[t], state_start[t + 1]
        if begin == end:
            continue
        reached = t > 0 and state_start[t - 1] < begin and _extend(trellis, t, score, predecessor)
        if not reached:
            parts += 1
            score[begin:end] = log_emission[begin:end]
        part[t] = parts - 1
    return _traced_back(state_start, part, score, predecessor), part


@njit(cache=True)
def _extend(trellis: _Trellis, t: int, score: FloatArray, predecessor: IntArray) -> bool:
    """Score and best predecessor of each state of step ``t``, from the scores of ``t - 1``; False if none can be reached."""
    previous, begin, end = trellis.state_start[t - 1], trellis.state_start[t], trellis.state_start[t + 1]
    first, width = trellis.transition_start[t - 1], end - begin
    any_reached = False
    for j in range(begin, end):
        best, best_state = -np.inf, -1
        for i in range(previous, begin):
            total = score[i] + trellis.log_transition[first + (i - previous) * width + (j - begin)]
            if total > best:
                best, best_state = total, i
        score[j] = best + trellis.log_emission[j]
        predecessor[j] = best_state
        any_reached = any_reached or score[j] > -np.inf
    return any_reached


@njit(cache=True)
def _traced_back(state_start: IntArray, part: IntArray, score: FloatArray, predecessor: IntArray) -> IntArray:
    """The state (T,) of each step on the most likely path, -1 for a step without states.

    Where no state of the next step could be reached, a path ends and a new one begins. Each such ``part`` (T,) of the path is
    traced back by itself, from the state with the best ``score`` at its last step.
    """
    steps = len(part)
    path = np.full(steps, -1, dtype=np.int32)
    for t in range(steps - 1, -1, -1):
        if part[t] < 0:
            continue
        if t + 1 < steps and part[t + 1] == part[t]:
            path[t] = predecessor[path[t + 1]]
        else:
            path[t] = state_start[t] + np.argmax(score[state_start[t] : state_start[t + 1]])
    return path
