"""The graph of view cells: which cell follows which, how far ahead and after how much of a turn.

It grows with the visit sequence. A visit that shares a cell with an earlier one joins both paths there, so walks along the graph
go across loop closures. Lengths are in the caller's unit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray, IntArray

WALK_LIMIT = 64  # cells within one walk: some three spacings at a junction of many visits


class Links(NamedTuple):
    """Directed links between cells as linked lists: O(1) to grow, and numba walks them."""

    last_in: IntArray  # (C,) newest link into a cell, -1: none
    last_out: IntArray  # (C,)
    source: IntArray  # (L,)
    target: IntArray  # (L,)
    next_in: IntArray  # (L,) older link into the same target
    next_out: IntArray  # (L,) older link out of the same source
    length: FloatArray  # (L,)
    turn_rad: FloatArray  # (L,) heading change from source to target


class CellGraph:
    """Grows by ``add_cell`` and ``link``; read through ``links``."""

    def __init__(self) -> None:
        self.cell_count = 0
        self._link_count = 0
        self._links = _room_for(64, 64)

    @property
    def links(self) -> Links:
        """Everything so far; the arrays are views and must not be written to."""
        return _cut(self._links, self.cell_count, self._link_count)

    def add_cell(self) -> int:
        """A new cell without links; returns its number."""
        if self.cell_count == len(self._links.last_in):
            self._links = _moved(self.links, _room_for(2 * self.cell_count, len(self._links.source)))
        self.cell_count += 1
        return self.cell_count - 1

    def link(self, source: int, target: int, length: float, turn_rad: float) -> None:
        """The path from ``source`` to ``target`` that was just driven."""
        if self._link_count == len(self._links.source):
            self._links = _moved(self.links, _room_for(len(self._links.last_in), 2 * self._link_count))
        arrays, new = self._links, self._link_count
        arrays.source[new], arrays.target[new] = source, target
        arrays.length[new], arrays.turn_rad[new] = length, turn_rad
        arrays.next_in[new], arrays.next_out[new] = arrays.last_in[target], arrays.last_out[source]
        arrays.last_in[target] = arrays.last_out[source] = new
        self._link_count += 1

    def joins(self, source: int, target: int, length: float, tolerance: float) -> bool:
        """Whether a path of about this length leads from ``source`` to ``target`` already."""
        cells, lengths, _ = walk_back(self.links, target, length + tolerance)
        return bool(np.any((cells == source) & (np.abs(lengths - length) <= tolerance)))


def graph_of(cells: IntArray, lengths: FloatArray, turns_rad: FloatArray, tolerance: float) -> CellGraph:
    """The graph of a finished visit sequence (S,): the cell of each visit, travel and turn since the visit before."""
    graph = CellGraph()
    for _ in range(int(cells.max(initial=-1)) + 1):
        graph.add_cell()
    for before, cell, length, turn_rad in zip(cells[:-1], cells[1:], lengths[1:], turns_rad[1:], strict=True):
        if not graph.joins(int(before), int(cell), float(length), tolerance):
            graph.link(int(before), int(cell), float(length), float(turn_rad))
    return graph


def _room_for(cells: int, links: int) -> Links:
    def none(size: int) -> IntArray:
        return np.full(size, -1, dtype=np.int32)

    return Links(
        none(cells), none(cells), none(links), none(links), none(links), none(links), np.zeros(links), np.zeros(links)
    )  # fmt: skip


def _cut(links: Links, cells: int, count: int) -> Links:
    return Links(
        last_in=links.last_in[:cells],
        last_out=links.last_out[:cells],
        source=links.source[:count],
        target=links.target[:count],
        next_in=links.next_in[:count],
        next_out=links.next_out[:count],
        length=links.length[:count],
        turn_rad=links.turn_rad[:count],
    )


def _moved(links: Links, room: Links) -> Links:
    """``room`` filled with ``links``."""
    start = _cut(room, len(links.last_in), len(links.source))
    for name in Links._fields:
        getattr(start, name)[:] = getattr(links, name)
    return room


@njit(cache=True)
def walk_back(links: Links, start: int, reach: float) -> tuple[IntArray, FloatArray, FloatArray]:
    """Cells (K,) from which ``start`` is reached within ``reach``, the path's length and turn (K,); first ``start`` itself."""
    cells, lengths, turns = np.empty(WALK_LIMIT, dtype=np.int32), np.empty(WALK_LIMIT), np.empty(WALK_LIMIT)
    count = walk_back_into(links, start, reach, cells, lengths, turns)
    return cells[:count], lengths[:count], turns[:count]


@njit(cache=True)
def walk_back_into(links: Links, start: int, reach: float, cells: IntArray, lengths: FloatArray, turns: FloatArray) -> int:
    """``walk_back`` into buffers of WALK_LIMIT; returns how many entries are valid."""
    cells[0], lengths[0], turns[0] = start, 0.0, 0.0
    count, at = 1, 0
    while at < count:
        link = links.last_in[cells[at]]
        while link >= 0:
            length = lengths[at] + links.length[link]
            if length <= reach and count < WALK_LIMIT and not _holds(cells, lengths, count, links.source[link], length):
                cells[count], lengths[count] = links.source[link], length
                turns[count] = turns[at] + links.turn_rad[link]
                count += 1
            link = links.next_in[link]
        at += 1
    return count


@njit(cache=True)
def _holds(cells: IntArray, lengths: FloatArray, count: int, cell: int, length: float) -> bool:
    """Whether a walk came by this cell at about this length before (the same path found twice)."""
    for k in range(count):  # noqa: SIM110 (numba)
        if cells[k] == cell and abs(lengths[k] - length) <= 0.1 * length:
            return True
    return False


@njit(cache=True)
def neighbourhood(links: Links, start: int, reach: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Mask (C,) of the cells within ``reach`` of ``start`` along links in either direction."""
    inside = np.zeros(len(links.last_in), dtype=np.bool_)
    distance = np.full(len(links.last_in), np.inf)
    distance[start] = 0.0
    inside[start] = True
    queue = [start]
    while len(queue) > 0:
        cell = queue.pop(0)
        for forward in (True, False):
            link = links.last_out[cell] if forward else links.last_in[cell]
            while link >= 0:
                other = links.target[link] if forward else links.source[link]
                length = distance[cell] + links.length[link]
                if length <= reach and length < distance[other]:
                    distance[other] = length
                    inside[other] = True
                    queue.append(other)
                link = links.next_out[link] if forward else links.next_in[link]
    return inside
