"""The likeliest path through a hidden Markov model whose states differ from step to step. It knows nothing of roads."""

from __future__ import annotations

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray, IntArray


def viterbi(
    state_start: IntArray, log_emission: FloatArray, transition_start: IntArray, log_transition: FloatArray
) -> tuple[IntArray, IntArray]:
    """Most likely state at each of T steps, in log space.

    Step ``t`` owns states ``state_start[t]:state_start[t + 1]`` of ``log_emission``; its moves to the states of ``t + 1`` are
    ``log_transition[transition_start[t]:transition_start[t + 1]]``, row by row. Where no state can be reached the path ends and a
    new one begins, so that the answer never ends short. Returns the state (T,) as an index into ``log_emission``, -1 where a step
    has none, and the part (T,), counted up where a new path begins, -1 where there is no state.
    """
    path, part = _viterbi(state_start, log_emission, transition_start, log_transition)
    return path, part


@njit(cache=True)
def _viterbi(state_start, log_emission, transition_start, log_transition):  # type: ignore[no-untyped-def]
    steps = len(state_start) - 1
    path = np.full(steps, -1, dtype=np.int32)
    part = np.full(steps, -1, dtype=np.int32)
    score = log_emission.copy()
    before = np.full(len(log_emission), -1, dtype=np.int32)
    parts = 0
    for t in range(steps):
        begin, end = state_start[t], state_start[t + 1]
        if begin == end:
            continue
        connected = False
        if t > 0 and state_start[t - 1] < begin:
            connected = _extend(
                state_start[t - 1], begin, end, transition_start[t - 1], log_transition, log_emission, score, before
            )
        if not connected:
            parts += 1
            score[begin:end] = log_emission[begin:end]
        part[t] = parts - 1
    for t in range(steps - 1, -1, -1):
        if part[t] < 0:
            continue
        if t + 1 < steps and part[t + 1] == part[t]:
            path[t] = before[path[t + 1]]
        else:
            path[t] = state_start[t] + np.argmax(score[state_start[t] : state_start[t + 1]])
    return path, part


@njit(cache=True)
def _extend(previous, begin, end, first, log_transition, log_emission, score, before):  # type: ignore[no-untyped-def]
    """Scores of the states begin:end reached from previous:begin; False where none can be reached."""
    connected = False
    width = end - begin
    for j in range(begin, end):
        best, best_state = -np.inf, -1
        for i in range(previous, begin):
            reached = score[i] + log_transition[first + (i - previous) * width + (j - begin)]
            if reached > best:
                best, best_state = reached, i
        score[j] = best + log_emission[j]
        before[j] = best_state
        connected = connected or score[j] > -np.inf
    return connected
