"""Place recognition scored alone: which views are found again, and how sure one can be, before any pose is believed.

The queries are the looks of a localization drive, the places are the vertices of the map; those of one side of the town are
struck from it, so that there are unmapped roads among the queries. Where both were is taken from ground truth. Each recogniser
answers a look with one place and a score; a threshold on the score gives a point of its precision-recall curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hippodrome.core import se2
from hippodrome.core.localization import places as localizer_places
from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.recogniser import PlaceRecogniser
from hippodrome.core.types import CognitiveMap, FloatArray, Frame, IntArray, UInt8Array
from hippodrome.core.views import keyframes
from hippodrome.core.views.descriptors import ViewCellConfig, describe
from hippodrome.core.views.scoring import QueryMean, make_bank, score, template_mean
from hippodrome.core.views.sequence import SequenceConfig, Step
from hippodrome.sim.recording import Recording

MAPPED_M, MAPPED_RAD = 5.0, np.deg2rad(30.0)  # a look that has a place this near, facing the same way, can be recognised
SAME_M, SAME_RAD = 15.0, np.deg2rad(60.0)  # an answer this near is the same place; a look without one is on an unmapped road
PRECISION = 0.99
STRUCK = 0.25  # share of the map's places, those farthest west: as many unmapped roads as a half-known town has
RATSLAM = ViewCellConfig(kind="grey", grey_shift=5)  # OpenRatSLAM: 60x10 grey, patch-normalised, shifts of +-5 columns
METHODS = ("sequence of views", "single view", "RatSLAM template", "RatSLAM template, margin")


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """N frames of a drive, where they were taken, and the self-motion (length in map units, turn) since the one before."""

    frames: list[Frame]
    poses_m: FloatArray  # (N, 3) true
    travelled: FloatArray  # (N,)
    turned_rad: FloatArray  # (N,)


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """One recogniser's answers to Q looks."""

    method: str
    score: FloatArray  # (Q,)
    right: NDArray[np.bool_]  # (Q,) the place is within ``SAME_M``
    near: NDArray[np.bool_]  # (Q,) the place is within ``MAPPED_M``
    mapped: NDArray[np.bool_]  # (Q,) there is a place to be found


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Precision and recall (K,) as the threshold falls."""

    precision: FloatArray
    recall: FloatArray


def looks_of(drive: Recording, config: LocalizerConfig) -> Looks:
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
    return Looks(frames, np.array(poses), travelled, turned_rad)


def half_known(cognitive_map: CognitiveMap) -> CognitiveMap:
    """The map without the places farthest west; only what recognition needs of it."""
    cells = cognitive_map.view_cells
    x_m = cognitive_map.poses[localizer_places.first_vertex(cognitive_map.view_cell, len(cells.templates)), 0]
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


def recognise(cognitive_map: CognitiveMap, mapping: Recording, looks: Looks, config: LocalizerConfig) -> tuple[Answers, ...]:
    """The answers of all ``METHODS`` to the same frames, about the same places."""
    vertex = localizer_places.first_vertex(cognitive_map.view_cell, len(cognitive_map.view_cells.templates))
    steps = np.searchsorted(mapping.samples.t_s, cognitive_map.t_s[vertex] - 1e-6)
    places_m = mapping.samples.poses_m[steps]
    scale = 0.0 if cognitive_map.log_scale is None else float(np.median(cognitive_map.log_scale))
    single = replace(config, sequence=SequenceConfig(memory=0.0))
    templates = [_template(mapping.frame(int(mapping.samples.frame[step]))) for step in steps]
    similarity = np.array([_similarity(np.array(templates), _template(frame)) for frame in looks.frames])
    cells = np.argmax(similarity, axis=1)
    best = similarity[np.arange(len(cells)), cells]
    margins = np.array([_margin(row, places_m) for row in similarity])
    found = (
        *(tuple(zip(*_by_views(cognitive_map, looks, scale, one), strict=True)) for one in (config, single)),
        (cells, best),
        (cells, margins),
    )
    return tuple(
        judged(method, np.array(cell), np.array(score, dtype=np.float64), looks.poses_m, places_m)
        for method, (cell, score) in zip(METHODS, found, strict=True)
    )


def judged(method: str, cell: IntArray, score: FloatArray, poses_m: FloatArray, places_m: FloatArray) -> Answers:
    """Answers (Q,) held against where the looks (Q, 3) and the places (C, 3) truly were.

    A look between the two limits, at the end of a mapped road, need not be recognised, but an answer to it can be wrong.
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


def curve(answers: Answers, strict: bool = False) -> Curve:
    """Precision over all answers above the threshold, recall over the mapped looks; equal scores fall together.

    ``strict`` takes an answer for right only within ``MAPPED_M``.
    """
    right = answers.near if strict else answers.right
    order = np.argsort(-answers.score, kind="stable")
    last = np.append(np.diff(answers.score[order]) != 0.0, True)
    accepted, correct = np.arange(1, len(order) + 1), np.cumsum(right[order])
    recalled = np.cumsum((right & answers.mapped)[order])
    return Curve((correct / accepted)[last], (recalled / max(int(answers.mapped.sum()), 1))[last])


def recall_at(found: Curve, precision: float = PRECISION) -> float:
    """The largest recall at a precision of at least ``precision``; 0 when no threshold reaches it."""
    return float(np.max(found.recall, where=found.precision >= precision, initial=0.0))


def _by_views(
    cognitive_map: CognitiveMap, looks: Looks, log_scale: float, config: LocalizerConfig
) -> Iterator[tuple[int, float]]:
    """Cell and margin of each look, by the recogniser that the localizer uses."""
    recogniser = PlaceRecogniser(localizer_places.make_place_map(cognitive_map, None, 0.0, config.injection.map_m), config)
    for frame, travelled, turned_rad in zip(looks.frames, looks.travelled, looks.turned_rad, strict=True):
        seen = recogniser.recognise(frame, Step(float(travelled * np.exp(log_scale)), float(turned_rad)))
        yield seen.cell, seen.margin


def _template(frame: Frame) -> UInt8Array:
    return np.asarray(describe(frame, RATSLAM), dtype=np.uint8)


def _similarity(templates: UInt8Array, query: UInt8Array) -> FloatArray:
    """Minus the smallest mean absolute difference (C,) over the shifts."""
    nothing = QueryMean(np.zeros(len(query), dtype=np.float32), 0)
    bank = make_bank("grey", RATSLAM.shape, templates, nothing.mean)
    likest: FloatArray = score(bank, query, nothing, RATSLAM).max(axis=1).astype(np.float64)
    return likest


def _margin(similarity: FloatArray, places_m: FloatArray) -> float:
    """How far the most similar place stands out from the best elsewhere, in standard deviations of all."""
    best = int(np.argmax(similarity))
    elsewhere = np.hypot(*(places_m[:, :2] - places_m[best, :2]).T) > localizer_places.SAME_PLACE_M
    rival = float(np.max(similarity, where=elsewhere, initial=-np.inf))
    return (float(similarity[best]) - rival) / max(float(similarity.std()), 1e-6) if np.isfinite(rival) else 0.0
