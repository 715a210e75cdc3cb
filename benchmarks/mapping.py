"""Mapping: CPU per camera frame of the whole mapper and of its stages, on a town-sized drive.

Two laps of a street of 3.6 km, frames cut from a wide synthetic panorama: the work per frame does not depend on what they show.
Process CPU time, means over the drive or medians of repeated calls; making the frames is not counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.table import Row
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.experience_map import Closure, closure_edges, concatenated, odometry_edges, relaxed_poses
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.types import CognitiveMap, Frame, Observation
from hippodrome.core.views import keyframes
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.graph import graph_of
from hippodrome.core.views.scoring import make_bank, score, start_query_mean, template_mean
from hippodrome.core.views.sequence import (
    NO_EVIDENCE,
    filter_step,
    peak,
    standardise,
)

RATE_HZ, SPEED_MPS, LAP_M, LAPS = 11.2, 5.5, 3_600.0, 2.0  # the paper's camera and drive
PIXELS_PER_M = 5
VIEWS = 1_400  # stored views of the paper's map
PAPER_CPU_PERCENT = 1.3


def run() -> list[Row]:
    config = MapperConfig()
    whole, cognitive_map, frames = _drive(config)
    per_cent = 0.1 * RATE_HZ * whole
    note = f"{frames} frames, {len(cognitive_map.t_s)} vertices, {len(cognitive_map.view_cells.templates)} view cells"
    return [
        Row("mapping", "whole mapper, CPU per frame", whole, "ms", note),
        Row("mapping", "whole mapper, share of one core", per_cent, "%", f"at {RATE_HZ} Hz; the paper: {PAPER_CPU_PERCENT} %"),
        *_stages(config),
        _relaxation(config),
    ]


def _drive(config: MapperConfig) -> tuple[float, CognitiveMap, int]:
    """Mean CPU per frame [ms], finishing the map included; the map; the number of frames."""
    panorama, mapper = _panorama(), Mapper(config)
    frames, spent_s = int(LAPS * LAP_M / SPEED_MPS * RATE_HZ), 0.0
    _drive_on(Mapper(config), panorama, range(600))  # compiles what is compiled on first use
    for first in range(0, frames, 500):
        spent_s += _drive_on(mapper, panorama, range(first, min(first + 500, frames)))
    began = time.process_time()
    cognitive_map = mapper.finish()
    return 1e3 * (spent_s + time.process_time() - began) / frames, cognitive_map, frames


def _drive_on(mapper: Mapper, panorama: Frame, steps: range) -> float:
    """CPU seconds that the mapper takes for these steps of the drive; making their frames is not counted."""
    observations = [_observation(i, panorama) for i in steps]
    began = time.process_time()
    for observation in observations:
        mapper.step(observation)
    return time.process_time() - began


def _observation(i: int, panorama: Frame) -> Observation:
    """Step ``i`` of the drive along the panorama, at a scale of half a map unit per metre."""
    left = int(i * SPEED_MPS / RATE_HZ % LAP_M * PIXELS_PER_M)
    frame = np.repeat(panorama[:, left : left + 160, None], 3, axis=2)
    turn_radps = 0.15 * np.sin(i / 150.0)  # bends, so that some views come from turning
    return Observation((i + 1) / RATE_HZ, 1.0 / RATE_HZ, 0.5 * SPEED_MPS, turn_radps, frame)


def _stages(config: MapperConfig) -> list[Row]:
    """Median CPU per call of each stage of a keyframe, with ``VIEWS`` views stored."""
    cells, sequence, rng = config.memory.view_cells, config.memory.sequence, np.random.default_rng(0)
    frames = rng.integers(0, 256, (50, 120, 160, 3), dtype=np.uint8)
    templates = rng.integers(0, 60, (VIEWS, int(np.prod(cells.shape))), dtype=np.int8)
    bank = make_bank(cells.kind, cells.shape, templates, template_mean(cells.kind, templates))
    mean = start_query_mean(bank.mean, 100)
    links = graph_of(np.arange(VIEWS, dtype=np.int32), np.full(VIEWS, 5.0), np.zeros(VIEWS), 3.0).links
    z = standardise(rng.normal(size=VIEWS).astype(np.float32), 30, 0.03)
    evidence = filter_step(NO_EVIDENCE, z, links, 5.0, 0.0, 5.0, sequence)
    state, observation = keyframes.start(), Observation(0.1, 0.1, 4.0, 0.1, None)
    calls: dict[str, Callable[[], Any]] = {
        "view step, each odometry sample": lambda: keyframes.advance(state, observation, config.view_step),
        "describe a 160x120 frame, each view": lambda: describe(frames[0], cells),
        f"score against {VIEWS}, each view": lambda: score(bank, templates[7], mean, cells),
        f"sequence filter on {VIEWS}, each view": lambda: filter_step(evidence, z, links, 5.0, 0.0, 5.0, sequence),
        f"best and its margin of {VIEWS}, each view": lambda: peak(evidence, links, 15.0),
    }
    return [Row("mapping", name, 1e3 * _median_s(call), "ms") for name, call in calls.items()]


def _relaxation(config: MapperConfig) -> Row:
    """Median CPU of relaxing a map of four laps with a closure at every other vertex of the later ones."""
    rng = np.random.default_rng(1)
    motions = np.tile([5.0, 0.0, 2.0 * np.pi / 350.0], (VIEWS, 1)) + rng.normal(size=(VIEWS, 3)) * [0.1, 0.02, 0.01]
    closures = [Closure(i - 350, i, (0.0, 0.0, 0.0), 5.0, 3.0) for i in range(350, VIEWS, 2)]
    settings = config.experience_map
    odometry = odometry_edges(motions, settings)
    edges = concatenated(odometry, closure_edges(closures, settings))
    taken = _median_s(lambda: relaxed_poses(motions, edges, settings), repeats=3)
    return Row("mapping", f"robust pose graph, {VIEWS} vertices", 1e3 * taken, "ms", f"{len(closures)} closures, once a map")


def _median_s(call: Callable[[], Any], repeats: int = 200) -> float:
    """Median process CPU time of one call, the first one (compilation) aside."""
    call()
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        spent.append(time.process_time() - began)
    return float(np.median(spent))


def _panorama() -> Frame:
    """A skyline of boxes, 120 px high."""
    rng, width = np.random.default_rng(3), int(LAP_M * PIXELS_PER_M)
    image = np.full((120, width), 200, dtype=np.uint8)
    x = 0
    while x < width:
        step = int(rng.integers(6, 30))
        image[int(rng.integers(20, 80)) : 90, x : x + step] = rng.integers(30, 230)
        x += step
    return np.concatenate([image, image[:, :200]], axis=1)
