"""Place recognition alone: the answers of several recognisers to the same query frames, before any pose is believed.

The query frames are those of a localization drive that a localizer would look at; the places are the distinct views of the map.
The places of one side of the town are struck from the map, so that there are unmapped roads among the queries. Where queries and
places truly were is taken from ground truth. Each recogniser answers a query with one place and a score; ``recall`` makes
precision-recall curves of the answers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hippodrome.core import se2
from hippodrome.core.localization import places
from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.recogniser import PlaceRecogniser
from hippodrome.core.types import CognitiveMap, FloatArray, Frame, IntArray, UInt8Array
from hippodrome.core.views import keyframes
from hippodrome.core.views.config import SequenceConfig, ViewCellConfig
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.scoring import QueryMean, make_bank, score, template_mean
from hippodrome.core.views.sequence import Step
from hippodrome.eval.metrics.places import MAPPED_M, MAPPED_RAD, SAME_M, SAME_RAD
from hippodrome.sim.recording import Recording

# Share of the places that is struck from the map, those farthest west: as many unmapped roads as a half-known town has.
STRUCK: Final = 0.25
# OpenRatSLAM's template: 60x10 pixels, grey, normalised by patches, compared at shifts of up to 5 columns to either side.
RATSLAM: Final = ViewCellConfig(kind="grey", grey_shift=5)
METHODS: Final = ("sequence of views", "single view", "RatSLAM template", "RatSLAM template, margin")


@dataclass(frozen=True, slots=True, eq=False)
class Queries:
    """N query frames of a drive, where they were taken, and the self-motion since the query before."""

    frames: list[Frame]
    poses_m: FloatArray  # (N, 3) true poses
    travelled: FloatArray  # (N,) length of the way since the query before, map units
    turned_rad: FloatArray  # (N,) turn since the query before


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """One recogniser's answers to Q queries, held against the truth."""

    method: str
    score: FloatArray  # (Q,) how sure the recogniser is; comparable within one method only
    right: NDArray[np.bool_]  # (Q,) the answered place is within ``SAME_M`` of the query
    near: NDArray[np.bool_]  # (Q,) the answered place is within ``MAPPED_M`` of the query
    mapped: NDArray[np.bool_]  # (Q,) the map has a place within ``MAPPED_M`` of the query


def queries_of(drive: Recording, config: LocalizerConfig) -> Queries:
    """The frames that a localizer would look at: one whenever the view has changed enough."""
    state, poses, motions = keyframes.start(), [], []
    frames: list[Frame] = []
    samples = drive.samples
    for i, sensed in enumerate(drive.self_motion()):
        state = keyframes.advance(state, sensed, config.steps)
        number = int(samples.frame[i])
        if number >= 0 and (not frames or keyframes.is_due(state, config.steps)):
            frames.append(drive.frame(number))
            poses.append(samples.poses_m[i])
            motions.append((state.travelled, state.turned_rad))
            state = keyframes.restart(state)
    travelled, turned_rad = np.array(motions).T
    return Queries(frames, np.array(poses), travelled, turned_rad)


def half_known(cognitive_map: CognitiveMap) -> CognitiveMap:
    """The map without the places farthest west, and without what place recognition does not need."""
    cells = cognitive_map.view_cells
    x_m = cognitive_map.poses[places.first_vertex(cognitive_map.view_cell, len(cells.templates)), 0]
    kept_cell = x_m > np.quantile(x_m, STRUCK)
    kept = kept_cell[cognitive_map.view_cell]
    number = (np.cumsum(kept_cell) - 1).astype(np.int32)
    templates = cells.templates[kept_cell]
    return replace(
        cognitive_map,
        t_s=cognitive_map.t_s[kept],
        poses=cognitive_map.poses[kept],
        view_cell=number[cognitive_map.view_cell[kept]],
        view_cells=replace(cells, templates=templates, mean=template_mean(cells.kind, templates)),
        log_scale=None if cognitive_map.log_scale is None else cognitive_map.log_scale[kept],
        covariance=None,
        road_match=None,
    )


