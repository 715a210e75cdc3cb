"""Memory of places while mapping: is the place of a keyframe one seen before?

Stored views are the nodes of a graph, whose links are the paths driven between them. A keyframe's view is scored against all
stored ones and the scores are filtered along the graph (``views.sequence``). Where a place stands out far enough, the keyframe
shares its view cell in place of storing its own view.

A view is *pending* for some keyframes before it is stored. When a later keyframe recognises its place, the path of best evidence
that led there tells the places of the pending keyframes before it, too. As places driven by a moment ago are no candidates for a
loop closure anyway, nothing is lost by the delay.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from hippodrome.core.mapping.config import PlaceMemoryConfig
from hippodrome.core.mapping.view_store import ViewStore
from hippodrome.core.types import Float32Array, ViewCells
from hippodrome.core.views.descriptors import Descriptor
from hippodrome.core.views.graph import CellGraph
from hippodrome.core.views.peaks import peak_of_values, peak_shift
from hippodrome.core.views.scoring import score, start_query_mean, update_query_mean
from hippodrome.core.views.sequence import NO_EVIDENCE, Evidence, Peak, filter_step, peak, standardise


@dataclass(frozen=True, slots=True)
class Recognition:
    """The place of a keyframe is one seen before."""

    vertex: int  # the keyframe's vertex
    cell: int  # view cell of the place
    margin: float  # filtered margin of the view that triggered this recognition
    along: float  # map units that the keyframe lies ahead of the vertex that made the cell
    heading_rad: float  # heading of the keyframe, seen from that vertex


@dataclass(slots=True, eq=False)
class _PendingView:
    """The view of a keyframe that is not stored yet, and all that a recognition in retrospect needs."""

    vertex: int
    descriptor: Descriptor
    travelled: float  # since the keyframe before, map units
    turned_rad: float  # since the keyframe before
    scores: Float32Array  # (C, shifts) against the cells stored at that time
    evidence: Evidence
    cell: int = -1  # the cell that the view was recognised as; -1: none, so that it will get one of its own


class PlaceMemory:
    """View cells, the graph that joins them, and the running evidence: ``recognise`` one keyframe after the other."""

    def __init__(self, config: PlaceMemoryConfig) -> None:
        size = int(np.prod(config.view_cells.shape))
        self._config = config
        self._graph = CellGraph()
        self._views = ViewStore(config.view_cells)
        self._query_mean = start_query_mean(np.zeros(size, dtype=np.float32))
        self._pending: deque[_PendingView] = deque()
        self._last_cell = -1  # cell of the keyframe stored last
        self.vertex_cell: list[int] = []  # (V,) the cell of each vertex stored so far
        self.cell_vertex: list[int] = []  # (C,) the vertex that made each cell

    @property
    def can_recognise(self) -> bool:
        """Whether enough places are stored to tell one from the others."""
        return len(self.cell_vertex) >= self._config.sequence.min_cells

    def recognise(
        self, vertex: int, descriptor: Descriptor, travelled: float, turned_rad: float, spacing: float
    ) -> list[Recognition]:
        """Recognise the place of a new keyframe, and of pending ones before it, if they were seen before.

        The view of the keyframe is pending afterwards: it is stored only some keyframes later.

        Args:
            vertex: number of the keyframe's vertex; numbers count up.
            descriptor: the keyframe's view, (D,).
            travelled: distance driven since the keyframe before, map units.
            turned_rad: turn since the keyframe before.
            spacing: present distance between two keyframes on a straight road, map units.

        Returns:
            The recognitions that this view triggers, in the order of the vertices: those of pending keyframes on the path that
            led here, and last that of this keyframe itself. Empty where its place is new, or not certain yet.
        """
        self._query_mean = update_query_mean(self._query_mean, descriptor, self._config.view_cells)
        scores = score(self._views.bank, descriptor, self._query_mean, self._config.view_cells)
        evidence = self._filtered_evidence(scores, travelled, turned_rad, spacing)
        self._pending.append(_PendingView(vertex, descriptor, travelled, turned_rad, scores, evidence))
        best = peak(evidence, self._graph.links, self._config.sequence.neighbourhood * spacing)
        found = self._trace_back(best) if best.margin >= self._needed_margin(best) else []
        if len(self._pending) > self._config.waiting_views:
            self._store_oldest(spacing)
        return found

    def finish(self, spacing: float) -> ViewCells:
        """Store the views that are still pending; returns the view cells of the finished map."""
        while self._pending:
            self._store_oldest(spacing)
        return self._views.finished()

    def _filtered_evidence(self, scores: Float32Array, travelled: float, turned_rad: float, spacing: float) -> Evidence:
        """Sequence evidence for all cells after a new view: its scores (C, shifts) as z-scores, plus the evidence before it."""
        sequence = self._config.sequence
        floor = sequence.sigma_floor if self._config.view_cells.kind == "gradient" else sequence.grey_sigma_floor
        z = standardise(scores.max(axis=1), sequence.min_cells, floor)
        before = self._pending[-1].evidence if self._pending else NO_EVIDENCE
        return filter_step(before, z, self._graph.links, travelled, turned_rad, spacing, sequence)

    def _needed_margin(self, best: Peak) -> float:
        """The margin that the best cell needs: less where the keyframe before was recognised and its cell leads to the best."""
        latest = self._pending[-1]
        came_from = latest.evidence.predecessor[best.cell] if best.cell >= 0 else -1
        continues = came_from >= 0 and len(self._pending) > 1 and self._pending[-2].cell == came_from
        return self._config.closure_margin if continues else self._config.start_margin

    def _trace_back(self, best: Peak) -> list[Recognition]:
        """Recognise the latest view as the best cell, and the pending views before it as the cells on the path that led there.

        The path ends at a view that was recognised before, or whose own z-score does not support the cell. The cells are noted in
        the pending views.
        """
        found, cell = [], best.cell
        for view in reversed(self._pending):
            known = 0 <= cell < len(view.evidence.z_score) and view.cell < 0
            if not known or view.evidence.z_score[cell] < self._config.support_z:
                break
            view.cell = cell
            found.append(self._recognition(view, best.margin))
            cell = int(view.evidence.predecessor[cell])
        return found[::-1]

    def _recognition(self, view: _PendingView, margin: float) -> Recognition:
        """The recognition of a view as its cell, with where it was taken relative to the cell's view.

        The sideways shift at which the two agree best gives the heading: a view that looks further right has its heading to the
        right.
        """
        shift = peak_shift(view.scores[view.cell])
        along = self._along(view)
        return Recognition(view.vertex, view.cell, margin, along, -shift * self._config.column_rad)

    def _along(self, view: _PendingView) -> float:
        """How far, in map units, a view lies ahead of its cell along the road, more finely than cells are spaced.

        It is the place at which the parabola through the scores of three cells peaks: the cell, the one before it and the one
        after it on the road. It is 0 where one of them is missing.
        """
        links, best = self._graph.links, view.scores.max(axis=1)
        into, out_of = int(links.last_in[view.cell]), int(links.last_out[view.cell])
        if into < 0 or out_of < 0:
            return 0.0
        behind, ahead = -links.length[into], links.length[out_of]
        before, after = int(links.source[into]), int(links.target[out_of])
        if max(before, after) >= len(best) or min(-behind, ahead) <= 0.0:
            return 0.0
        return peak_of_values(behind, best[before], best[view.cell], ahead, best[after])

    def _store_oldest(self, spacing: float) -> None:
        """Store the oldest pending view and link its cell to the cell of the keyframe before.

        A view that was recognised shares the cell that it was recognised as; any other becomes a cell of its own.
        """
        view = self._pending.popleft()
        cell, tolerance = view.cell, self._config.sequence.length_tolerance * spacing
        if cell < 0:
            cell = self._graph.add_cell()
            self._views.append(view.descriptor)
            self.cell_vertex.append(view.vertex)
        last = self._last_cell
        if last >= 0 and not self._graph.joins(last, cell, view.travelled, tolerance):
            self._graph.link(last, cell, view.travelled, view.turned_rad)
        self.vertex_cell.append(cell)
        self._last_cell = cell
