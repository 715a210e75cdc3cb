"""Memory of places while mapping: stored views, the graph that joins them, and the recognition of a place seen before.

A view waits before it is stored. In the meantime the views that follow may recognise their place, and then, walking back along
the path that led there, its own: such a visit shares the old cell. Recent views are no candidates, so waiting costs nothing.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from hippodrome.core.types import Float32Array, ViewCells
from hippodrome.core.views import descriptors as view_cells
from hippodrome.core.views.descriptors import Descriptor, ViewCellBank, ViewCellConfig
from hippodrome.core.views.graph import CellGraph
from hippodrome.core.views.peaks import peak_of_values, peak_shift
from hippodrome.core.views.sequence import (
    NO_EVIDENCE,
    Evidence,
    Peak,
    SequenceConfig,
    filter_step,
    peak,
    standardise,
)


@dataclass(frozen=True)
class PlaceMemoryConfig:
    """When a view counts as a place seen before."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    view_cells: ViewCellConfig = field(default_factory=ViewCellConfig)
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    start_margin: float = 4.0  # filtered, on meeting an old road: bends look alike, and a wrong closure breeds more of them
    closure_margin: float = 2.0  # filtered, once on it
    waiting_views: int = 16  # before a view is stored: the loop around the smallest block is longer
    support_z: float = 3.0  # what the view itself must say: the filter runs on past a junction, and back before one
    column_rad: float = 0.1  # heading per column of shift, between the mean (fov / columns) and the centre of a 90 deg image

    def __post_init__(self) -> None:
        if not 0.0 < self.closure_margin <= self.start_margin:
            raise ValueError("place memory: 0 < closure_margin <= start_margin is required")
        if self.waiting_views < 1 or self.column_rad <= 0.0:
            raise ValueError("place memory: waiting_views and column_rad must be positive")


@dataclass(frozen=True, slots=True)
class Recognition:
    """A visit's place is one seen before."""

    vertex: int  # the visit
    cell: int
    margin: float  # of the view that settled it
    along: float  # where the visit is, seen from the place where the cell was made; map units
    heading_rad: float


@dataclass(slots=True, eq=False)
class _Waiting:
    """A view that is not stored yet."""

    vertex: int
    descriptor: Descriptor
    travelled: float
    turned_rad: float
    scores: Float32Array  # (C, shifts) against the cells of its time
    evidence: Evidence
    cell: int = -1  # recognised


