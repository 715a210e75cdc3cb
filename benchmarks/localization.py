"""Localization: a step with a frame to look at, a step without, and one tick of the attractor networks.

Views are random, one every 5 m of a street that winds to and fro; scoring takes the same time for any content. Process CPU
time, medians.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.table import Row
from hippodrome.core import grid_cells, head_direction
from hippodrome.core.attractor import AttractorConfig
from hippodrome.core.localizer import Localizer, LocalizerConfig
from hippodrome.core.types import AttractorStates, CognitiveMap, Edges, Frame, Observation, ViewCells, Visits
from hippodrome.core.view_cells import ViewCellConfig, template_mean

BANKS = (1_400, 10_000, 100_000)
SPACING_M, ROW_M, ROWS_APART_M = 5.0, 2_000.0, 30.0
LOOKS, TICKS = 40, 2_000


def run() -> list[Row]:
    rows = [_attractor_tick()]
    for views in BANKS:
        rows += _localizer_steps(views)
    return rows


def _attractor_tick() -> Row:
    head_config, grid_config = AttractorConfig(), AttractorConfig(information=grid_cells.GRID_INFORMATION)
    head = head_direction.known(0.3, head_config)
    grid = grid_cells.known(np.zeros(2), grid_cells.module_periods(97.0), grid_config)
    noise = np.full(2, 1e-4)

    def tick() -> None:
        moved = head_direction.inhibit(head_direction.integrate(head, 0.1, 0.1, 1e-6), 0.1, head_config)
        step = grid_cells.displacement(moved.mean_rad, 8.0, 0.1)
        placed = grid_cells.inhibit(grid_cells.integrate(grid, step, noise), 0.1, grid_config)
        head_direction.read_out(moved)
        grid_cells.read_out(placed, np.zeros(2))

    return Row(
        "localization", "attractor tick", 1e6 * _median_s(tick, TICKS), "us", "ring + 3 tori: integrate, inhibit, read out"
    )


def _localizer_steps(views: int) -> list[Row]:
    rng = np.random.default_rng(views)
    localizer = Localizer(_winding_map(views, rng), None, LocalizerConfig())
    frames = rng.integers(0, 256, (LOOKS, 120, 160), dtype=np.uint8)
    number = iter(range(10**9))

    def observe(frame: Frame | None) -> None:
        localizer.step(Observation(0.6 * (next(number) + 1), 0.6, 4.0, 0.0, frame))  # one view step: each frame is looked at

    observe(frames[0])
    looks = [_median_s(lambda frame=frame: observe(frame), 1) for frame in frames]  # type: ignore[misc]
    blind = _median_s(lambda: observe(None), 200)
    return [
        Row("localization", f"step with a look, {views} views", 1e3 * float(np.median(looks)), "ms", "exhaustive scoring"),
        Row("localization", f"step without, {views} views", 1e3 * blind, "ms"),
    ]


def _median_s(call: Callable[[], None], repeats: int) -> float:
    """Median process CPU time of one call."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        spent.append(time.process_time() - began)
    return float(np.median(spent))


def _winding_map(views: int, rng: np.random.Generator) -> CognitiveMap:
    """A street that winds to and fro, one random view every ``SPACING_M``."""
    along = SPACING_M * np.arange(views)
    row, within = np.divmod(along, ROW_M)
    backwards = row % 2 == 1
    x_m, heading = np.where(backwards, ROW_M - within, within), np.where(backwards, np.pi, 0.0)
    config, index = ViewCellConfig(), np.arange(views, dtype=np.int32)
    templates = rng.integers(0, 60, (views, int(np.prod(config.shape))), dtype=np.int8)
    motion = np.tile([SPACING_M, 0.0, 0.0], (views, 1))
    return CognitiveMap(
        frame="network",
        t_s=0.6 * index,
        poses=np.stack([x_m, ROWS_APART_M * row, heading], axis=1),
        view_cell=index,
        view_cells=ViewCells("gradient", templates, template_mean("gradient", templates), config.shape),
        edges=Edges(index[:0], index[:0], motion[:0], motion[:0], np.zeros(0, np.uint8), np.zeros(0, np.float32)),
        visits=Visits(0.6 * index, index, motion),
        attractors=AttractorStates(
            np.zeros((views, 2), np.float32),
            np.zeros((views, 2), np.float32),
            np.zeros(0, np.float32),
            np.zeros((views, 0, 2, 2), np.float32),
            np.zeros((views, 0, 2, 2), np.float32),
        ),
        log_scale=np.zeros(views),
    )
