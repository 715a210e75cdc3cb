"""Place recognition in a topometric map: each query frame is scored against the view cells, the scores are filtered along paths.

No pose is believed here: what comes out is the cell that stands out, and by how much. The localizer makes poses of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.places import PlaceMap, interpolated_pose, likely_cells, margin
from hippodrome.core.types import Float32Array, FloatArray, Frame, HippodromeError, IntArray
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.index import ScoredViews, index_of, search
from hippodrome.core.views.scoring import start_query_mean, update_query_mean
from hippodrome.core.views.sequence import Step, propagate

NO_CELLS: IntArray = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMatch:
    """What one query frame shows."""

    scored: ScoredViews  # the cells that the frame was scored against, and their similarities
    cell: int  # the cell with the most evidence after filtering
    margin: float  # how far its evidence stands out from that of the best cell elsewhere


class PlaceRecogniser:
    """Give it the query frames of a drive in order. With ``sequence.memory`` 0 each frame stands alone.

    Raises:
        HippodromeError: the localizer's view cells are not of the kind and shape of the map's.
    """

    def __init__(self, places: PlaceMap, config: LocalizerConfig) -> None:
        own, mapped = (config.views.kind, config.views.shape), (places.bank.kind, tuple(places.bank.shape))
        if own != mapped:
            raise HippodromeError(
                f"the map's view cells are {mapped[0]} of shape {mapped[1]}, the localizer's {own[0]} of shape {own[1]}: "
                "give `localizer.views` the values that `mapper.memory.view_cells` had"
            )
        self._places, self._config = places, config
        self._spread_floor = config.sequence.floor(places.bank.kind)
        self._tolerance = Step(config.step_tolerance_m, config.sequence.turn_tolerance_rad)
        self._index = index_of(places.bank, config.search)
        self._filtered: Float32Array = np.zeros(len(places.poses_m), dtype=np.float32)
        self._query_mean = start_query_mean(places.bank.mean, config.mean_trust)

    def recognise(self, frame: Frame, driven: Step, believed: IntArray = NO_CELLS) -> PlaceMatch:
        """Find the place that a query frame shows.

        Args:
            frame: the query frame.
            driven: motion since the query frame before; its length in metres.
            believed: cells of the believed place, which are scored even if their sketches do not resemble the frame.
        """
        config, places = self._config, self._places
        descriptor = describe(frame, config.views)
        self._query_mean = update_query_mean(self._query_mean, descriptor, config.views)
        candidates = believed
        if self._index is not None:
            candidates = np.concatenate([likely_cells(places, self._filtered, config.search.hypotheses), believed])
        query = descriptor, self._query_mean
        scored = search(places.bank, self._index, candidates, query, config.views, config.search)
        self._filtered = self._evidence(scored, driven)
        cell = int(np.argmax(self._filtered))
        return PlaceMatch(scored, cell, margin(places, self._filtered, cell))

    def z_score(self, scored: ScoredViews, similarity: Float32Array | float) -> Float32Array | float:
        """How many standard deviations a similarity lies above the mean, both taken over all cells of the map."""
        return (similarity - scored.mean) / max(scored.spread, self._spread_floor)

    def pose(self, match: PlaceMatch) -> FloatArray:
        """Pose (3,) in metres and rad at which the query frame was taken, judged by the recognised cell and its two neighbours.

        The pose is interpolated between the cells by their similarities to the frame.
        """
        similarity = np.full(len(self._places.poses_m), np.nan, dtype=np.float32)
        similarity[match.scored.cells] = match.scored.similarity
        return interpolated_pose(self._places, similarity, match.cell)

    def _evidence(self, scored: ScoredViews, driven: Step) -> Float32Array:
        """Sequence evidence (C,) after a query frame; on a map of fewer than ``min_cells`` cells all z-scores count as 0."""
        sequence, places = self._config.sequence, self._places
        enough = len(places.poses_m) >= sequence.min_cells
        z = self.z_score(scored, scored.similarity) if enough else np.zeros_like(scored.similarity)
        filtered: Float32Array = propagate(
            self._filtered,
            scored.cells,
            np.asarray(z, dtype=np.float32),
            places.predecessors,
            driven,
            self._tolerance,
            np.float32(sequence.memory),
        )
        return filtered
