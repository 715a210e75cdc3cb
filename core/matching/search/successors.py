"""What one hypothesis may become over one step, compiled: it sees bins, reach tables and costs, and knows no roads."""

from __future__ import annotations

import math
from typing import Any

from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import (
    Costs,
    Moment,
    OffNetwork,
    OffRows,
    Rows,
    Tables,
)
from hippodrome.core.matching.search.off_network import expand_off, move_off
from hippodrome.core.se2 import wrap_near_zero

MOST_SUCCESSORS = 2048  # of one hypothesis: a few bins x scale bins x branches of a junction, or the bins round a place
_FARTHEST_JUMP = 12  # scale bins: 50 % either way
_JUMP_SPREAD = 2.0  # nats; only hypotheses this close to the best may jump in scale, and only if they are few
_MOST_JUMPING = 200


@njit(cache=True, error_model="numpy")
def expand(
    row: Any, moment: Moment, scales: NDArray[Any], tables: Tables, costs: Costs, jumps: bool, most_cost: float, out: NDArray[Any]
) -> int:
    """Successors of one hypothesis on the network over one step, counted: those that cost at most ``most_cost``.

    Rows of ``out``: bin, scale bin, log likelihood, offset, rest. A bin either side of the predicted length is tried, for
    corners cut or swung out. ``jumps``: the scale may jump.
    """
    start, reach_bin, reach_m, reach_changes, bin_heading, _, points = tables
    sigma, limit, gain, half, length_sigma, scale_cost, jump_cost, change_cost = costs
    heading, _, step, place_x, place_y, place_weight = moment
    offset, rest, own_k = float(row.offset), float(row.rest), row.k
    course, per_sigma, per_length, most_turn = heading + offset, 1.0 / sigma, 1.0 / length_sigma, 3.0 * sigma
    low, last = start[row.bin], start[row.bin + 1]
    farthest = _FARTHEST_JUMP if jumps else 1
    count = 0
    for k in range(max(own_k - farthest, 0), min(own_k + farthest + 1, scales.shape[0])):
        move_cost = min(scale_cost * abs(k - own_k), jump_cost)
        if move_cost > most_cost:
            continue
        ahead = step * scales[k] + rest
        window = 3.0 * half if k == own_k else half
        while low < last and reach_m[low] < ahead - 3.0 * half:  # scales grow: what lies before one lies before the next
            low += 1
        for r in range(low, last):
            error = ahead - reach_m[r]
            if error < -window:
                break
            if error > window:
                continue
            target = reach_bin[r]
            beyond, turn = (abs(error) - half) * per_length, wrap_near_zero(bin_heading[target] - course)
            cost = move_cost + change_cost * reach_changes[r] + min(0.5 * (turn * per_sigma) ** 2, limit)
            if beyond > 0.0:
                cost += 0.5 * beyond * beyond
            if place_weight > 0.0:
                away_sq = (points[target, 0] - place_x) ** 2 + (points[target, 1] - place_y) ** 2
                cost += min(0.5 * place_weight * away_sq, limit)
            if cost > most_cost:
                continue
            if count == out.shape[0]:
                return count
            out[count, 0] = target
            out[count, 1] = k
            out[count, 2] = -cost
            out[count, 3] = wrap_near_zero(offset + gain * min(max(turn, -most_turn), most_turn))
            out[count, 4] = min(max(error, -half), half)
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def successors(
    row: Any, off_rows: OffRows, moment: Moment, scales: NDArray[Any], tables: Tables, costs: Costs, off: OffNetwork,
    jumps: bool, most_cost: float, out: NDArray[Any],
) -> int:  # fmt: skip
    """Where one hypothesis, on the network or off it, may be on the network a step later; rows of ``out`` as in ``expand``."""
    if row.bin >= 0:
        return expand(row, moment, scales, tables, costs, jumps, most_cost, out)
    x, y, away = move_off(row, off_rows, moment, scales, off[0])
    return expand_off(x, y, away, row.k, row.offset, moment[0], tables, costs, off, out)


@njit(cache=True, error_model="numpy")
def jump_bar(rows: Rows) -> tuple[float, int]:
    """The score from which on hypotheses may jump in scale, infinite while too many are as good; and which row is best."""
    lead = 0
    for i in range(rows.shape[0]):
        lead = i if rows[i].score > rows[lead].score else lead
    bar = rows[lead].score - _JUMP_SPREAD
    count = 0
    for i in range(rows.shape[0]):
        count += rows[i].score >= bar
    return (bar if count <= _MOST_JUMPING else math.inf), lead


@njit(cache=True, error_model="numpy")
def moment_at(headings: NDArray[Any], places: NDArray[Any], step: float, t: int) -> Moment:
    """What is known of the step that ends at sample ``t``: heading there and on the way, length, place (weight 0: none)."""
    return headings[t], 0.5 * (headings[t - 1] + headings[t]), step, places[t, 0], places[t, 1], places[t, 2]
