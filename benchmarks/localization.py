"""Localization: a step with a query frame, a step without, and one tick of the attractor networks.

Views lie 5 m apart along a street that winds to and fro; each blends two described pictures of boxes, so that they differ in
about as few directions as a town's. Recall is that of the sketched search: how often it scores the cell that the exhaustive one
finds best, for stored views seen again with noise. Process CPU time, medians.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.table import Row
from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.config import GRID_INFORMATION, AttractorConfig
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.types import AttractorStates, CognitiveMap, Edges, Frame, Observation, ViewCells, Visits
from hippodrome.core.views.config import SearchConfig, ViewCellConfig
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.index import index_of, search
from hippodrome.core.views.scoring import bank_of, start_query_mean, template_mean

BANKS = (1_400, 10_000, 100_000)
SPACING_M, ROW_M, ROWS_APART_M = 5.0, 2_000.0, 30.0
QUERIES, TICKS = 40, 2_000
STEPS = 4  # of odometry at 10 Hz for each query frame, which a localizer takes every 0.4 s at its usual speed
PICTURES = 1_000  # described pictures that the views are blended from
NOISE = 12.0  # standard deviation of a descriptor seen again: about what another sun makes of it
NO_CELLS = np.zeros(0, dtype=np.int32)


def run() -> list[Row]:
    rows = [_attractor_tick()]
    for views in BANKS:
        rows += _localizer_steps(views) + _searches(views)
    return rows


def _attractor_tick() -> Row:
    head_config, grid_config = AttractorConfig(), AttractorConfig(information=GRID_INFORMATION)
    head = head_direction.known(0.3, head_config)
    grid = grid_cells.known(np.zeros(2), grid_cells.module_periods(97.0), grid_config)
    noise = np.full((2, 2), 1e-4)

    def tick() -> None:
        moved = head_direction.inhibit(head_direction.integrate(head, 0.1, 0.1, (1e-6, 1e-6)), 0.1, head_config)
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
    frames = rng.integers(0, 256, (QUERIES, 120, 160, 3), dtype=np.uint8)
    number = iter(range(10**9))
    kind = "exhaustive" if views <= SearchConfig().exhaustive_cells else "sketched"

    def observe(frame: Frame | None) -> None:
        localizer.step(Observation(0.6 * (next(number) + 1), 0.6, 4.0, 0.0, frame))  # far enough on: each frame is a query

    observe(frames[0])
    queries = [_median_s(lambda frame=frame: observe(frame), 1) for frame in frames]  # type: ignore[misc]
    query, blind = float(np.median(queries)), _median_s(lambda: observe(None), 200)
    mean_ms = 1e3 * (query + (STEPS - 1) * blind) / STEPS
    return [
        Row("localization", f"step with a query frame, {views} views", 1e3 * query, "ms", f"{kind} search"),
        Row("localization", f"step without, {views} views", 1e3 * blind, "ms"),
        Row("localization", f"step, mean, {views} views", mean_ms, "ms", "10 Hz, a query frame every 0.4 s"),
    ]


def _searches(views: int) -> list[Row]:
    """Time, memory and recall of the sketched search beside the exhaustive one."""
    rng, config, cells = np.random.default_rng(views), SearchConfig(), ViewCellConfig()
    bank = bank_of(_winding_map(views, rng).view_cells)
    index = index_of(bank, config)
    if index is None:
        return []
    spent_s, found = np.zeros((QUERIES, 2)), 0
    for i, cell in enumerate(rng.integers(0, views, QUERIES)):
        seen = bank.templates[cell] + rng.normal(0.0, NOISE, bank.templates.shape[1])
        query = np.clip(seen, 0, 127).astype(np.int8), start_query_mean(bank.mean)
        began = time.process_time()
        everything = search(bank, None, NO_CELLS, query, cells, config)
        between = time.process_time()
        some = search(bank, index, NO_CELLS, query, cells, config)
        spent_s[i] = between - began, time.process_time() - between
        found += int(np.argmax(everything.similarity)) in some.cells
    exhaustive_ms, sketched_ms = 1e3 * np.median(spent_s, axis=0)
    stored = bank.templates.shape[1]
    return [
        Row("localization", f"exhaustive search, {views} views", exhaustive_ms, "ms", f"{stored} bytes/view"),
        Row("localization", f"sketched search, {views} views", sketched_ms, "ms", f"{stored + index.sketch.shape[1]} bytes/view"),
        Row("localization", f"sketched recall, {views} views", 100.0 * found / QUERIES, "%", "of its best cell"),
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
    pictures = np.array([describe(_boxes(rng), config) for _ in range(PICTURES)], dtype=np.float32)
    (one, other), share = rng.integers(0, PICTURES, (2, views)), rng.uniform(0.2, 0.8, (views, 1)).astype(np.float32)
    templates = np.rint(share * pictures[one] + (1.0 - share) * pictures[other]).astype(np.int8)
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


def _boxes(rng: np.random.Generator) -> Frame:
    """A picture (120, 160) of 25 boxes on a plain ground."""
    picture = np.full((120, 160), 128, dtype=np.uint8)
    for x, y, width, height, grey in rng.integers([0, 0, 5, 5, 0], [150, 110, 60, 60, 256], (25, 5)):
        picture[y : y + height, x : x + width] = grey
    return picture