def recognise(cognitive_map: CognitiveMap, mapping: Recording, queries: Queries, config: LocalizerConfig) -> tuple[Answers, ...]:
    """The answers of all ``METHODS`` to the same queries, about the same places.

    Args:
        cognitive_map: The map whose distinct views are the places.
        mapping: The recording that the map was built from; RatSLAM's templates are made of its frames.
        queries: The query frames.
        config: Settings of the localizer whose recogniser is judged.
    """
    steps, places_m = places_of(cognitive_map, mapping)
    single = replace(config, sequence=SequenceConfig(memory=0.0))
    templates = [_template(mapping.frame(int(mapping.samples.frame[step]))) for step in steps]
    similarity = np.array([_similarity(np.array(templates), _template(frame)) for frame in queries.frames])
    cells = np.argmax(similarity, axis=1)
    best = similarity[np.arange(len(cells)), cells]
    margins = np.array([margin_of(row, places_m) for row in similarity])
    found = (
        *(tuple(zip(*_by_views(cognitive_map, queries, one), strict=True)) for one in (config, single)),
        (cells, best),
        (cells, margins),
    )
    return tuple(
        judged(method, np.array(cell), np.array(score, dtype=np.float64), queries.poses_m, places_m)
        for method, (cell, score) in zip(METHODS, found, strict=True)
    )


def places_of(cognitive_map: CognitiveMap, mapping: Recording) -> tuple[IntArray, FloatArray]:
    """Steps (C,) of the mapping drive at which the map's distinct views were first seen, and where (C, 3) that truly was."""
    vertex = places.first_vertex(cognitive_map.view_cell, len(cognitive_map.view_cells.templates))
    steps = np.searchsorted(mapping.samples.t_s, cognitive_map.t_s[vertex] - 1e-6)
    return steps.astype(np.int32), mapping.samples.poses_m[steps]


def judged(method: str, cell: IntArray, score: FloatArray, poses_m: FloatArray, places_m: FloatArray) -> Answers:
    """Answers held against where queries and places truly were.

    A query between the two limits, at the end of a mapped road, need not be recognised, but an answer to it can be wrong.

    Args:
        method: Name of the recogniser.
        cell: Place (Q,) that it answers to each query, as an index into ``places_m``.
        score: How sure (Q,) it is.
        poses_m: True poses (Q, 3) of the queries.
        places_m: True poses (C, 3) of the places.
    """
    apart_m = np.hypot(*(poses_m[:, None, :2] - places_m[None, :, :2]).transpose(2, 0, 1))
    turned_rad = np.abs(se2.wrap(poses_m[:, None, 2] - places_m[None, :, 2]))
    query = np.arange(len(poses_m))
    same_way = turned_rad[query, cell] < SAME_RAD
    return Answers(
        method,
        score,
        right=(apart_m[query, cell] < SAME_M) & same_way,
        near=(apart_m[query, cell] < MAPPED_M) & same_way,
        mapped=((apart_m < MAPPED_M) & (turned_rad < MAPPED_RAD)).any(axis=1),
    )


def _by_views(cognitive_map: CognitiveMap, queries: Queries, config: LocalizerConfig) -> Iterator[tuple[int, float]]:
    """Place and margin of each query, by the recogniser that the localizer uses."""
    log_scale = 0.0 if cognitive_map.log_scale is None else float(np.median(cognitive_map.log_scale))
    recogniser = PlaceRecogniser(places.make_place_map(cognitive_map, None, 0.0, config.injection.map_m), config)
    for frame, travelled, turned_rad in zip(queries.frames, queries.travelled, queries.turned_rad, strict=True):
        seen = recogniser.recognise(frame, Step(float(travelled * np.exp(log_scale)), float(turned_rad)))
        yield seen.cell, seen.margin


def _template(frame: Frame) -> UInt8Array:
    """RatSLAM's template of a frame, as one row."""
    return np.asarray(describe(frame, RATSLAM), dtype=np.uint8)


def _similarity(templates: UInt8Array, query: UInt8Array) -> FloatArray:
    """Similarity (C,) of a query's template to C templates: minus the smallest mean absolute difference over the shifts."""
    nothing = QueryMean(np.zeros(len(query), dtype=np.float32), 0)
    bank = make_bank("grey", RATSLAM.shape, templates, nothing.mean)
    likest: FloatArray = score(bank, query, nothing, RATSLAM).max(axis=1).astype(np.float64)
    return likest


def margin_of(similarity: FloatArray, places_m: FloatArray) -> float:
    """How far the most similar place stands out from the best one elsewhere, in standard deviations of all similarities (C,)."""
    best = int(np.argmax(similarity))
    elsewhere = np.hypot(*(places_m[:, :2] - places_m[best, :2]).T) > places.SAME_PLACE_M
    rival = float(np.max(similarity, where=elsewhere, initial=-np.inf))
    return (float(similarity[best]) - rival) / max(float(similarity.std()), 1e-6) if np.isfinite(rival) else 0.0
