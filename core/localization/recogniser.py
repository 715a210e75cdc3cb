"""Recognising places of a topometric map: a frame is scored against all view cells, the scores are filtered along its paths.

No pose is believed here: what comes out is the cell that stands out, and by how much. ``core.localizer`` makes poses of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.localization import places as localizer_places
from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.places import Places
from hippodrome.core.types import Float32Array, FloatArray, Frame, HippodromeError, IntArray
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.index import ScoredViews, index_of, search
from hippodrome.core.views.scoring import start_query_mean, update_query_mean

NOWHERE: IntArray = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class Recognised:
    """What one look shows."""

    found: ScoredViews
    cell: int  # the best after filtering
    margin: float  # how far it stands out from the best elsewhere


class PlaceRecogniser:
    """Feed it frames in order; ``sequence.memory`` 0 makes each look stand alone.

    Raises HippodromeError where the localizer's view cells are not of the map's kind and shape.
    """

    def __init__(self, places: Places, config: LocalizerConfig) -> None:
        own, mapped = (config.views.kind, config.views.shape), (places.bank.kind, tuple(places.bank.shape))
        if own != mapped:
            raise HippodromeError(
                f"the map's view cells are {mapped[0]} of shape {mapped[1]}, the localizer's {own[0]} of shape {own[1]}: "
                "give `localizer.views` the values that `mapper.memory.view_cells` had"
            )
        gradient, sequence = places.bank.kind == "gradient", config.sequence
        self._places, self._config = places, config
        self._spread_floor = sequence.sigma_floor if gradient else sequence.grey_sigma_floor
        self._index = index_of(places.bank, config.search)
        self._filtered: Float32Array = np.zeros(len(places.poses_m), dtype=np.float32)
        self._query_mean = start_query_mean(places.bank.mean, config.mean_trust)

    def look(self, frame: Frame, step_m: float, turned_rad: float, believed: IntArray = NOWHERE) -> Recognised:
        """One frame, and the motion since the last; ``believed`` cells are scored whatever the frame is like."""
        config, places = self._config, self._places
        descriptor = describe(frame, config.views)
        self._query_mean = update_query_mean(self._query_mean, descriptor, config.views)
        likely = believed
        if self._index is not None:
            expected = localizer_places.expected(places, self._filtered, config.search.hypotheses)
            likely = np.concatenate([expected, believed])
        query = descriptor, self._query_mean
        found = search(places.bank, self._index, likely, query, config.views, config.search)
        self._filtered = self._filter(found, step_m, turned_rad)
        cell = int(np.argmax(self._filtered))
        return Recognised(found, cell, localizer_places.margin(places, self._filtered, cell))

    def z_score(self, found: ScoredViews, similarity: Float32Array | float) -> Float32Array | float:
        """How far a similarity lies above that of all places, in their standard deviations."""
        return (similarity - found.mean) / max(found.spread, self._spread_floor)

    def pose(self, seen: Recognised) -> FloatArray:
        """Pose (3,) of the recognised cell, interpolated between views."""
        similarity = np.full(len(self._places.poses_m), np.nan, dtype=np.float32)
        similarity[seen.found.cells] = seen.found.similarity
        return localizer_places.interpolated_pose(self._places, similarity, seen.cell)

    def _filter(self, found: ScoredViews, step_m: float, turned_rad: float) -> Float32Array:
        sequence, places = self._config.sequence, self._places
        enough = len(places.poses_m) >= sequence.min_cells
        z = np.asarray(self.z_score(found, found.similarity) if enough else np.zeros_like(found.similarity), dtype=np.float32)
        filtered: Float32Array = localizer_places.propagate(
            self._filtered,
            found.cells,
            z,
            (places.link_start, places.link_from, places.link_length_m, places.link_turn_rad),
            (step_m, turned_rad),
            (self._config.step_tolerance_m, sequence.turn_tolerance_rad),
            np.float32(sequence.memory),
        )
        return filtered
