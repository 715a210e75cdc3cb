"""The passes of the search over a whole drive, in bounded memory.

The forward pass keeps its survivors at checkpoints only. The backward pass, last stretch first, makes each stretch's survivors
anew from its checkpoint, so that the answer is that of one search over the whole drive; a drive of one stretch is searched once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.matching.search import beam as route_kernel
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.hypotheses import Rows
from hippodrome.core.matching.search.problem import KernelArguments, SearchField, Seeds
from hippodrome.core.types import Float32Array, FloatArray, IntArray

_MOST_ROWS = 8_000_000  # of a stretch: 200 MB
_EXACT_NATS = 4000.0  # scores below this are counted from a new zero: their steps would be rounded to 0.0005 and more
_CELL_M = 8.0  # of a lane: alternatives closer than this are one


class Found(NamedTuple):
    """The best route's rows and places, and its alternatives; see ``RouteAlternatives``."""

    rows: Rows  # (T,)
    places_m: FloatArray  # (T, 2)
    score_nats: FloatArray  # (T,) log likelihood up to each sample
    row_start: NDArray[np.int64]
    points_m: Float32Array
    through_nats: Float32Array


class _Stretch(NamedTuple):
    first: int  # sample that its seeds belong to
    last: int  # .. and where the next stretch begins
    seeds: Seeds
    score_nats: float  # what was taken off the seeds' scores, so that small differences stay exact


def survivors_from(
    arguments: KernelArguments, seeds: Seeds, beam_nats: float, most: int, enough: int = 0
) -> route_kernel.Survivors:
    """One forward pass, ended early once ``enough`` are left or ``_MOST_ROWS`` are reached."""
    limits = beam_nats, most, enough, max(_MOST_ROWS, 4 * len(seeds.rows))
    survivors: route_kernel.Survivors = route_kernel.forward(*arguments, limits, *seeds)
    return survivors


def best_through(field: SearchField, arguments: KernelArguments, seeds: Seeds, config: RouteSearchConfig) -> Found | None:
    """The most likely route from ``seeds`` over the whole drive; None where none is as long."""
    stretches: list[_Stretch] = []
    first, taken_off, samples = 0, 0.0, len(arguments.heading_rad)
    while len(seeds.rows):
        survivors = survivors_from(_between(arguments, first, samples), seeds, config.beam_nats, config.most_survivors)
        last = first + len(survivors[0]) - 2
        stretches.append(_Stretch(first, last, seeds, taken_off))
        if last == samples - 1:
            return _traced(field, arguments, stretches, survivors, config)
        if last == first:
            break
        seeds = last_of(survivors)
        best = seeds.rows["score"].max()
        best = best if best < -_EXACT_NATS else np.float32(0.0)
        seeds.rows["score"] -= best
        first, taken_off = last, taken_off + float(best)
    return None


def last_of(survivors: route_kernel.Survivors) -> Seeds:
    """The survivors of the last step, as seeds of a further search."""
    row_start, rows, off_rows = survivors
    last = rows[row_start[-2] : row_start[-1]].copy()
    off = last["bin"] < 0
    places = off_rows[-1 - last["bin"][off]]
    last["bin"][off] = -1 - np.arange(len(places))
    return Seeds(last, places)


def _between(arguments: KernelArguments, first: int, end: int) -> KernelArguments:
    return arguments._replace(heading_rad=arguments.heading_rad[first:end], places=arguments.places[first:end])


def _traced(
    field: SearchField,
    arguments: KernelArguments,
    stretches: list[_Stretch],
    survivors: route_kernel.Survivors,
    config: RouteSearchConfig,
) -> Found:
    """The backward pass, over the survivors of the last stretch and those of the others, made anew."""
    cell = _cells(field)
    end_rows = last_of(survivors).rows
    end, onward = int(np.argmax(end_rows["score"])), np.zeros(len(end_rows), np.float32)
    parts: list[Found] = []
    for stretch in reversed(stretches):
        own = _between(arguments, stretch.first, stretch.last + 1)
        if parts:
            survivors = survivors_from(own, stretch.seeds, config.beam_nats, config.most_survivors)
        through = route_kernel.backward(*own, config.margin_nats, survivors, onward)
        row = _trace(survivors, end)
        alternatives = route_kernel.alternatives(survivors, through, field.graph.points_m, cell)
        parts.append(_part(field, survivors, row, stretch.score_nats, alternatives))
        end, onward = int(row[0]), through[: len(stretch.seeds.rows)] - stretch.seeds.rows["score"]
    return _joined(parts[::-1])


def _trace(survivors: route_kernel.Survivors, end: int) -> IntArray:
    """Rows (t,) of the route that ends in the ``end``-th survivor of the last step."""
    row_start, parent = survivors[0], survivors[1]["parent"]
    row = np.empty(len(row_start) - 1, np.int32)
    row[-1] = row_start[-2] + end
    for t in range(len(row) - 1, 0, -1):
        row[t - 1] = parent[row[t]]
    return row


def _part(
    field: SearchField,
    survivors: route_kernel.Survivors,
    row: IntArray,
    score_nats: float,
    alternatives: tuple[NDArray[np.int64], Float32Array, Float32Array],
) -> Found:
    _, rows, off_rows = survivors
    best = rows[row].copy()
    off = best["bin"] < 0
    places = field.graph.points_m[np.maximum(best["bin"], 0)].astype(np.float64)
    there = off_rows[-1 - best["bin"][off]]
    places[off] = np.column_stack([there["x"], there["y"]])
    return Found(best, places, best["score"] + score_nats, *alternatives)


def _joined(parts: list[Found]) -> Found:
    """One after the other; the last sample of each is the first of the next."""
    whole = parts[-1]
    for part in parts[-2::-1]:
        kept = part.row_start[-2]
        whole = Found(
            np.concatenate([part.rows[:-1], whole.rows]),
            np.concatenate([part.places_m[:-1], whole.places_m]),
            np.concatenate([part.score_nats[:-1], whole.score_nats]),
            np.concatenate([part.row_start[:-2], whole.row_start + kept]),
            np.concatenate([part.points_m[:kept], whole.points_m]),
            np.concatenate([part.through_nats[:kept], whole.through_nats]),
        )
    return whole


def _cells(field: SearchField) -> IntArray:
    """Cell (N,) of each bin: stretches of about ``_CELL_M`` of one lane."""
    graph = field.graph
    start = graph.lane_start[graph.lane]
    cells: IntArray = start + (np.arange(graph.bin_count, dtype=np.int32) - start) // max(round(_CELL_M / field.bin_m), 1)
    return cells
