"""The graph of view cells: which cell follows which, how far ahead and after how much of a turn.

It grows with the visit sequence. A visit that shares a cell with an earlier one joins the two paths there, so that walks along
the graph go across loop closures. Lengths are in the caller's unit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, IntArray

WALK_LIMIT = 64  # most cells within one walk: some three spacings at a junction that was visited many times
SAME_PATH = 0.1  # a cell reached twice by lengths that differ by less than this share was reached along the same path


class Links(NamedTuple):
    """L directed links between C cells, as linked lists: a link is added in constant time, and compiled code can walk them."""

    last_in: IntArray  # (C,) newest link into each cell, -1: none
    last_out: IntArray  # (C,) newest link out of each cell, -1: none
    source: IntArray  # (L,) cell at which the link begins
    target: IntArray  # (L,) cell at which the link ends
    next_in: IntArray  # (L,) next older link into the same target, -1: none
    next_out: IntArray  # (L,) next older link out of the same source, -1: none
    length: FloatArray  # (L,)
    turn_rad: FloatArray  # (L,) heading change from source to target


class Paths(NamedTuple):
    """K paths along the graph, each by the cell at which it begins. Where they end is the holder's to say."""

    source: IntArray  # (K,)
    length: FloatArray  # (K,)
    turn_rad: FloatArray  # (K,) heading change along the path


class Predecessors(NamedTuple):
    """Paths that lead to each of C cells, in CSR form: those to cell ``j`` are ``start[j]`` to ``start[j + 1]``."""

    start: IntArray  # (C + 1,)
    paths: Paths


class CellGraph:
    """The growing graph: ``add_cell`` and ``link`` extend it, ``links`` reads it."""

    def __init__(self) -> None:
        self.cell_count = 0
        self._link_count = 0
        self._links = _empty_links(64, 64)

    @property
    def links(self) -> Links:
        """All links so far. The arrays share memory with the graph and must not be written to."""
        return _first_of(self._links, self.cell_count, self._link_count)

    def add_cell(self) -> int:
        """Add a cell without links; returns its number."""
        if self.cell_count == len(self._links.last_in):
            self._links = _copied_into(_empty_links(2 * self.cell_count, len(self._links.source)), self.links)
        self.cell_count += 1
        return self.cell_count - 1

    def link(self, source: int, target: int, length: float, turn_rad: float) -> None:
        """Add the path from ``source`` to ``target`` that was just driven: it becomes the newest link of both cells."""
        if self._link_count == len(self._links.source):
            self._links = _copied_into(_empty_links(len(self._links.last_in), 2 * self._link_count), self.links)
        arrays, new = self._links, self._link_count
        arrays.source[new], arrays.target[new] = source, target
        arrays.length[new], arrays.turn_rad[new] = length, turn_rad
        arrays.next_in[new], arrays.next_out[new] = arrays.last_in[target], arrays.last_out[source]
        arrays.last_in[target] = arrays.last_out[source] = new
        self._link_count += 1

    def joins(self, source: int, target: int, length: float, tolerance: float) -> bool:
        """Whether a path of this length, within ``tolerance``, leads from ``source`` to ``target`` already.

        Such a path need not be added again.
        """
        paths = walk_back(self.links, target, length + tolerance)
        return bool(np.any((paths.source == source) & (np.abs(paths.length - length) <= tolerance)))


def graph_of(cells: IntArray, lengths: FloatArray, turns_rad: FloatArray, tolerance: float) -> CellGraph:
    """The graph of a finished visit sequence.

    Args:
        cells: the cell of each visit (S,).
        lengths: path length since the visit before (S,); row 0 is not used.
        turns_rad: turn since the visit before (S,); row 0 is not used.
        tolerance: a path that exists already, its length within this, is not added again.
    """
    graph = CellGraph()
    for _ in range(int(cells.max(initial=-1)) + 1):
        graph.add_cell()
    for before, cell, length, turn_rad in zip(cells[:-1], cells[1:], lengths[1:], turns_rad[1:], strict=True):
        if not graph.joins(int(before), int(cell), float(length), tolerance):
            graph.link(int(before), int(cell), float(length), float(turn_rad))
    return graph


def _empty_links(cells: int, links: int) -> Links:
    """Allocate room for so many cells and links. All indices are -1, which means that there is no link."""

    def unset(size: int) -> IntArray:
        return np.full(size, -1, dtype=np.int32)

    return Links(
        unset(cells), unset(cells), unset(links), unset(links), unset(links), unset(links), np.zeros(links), np.zeros(links)
    )  # fmt: skip


def _first_of(links: Links, cells: int, count: int) -> Links:
    """The first ``cells`` cells and the first ``count`` links, as slices that share memory with ``links``."""
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


def _copied_into(larger: Links, links: Links) -> Links:
    """Copy the cells and links of ``links`` into the first places of ``larger``, in place; returns ``larger``."""
    first = _first_of(larger, len(links.last_in), len(links.source))
    for name in Links._fields:
        getattr(first, name)[:] = getattr(links, name)
    return larger


def walk_back(links: Links, start: int, reach: float) -> Paths:
    """The paths no longer than ``reach`` that lead to ``start``, at most WALK_LIMIT; the first is ``start`` itself, length 0."""
    return Paths(*_walk_back(links, start, reach))


@njit(cache=True)
def _walk_back(links: Links, start: int, reach: float) -> tuple[IntArray, FloatArray, FloatArray]:
    """The compiled part of ``walk_back``; the fields of its result."""
    walk = empty_walk()
    count = walk_back_into(walk, links, start, reach)
    return walk.source[:count], walk.length[:count], walk.turn_rad[:count]


@njit(cache=True)
def empty_walk() -> Paths:
    """Room for WALK_LIMIT paths, which ``walk_back_into`` fills."""
    return Paths(np.empty(WALK_LIMIT, dtype=np.int32), np.empty(WALK_LIMIT), np.empty(WALK_LIMIT))


@njit(cache=True)
def walk_back_into(walk: Paths, links: Links, start: int, reach: float) -> int:
    """Write the paths of ``walk_back`` into ``walk``, breadth first; returns how many there are.

    So ``walk`` can be used for many cells, which saves its allocation for each of them.
    """
    walk.source[0], walk.length[0], walk.turn_rad[0] = start, 0.0, 0.0
    count, at = 1, 0
    while at < count:
        link = links.last_in[walk.source[at]]
        while link >= 0:
            length = walk.length[at] + links.length[link]
            if length <= reach and count < WALK_LIMIT and not _holds(walk, count, links.source[link], length):
                walk.source[count], walk.length[count] = links.source[link], length
                walk.turn_rad[count] = walk.turn_rad[at] + links.turn_rad[link]
                count += 1
            link = links.next_in[link]
        at += 1
    return count


@njit(cache=True)
def _holds(walk: Paths, count: int, cell: int, length: float) -> bool:
    """Whether one of the first ``count`` paths begins at this cell and is about as long: the same path found twice."""
    for k in range(count):  # noqa: SIM110 (numba)
        if walk.source[k] == cell and abs(walk.length[k] - length) <= SAME_PATH * length:
            return True
    return False


@njit(cache=True)
def neighbourhood(links: Links, start: int, reach: float) -> NDArray[np.bool_]:
    """Mask (C,) of the cells within ``reach`` of ``start`` along links in either direction, which show about the same place.

    A cell is looked at again whenever a shorter path to it is found.
    """
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
