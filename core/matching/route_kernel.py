"""The compiled search behind ``route_search``: it sees bins, reach tables and costs, and knows no roads.

A hypothesis is (bin, scale bin) with two carried values: the heading offset between odometry and network, and the part of the
driven length that the bins could not express. Carrying them makes the search exact in length over any number of bins and
invariant to translation and rotation, at the price that they follow the survivor (as in any particle-like Viterbi).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_NOWHERE = np.float32(-1e30)


@njit(cache=True, inline="always")
def wrap(angle):  # type: ignore[no-untyped-def]
    """An angle into [-pi, pi]; the callers' sums lie within a few turns, where this is far quicker than a modulo."""
    while angle > math.pi:
        angle -= 2.0 * math.pi
    while angle < -math.pi:
        angle += 2.0 * math.pi
    return angle


@njit(cache=True)
def expand(bin_, k, offset, rest, heading, step, scales, tables, costs, out):  # type: ignore[no-untyped-def]
    """Successors of one hypothesis over one step. Rows of ``out``: bin, scale bin, log likelihood, offset, rest. Returns the count.

    ``costs``: heading sigma (rad), its limit (nats), offset gain, half a bin (m), length sigma (m), scale step and lane change (nats).
    A bin either side of the predicted length is tried, for corners cut or swung out.
    """
    start, reach_bin, reach_m, reach_changes, bin_heading = tables
    sigma, limit, gain, half, length_sigma, scale_cost, change_cost = costs
    count = 0
    first, last = start[bin_], start[bin_ + 1]
    for move in range(-1, 2):
        k_next = k + move
        if k_next < 0 or k_next >= scales.shape[0]:
            continue
        ahead = step * scales[k_next] + rest
        window = 3.0 * half if move == 0 else half
        low, high = first, last
        while low < high:
            middle = (low + high) // 2
            if reach_m[middle] < ahead - window:
                low = middle + 1
            else:
                high = middle
        for r in range(low, last):
            error = ahead - reach_m[r]
            if error < -window:
                break
            if count == out.shape[0]:
                return count
            beyond = max(abs(error) - half, 0.0) / length_sigma
            turn = wrap(bin_heading[reach_bin[r]] - heading - offset)
            cost = 0.5 * beyond * beyond + min(0.5 * (turn / sigma) ** 2, limit) + scale_cost * abs(move)
            out[count, 0] = reach_bin[r]
            out[count, 1] = k_next
            out[count, 2] = -(cost + change_cost * reach_changes[r])
            out[count, 3] = wrap(offset + gain * min(max(turn, -3.0 * sigma), 3.0 * sigma))
            out[count, 4] = min(max(error, -half), half)
            count += 1
    return count


@njit(cache=True)
def grown(array, size):  # type: ignore[no-untyped-def]
    """A copy with room for ``size`` rows, at least doubled."""
    bigger = np.empty(max(size, 2 * array.shape[0]), array.dtype)
    bigger[: array.shape[0]] = array
    return bigger


@njit(cache=True)
def forward(headings, step, scales, tables, costs, beam, most, enough, seeds):  # type: ignore[no-untyped-def]
    """Beam search over T headings, of at most ``most`` survivors a step. It ends early once no more than ``enough`` survive.

    ``seeds``: bin, scale bin, score, offset, rest of the hypotheses at heading 0.
    Returns the survivors of the t <= T steps searched: row_start (t + 1,), bin, scale bin, parent (row), score, offset, rest.
    """
    seed_bin, seed_k, seed_score, seed_offset, seed_rest = seeds
    times, scale_count = headings.shape[0], scales.shape[0]
    size = seed_bin.shape[0]
    room = max(4 * size, 1 << 16)
    bin_, k, parent = np.empty(room, np.int32), np.empty(room, np.uint8), np.empty(room, np.int32)
    score, offset, rest = np.empty(room, np.float32), np.empty(room, np.float32), np.empty(room, np.float32)
    bin_[:size], k[:size], parent[:size] = seed_bin, seed_k, -1
    score[:size], offset[:size], rest[:size] = seed_score, seed_offset, seed_rest
    row_start = np.zeros(times + 1, np.int64)
    row_start[1] = size
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    out = np.empty((512, 5))
    for t in range(1, times):
        begin, end = row_start[t - 1], row_start[t]
        size, best = end, _NOWHERE
        for i in range(begin, end):
            found = expand(bin_[i], int(k[i]), offset[i], rest[i], headings[t], step, scales, tables, costs, out)
            if size + found >= bin_.shape[0]:
                bin_, k, parent = grown(bin_, size + found), grown(k, size + found), grown(parent, size + found)
                score, offset, rest = grown(score, size + found), grown(offset, size + found), grown(rest, size + found)
            for c in range(found):
                total = score[i] + out[c, 2]
                if total < best - beam:
                    continue
                best = max(best, total)
                state = int(out[c, 0]) * scale_count + int(out[c, 1])
                at = slot[state]
                if at < 0:
                    at = size
                    slot[state] = at
                    size += 1
                elif total <= score[at]:
                    continue
                bin_[at], k[at], parent[at], score[at] = int(out[c, 0]), int(out[c, 1]), i, total
                offset[at], rest[at] = out[c, 3], out[c, 4]
        kept, bar = end, best - beam
        if size - end > most:
            bar = max(bar, np.partition(score[end:size], size - end - most)[size - end - most])
        for i in range(end, size):
            slot[int(bin_[i]) * scale_count + int(k[i])] = -1
            if score[i] >= bar:
                bin_[kept], k[kept], parent[kept], score[kept] = bin_[i], k[i], parent[i], score[i]
                offset[kept], rest[kept] = offset[i], rest[i]
                kept += 1
        row_start[t + 1] = kept
        if kept - end <= enough:
            times = t + 1 if kept > end else t
            break
    row_start = row_start[: times + 1]
    size = row_start[times]
    return row_start, bin_[:size], k[:size], parent[:size], score[:size], offset[:size], rest[:size]


@njit(cache=True)
def backward(headings, step, scales, tables, costs, margin, survivors):  # type: ignore[no-untyped-def]
    """Score (rows,) of the best complete route through each survivor; far below any score where none comes within ``margin``."""
    row_start, bin_, k, _, score, offset, rest = survivors
    times, scale_count = row_start.shape[0] - 1, scales.shape[0]
    through = np.full(bin_.shape[0], _NOWHERE, np.float32)
    through[row_start[times - 1] :] = score[row_start[times - 1] :]
    best = through[row_start[times - 1] :].max()
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    out = np.empty((512, 5))
    for t in range(times - 2, -1, -1):
        begin, end = row_start[t + 1], row_start[t + 2]
        for i in range(begin, end):
            if through[i] >= best - margin:
                slot[int(bin_[i]) * scale_count + int(k[i])] = i
        for i in range(row_start[t], begin):
            found = expand(bin_[i], int(k[i]), offset[i], rest[i], headings[t + 1], step, scales, tables, costs, out)
            for c in range(found):
                at = slot[int(out[c, 0]) * scale_count + int(out[c, 1])]
                if at >= 0:
                    through[i] = max(through[i], score[i] + out[c, 2] + (through[at] - score[at]))
        for i in range(begin, end):
            slot[int(bin_[i]) * scale_count + int(k[i])] = -1
    return through