class PlaceMemory:
    """Cells, their graph and the running evidence; ``recognise`` one view after the other."""

    def __init__(self, config: PlaceMemoryConfig) -> None:
        size = int(np.prod(config.view_cells.shape))
        self._config = config
        self._graph = CellGraph()
        self._views = _ViewStore(config.view_cells)
        self._query_mean = view_cells.start_query_mean(np.zeros(size, dtype=np.float32))
        self._waiting: deque[_Waiting] = deque()
        self._last_cell = -1
        self.vertex_cell: list[int] = []  # (V,) of the visits stored so far
        self.cell_vertex: list[int] = []  # (C,) the visit that made each cell

    @property
    def can_recognise(self) -> bool:
        """Whether enough places are stored to tell one from the others."""
        return len(self.cell_vertex) >= self._config.sequence.min_cells

    def recognise(
        self, vertex: int, descriptor: Descriptor, travelled: float, turned_rad: float, spacing: float
    ) -> list[Recognition]:
        """The visit's own recognition last, after those of earlier visits that it settles; empty: new, or not sure yet."""
        sequence = self._config.sequence
        self._query_mean = view_cells.update_query_mean(self._query_mean, descriptor, self._config.view_cells)
        scores = view_cells.score(self._views.bank, descriptor, self._query_mean, self._config.view_cells)
        floor = sequence.sigma_floor if self._config.view_cells.kind == "gradient" else sequence.grey_sigma_floor
        z = standardise(scores.max(axis=1), sequence.min_cells, floor)
        before = self._waiting[-1].evidence if self._waiting else NO_EVIDENCE
        evidence = filter_step(before, z, self._graph.links, travelled, turned_rad, spacing, sequence)
        self._waiting.append(_Waiting(vertex, descriptor, travelled, turned_rad, scores, evidence))
        best = peak(evidence, self._graph.links, sequence.neighbourhood * spacing)
        found = self._trace(best) if best.margin >= self._needed_margin(best) else []
        if len(self._waiting) > self._config.waiting_views:
            self._store(spacing)
        return found

    def finish(self, spacing: float) -> ViewCells:
        """Store what still waits; the cells of the finished map."""
        while self._waiting:
            self._store(spacing)
        config, templates = self._config.view_cells, self._views.bank.templates
        return ViewCells(config.kind, templates.copy(), view_cells.template_mean(config.kind, templates), config.shape)

    def _needed_margin(self, best: Peak) -> float:
        """Less on a road that the views before have recognised, where the path leads from their cell to this one."""
        latest = self._waiting[-1]
        came_from = latest.evidence.predecessor[best.cell] if best.cell >= 0 else -1
        continues = came_from >= 0 and len(self._waiting) > 1 and self._waiting[-2].cell == came_from
        return self._config.closure_margin if continues else self._config.start_margin

    def _trace(self, best: Peak) -> list[Recognition]:
        """The latest view's recognition, and those of waiting views on the path that led to it."""
        found, cell = [], best.cell
        for view in reversed(self._waiting):
            known = 0 <= cell < len(view.evidence.z_score) and view.cell < 0
            if not known or view.evidence.z_score[cell] < self._config.support_z:
                break
            view.cell = cell
            found.append(self._recognition(view, best.margin))
            cell = int(view.evidence.predecessor[cell])
        return found[::-1]

    def _recognition(self, view: _Waiting, margin: float) -> Recognition:
        shift = peak_shift(view.scores[view.cell])
        along = self._along(view)
        return Recognition(view.vertex, view.cell, margin, along, -shift * self._config.column_rad)

    def _along(self, view: _Waiting) -> float:
        """Offset along the track: the parabola through the scores of the cell, the one before and the one after."""
        links, best = self._graph.links, view.scores.max(axis=1)
        into, out_of = int(links.last_in[view.cell]), int(links.last_out[view.cell])
        if into < 0 or out_of < 0:
            return 0.0
        behind, ahead = -links.length[into], links.length[out_of]
        before, after = int(links.source[into]), int(links.target[out_of])
        if max(before, after) >= len(best) or min(-behind, ahead) <= 0.0:
            return 0.0
        return peak_of_values(behind, best[before], best[view.cell], ahead, best[after])

    def _store(self, spacing: float) -> None:
        view = self._waiting.popleft()
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


class _ViewStore:
    """Stored templates in one growing block; the common mean is renewed whenever their number has grown by a quarter."""

    def __init__(self, config: ViewCellConfig) -> None:
        dtype: type[np.integer[Any]] = np.int8 if config.kind == "gradient" else np.uint8
        self._config, self._count, self._renew_at = config, 0, 1
        self._templates = np.zeros((64, int(np.prod(config.shape))), dtype=dtype)
        nothing = np.zeros(self._templates.shape[1], dtype=np.float32)
        self.bank = view_cells.make_bank(config.kind, config.shape, self._templates[:0], nothing)

    def append(self, descriptor: Descriptor) -> None:
        if self._count == len(self._templates):
            self._templates = np.concatenate([self._templates, np.zeros_like(self._templates)])
        self._templates[self._count] = descriptor
        self._count += 1
        stored, kind, shape = self._templates[: self._count], self._config.kind, self._config.shape
        if self._count >= self._renew_at:
            self._renew_at = self._count + max(1, self._count // 4)
            self.bank = view_cells.make_bank(kind, shape, stored, view_cells.template_mean(kind, stored))
            return
        newest = view_cells.make_bank(kind, shape, stored[-1:], self.bank.mean)
        inverse_norm = np.concatenate([self.bank.inverse_norm, newest.inverse_norm])
        self.bank = ViewCellBank(kind, shape, stored, self.bank.mean, inverse_norm)
