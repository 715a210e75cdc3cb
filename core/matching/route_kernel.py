"""The compiled search behind ``route_search``: it sees bins, reach tables and costs, and knows no roads.

A hypothesis is (bin, scale bin) with two carried values: the heading offset between odometry and network, and the part of the
driven length that the bins could not express. Carrying them makes the search exact in length over any number of bins and
invariant to translation and rotation, at the price that they follow the survivor (as in any particle-like Viterbi).

Beside these there are hypotheses off the network (``off_network_kernel``). They keep their index into the arrays ``off_*`` as a
negative bin.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.off_network_kernel import Costs, OffNetwork, Tables, expand_off, leavers, wrap

Survivors: TypeAlias = tuple[Any, ...]  # see ``forward``

_NOWHERE = -1e30
_MOST_SUCCESSORS = 2048  # of one hypothesis: a few bins x scale bins x branches of a junction, or the bins round a place
_MOST_OFF = 192  # hypotheses off the network in one step; beyond this the worst gives way
_SAME_PLACE_M = 4.0  # closer than this, two hypotheses off the network count as one
_FARTHEST_JUMP = 12  # scale bins: 50 % either way
_JUMP_SPREAD = 4.0  # nats; only hypotheses this close to the best may jump in scale, and only if they are few
_MOST_JUMPING = 200


@njit(cache=True)
def expand(
    bin_: int,
    k: int,
    offset: float,
    rest: float,
    heading: float,
    step: float,
    scales: NDArray[Any],
    tables: Tables,
    costs: Costs,
    jumps: bool,
    place: tuple[float, float, float],
    out: NDArray[Any],
) -> int:
    """Successors of one hypothesis over one step, counted. Rows of ``out``: bin, scale bin, log likelihood, offset, rest.

    A bin either side of the predicted length is tried, for corners cut or swung out. ``jumps``: the scale may jump.
    ``place``: x, y and 1/sigma^2 of where the step is known to end, 0 where it is not.
    """
    start, reach_bin, reach_m, reach_changes, bin_heading, _, points = tables
    sigma, limit, gain, half, length_sigma, scale_cost, jump_cost, change_cost = costs
    count = 0
    first, last = start[bin_], start[bin_ + 1]
    farthest = _FARTHEST_JUMP if jumps else 1
    for move in range(-farthest, farthest + 1):
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
            cost = 0.5 * beyond * beyond + min(0.5 * (turn / sigma) ** 2, limit) + min(scale_cost * abs(move), jump_cost)
            if place[2] > 0.0:
                away_sq = (points[reach_bin[r], 0] - place[0]) ** 2 + (points[reach_bin[r], 1] - place[1]) ** 2
                cost += min(0.5 * place[2] * away_sq, limit)
            out[count, 0] = reach_bin[r]
            out[count, 1] = k_next
            out[count, 2] = -(cost + change_cost * reach_changes[r])
            out[count, 3] = wrap(offset + gain * min(max(turn, -3.0 * sigma), 3.0 * sigma))
            out[count, 4] = min(max(error, -half), half)
            count += 1
    return count


@njit(cache=True)
def grown(array: NDArray[Any], size: int) -> NDArray[Any]:
    """A copy with room for ``size`` rows, at least doubled."""
    bigger = np.empty(max(size, 2 * array.shape[0]), array.dtype)
    bigger[: array.shape[0]] = array
    return bigger


@njit(cache=True)
def jump_bar(score: NDArray[Any]) -> float:
    """The score from which on hypotheses may jump in scale; infinite while too many are as good."""
    bar = score.max() - _JUMP_SPREAD if score.shape[0] else math.inf
    count = 0
    for value in score:
        count += value >= bar
    return bar if count <= _MOST_JUMPING else math.inf


@njit(cache=True)
def forward(
    headings: NDArray[Any],
    places: NDArray[Any],
    step: float,
    scales: NDArray[Any],
    tables: Tables,
    costs: Costs,
    off: OffNetwork,
    beam: float,
    most: int,
    enough: int,
    seeds: tuple[Any, ...],
) -> Survivors:
    """Beam search over T headings and (known) places (T, 3), at most about ``most`` survivors a step.

    It ends early once no more than ``enough`` survive.

    ``seeds``: bin, scale bin, score, offset, rest of the hypotheses at heading 0; place, metres of those off the network.
    Returns the survivors of the t <= T steps searched: row_start (t + 1,), bin, scale bin, parent row, score, offset, rest,
    and of those off the network: place (M, 2), metres driven since they left.
    """
    seed_bin, seed_k, seed_score, seed_offset, seed_rest, seed_place, seed_away = seeds
    times, scale_count, points, lane = headings.shape[0], scales.shape[0], off[0], tables[5]
    leave_cost, off_cost, off_spread = off[11], off[12], off[13]
    size = seed_bin.shape[0]
    room = max(4 * size, 1 << 16)
    bin_, k, parent = np.empty(room, np.int32), np.empty(room, np.uint8), np.empty(room, np.int32)
    score, offset, rest = np.empty(room, np.float32), np.empty(room, np.float32), np.empty(room, np.float32)
    bin_[:size], k[:size], parent[:size] = seed_bin, seed_k, -1
    score[:size], offset[:size], rest[:size] = seed_score, seed_offset, seed_rest
    off_size = seed_place.shape[0]
    off_room = max(1024, 2 * off_size)
    off_x, off_y, off_away = np.empty(off_room, np.float32), np.empty(off_room, np.float32), np.empty(off_room, np.float32)
    off_x[:off_size], off_y[:off_size], off_away[:off_size] = seed_place[:, 0], seed_place[:, 1], seed_away
    row_start = np.zeros(times + 1, np.int64)
    row_start[1] = size
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    lane_slot = np.full(lane.max() + 1, -1, np.int32)
    out = np.empty((_MOST_SUCCESSORS, 5))
    for t in range(1, times):
        begin, end = row_start[t - 1], row_start[t]
        size, best = end, _NOWHERE
        course = 0.5 * (headings[t - 1] + headings[t])
        bar = jump_bar(score[begin:end])
        place = (places[t, 0], places[t, 1], places[t, 2])
        for i in range(begin, end):
            if bin_[i] >= 0:
                found = expand(
                    bin_[i], int(k[i]), offset[i], rest[i], headings[t], step, scales, tables, costs, score[i] >= bar, place, out
                )
            else:
                j, far = -1 - bin_[i], step * scales[k[i]]
                x, y = off_x[j] + far * math.cos(course + offset[i]), off_y[j] + far * math.sin(course + offset[i])
                found = expand_off(x, y, off_away[j] + far, int(k[i]), offset[i], headings[t], tables, costs, off, out)
            if size + found + _MOST_OFF >= bin_.shape[0]:
                wanted = size + found + _MOST_OFF + 1
                bin_, k, parent = grown(bin_, wanted), grown(k, wanted), grown(parent, wanted)
                score, offset, rest = grown(score, wanted), grown(offset, wanted), grown(rest, wanted)
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
        kept = end
        on_network = size
        going = leavers(begin, end, bin_, score, off_spread, lane, lane_slot)
        if off_size + _MOST_OFF >= off_x.shape[0]:
            off_x, off_y, off_away = grown(off_x, 0), grown(off_y, 0), grown(off_away, 0)
        for n in range(begin, end + going.shape[0]):
            i = n if n < end else going[n - end]
            if n < end and bin_[i] >= 0:
                continue
            far = step * scales[k[i]]
            x, y = far * math.cos(course + offset[i]), far * math.sin(course + offset[i])
            if bin_[i] < 0:
                total, away = score[i] - off_cost, off_away[-1 - bin_[i]] + far
                x, y = x + off_x[-1 - bin_[i]], y + off_y[-1 - bin_[i]]
            else:
                total, away = score[i] - off_cost - leave_cost, far
                x, y = x + points[bin_[i], 0], y + points[bin_[i], 1]
            if total < best - beam:
                continue
            best = max(best, total)
            at, worst = -1, -1
            for other in range(on_network, size):
                j = -1 - bin_[other]
                if abs(off_x[j] - x) + abs(off_y[j] - y) < _SAME_PLACE_M and abs(wrap(offset[other] - offset[i])) < 0.3:
                    at = other
                if worst < 0 or score[other] < score[worst]:
                    worst = other
            if at < 0 and size - on_network == _MOST_OFF:
                at = worst
            if at < 0:
                at = size
                bin_[at] = -1 - off_size
                size += 1
                off_size += 1
            elif total <= score[at]:
                continue
            j = -1 - bin_[at]
            off_x[j], off_y[j], off_away[j] = x, y, away
            k[at], parent[at], score[at], offset[at], rest[at] = k[i], i, total, offset[i], 0.0
        bar = best - beam
        if size - end > most:
            bar = max(bar, np.partition(score[end:size], size - end - most)[size - end - most])
        for i in range(end, size):
            if bin_[i] >= 0:
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
    off_places = np.stack((off_x[:off_size], off_y[:off_size]), axis=1)
    return (
        row_start,
        bin_[:size],
        k[:size],
        parent[:size],
        score[:size],
        offset[:size],
        rest[:size],
        off_places,
        off_away[:off_size],
    )


@njit(cache=True)
def backward(
    headings: NDArray[Any],
    places: NDArray[Any],
    step: float,
    scales: NDArray[Any],
    tables: Tables,
    costs: Costs,
    off: OffNetwork,
    margin: float,
    survivors: Survivors,
) -> NDArray[Any]:
    """Score (rows,) of the best complete route through each survivor; far below any score where none comes within ``margin``."""
    row_start, bin_, k, parent, score, offset, rest, off_places, off_away = survivors
    times, scale_count = row_start.shape[0] - 1, scales.shape[0]
    through = np.full(bin_.shape[0], _NOWHERE, np.float32)
    through[row_start[times - 1] :] = score[row_start[times - 1] :]
    best = through[row_start[times - 1] :].max()
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    out = np.empty((_MOST_SUCCESSORS, 5))
    for t in range(times - 2, -1, -1):
        begin, end = row_start[t + 1], row_start[t + 2]
        course = 0.5 * (headings[t] + headings[t + 1])
        bar = jump_bar(score[row_start[t] : begin])
        place = (places[t + 1, 0], places[t + 1, 1], places[t + 1, 2])
        for i in range(begin, end):
            if through[i] < best - margin:
                continue
            if bin_[i] >= 0:
                slot[int(bin_[i]) * scale_count + int(k[i])] = i
            else:
                through[parent[i]] = max(through[parent[i]], through[i])
        for i in range(row_start[t], begin):
            if bin_[i] >= 0:
                found = expand(
                    bin_[i],
                    int(k[i]),
                    offset[i],
                    rest[i],
                    headings[t + 1],
                    step,
                    scales,
                    tables,
                    costs,
                    score[i] >= bar,
                    place,
                    out,
                )
            else:
                j, far = -1 - bin_[i], step * scales[k[i]]
                x, y = (
                    off_places[j, 0] + far * math.cos(course + offset[i]),
                    off_places[j, 1] + far * math.sin(course + offset[i]),
                )
                found = expand_off(x, y, off_away[j] + far, int(k[i]), offset[i], headings[t + 1], tables, costs, off, out)
            for c in range(found):
                at = slot[int(out[c, 0]) * scale_count + int(out[c, 1])]
                if at >= 0:
                    through[i] = max(through[i], score[i] + out[c, 2] + (through[at] - score[at]))
        for i in range(begin, end):
            if bin_[i] >= 0:
                slot[int(bin_[i]) * scale_count + int(k[i])] = -1
    return through
