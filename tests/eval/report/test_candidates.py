"""What a frame or a vertex could have been as well."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.types import Trajectory, ViewCells
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.scoring import template_mean
from hippodrome.eval.report.candidates import COUNT, ELSEWHERE_M, lanes_beside, looks_at

CELLS, APART_M = 30, 5.0
CONFIG = LocalizerConfig()
PLACES_M = np.column_stack([APART_M * np.arange(CELLS), np.zeros(CELLS), np.zeros(CELLS)])


def picture(number):
    """A frame unlike all others, of blocks."""
    blocks = np.random.default_rng(number).integers(0, 256, (15, 20), dtype=np.uint8)
    return np.repeat(np.repeat(np.kron(blocks, np.ones((8, 8), np.uint8))[:, :, None], 3, axis=2), 1, axis=0)


def a_map(kind="gradient"):
    templates = np.array([describe(picture(number), CONFIG.views) for number in range(CELLS)])
    cells = ViewCells(kind, templates, template_mean("gradient", templates), CONFIG.views.shape)
    return SimpleNamespace(view_cells=cells, view_cell=np.arange(CELLS), poses=PLACES_M, t_s=10.0 * np.arange(CELLS))


def drive():
    """Sees place 7 at 0 s, place 20 at 1 s."""
    samples = SimpleNamespace(t_s=np.array([0.0, 1.0]), frame_steps=np.array([0, 1]))
    return SimpleNamespace(samples=samples, frame=lambda number: picture((7, 20)[number]))


def test_the_view_of_the_place_is_the_best_and_others_lie_elsewhere():
    truth = Trajectory(np.array([0.0, 1.0]), PLACES_M[[7, 20]])
    first, second = looks_at("topometric", [0.0, 1.5], drive(), truth, a_map(), CONFIG)
    assert (first.views[0].view_s, first.views[0].off_m) == (70.0, 0.0)
    assert len(first.views) == COUNT
    assert [one.score for one in first.views] == sorted((one.score for one in first.views), reverse=True)
    places_m = [APART_M * one.view_s / 10.0 for one in first.views]
    assert min(abs(a - b) for i, a in enumerate(places_m) for b in places_m[:i]) >= ELSEWHERE_M
    assert second.views[0].view_s == 200.0 and second.views[0].off_m is None, "there is no truth at 1.5 s"


def test_views_of_another_kind_have_no_candidates():
    truth = Trajectory(np.array([0.0, 1.0]), PLACES_M[[7, 20]])
    none = SimpleNamespace(templates=np.zeros((0, 4), np.int8))
    assert looks_at("topometric", [0.0], drive(), truth, SimpleNamespace(view_cells=none), CONFIG) == []


def test_lanes_beside_a_place_are_named_by_their_distance():
    lines = [np.array([[0.0, y_m], [100.0, y_m]]) for y_m in (0.0, 3.0, 6.0, 9.0, 12.0, 90.0)]
    roads = SimpleNamespace(
        lane_count=len(lines), lane_ids=[f"lane-{i}" for i in range(len(lines))], lane_points_m=lambda lane: lines[lane],
        points_m=np.concatenate(lines), point_start=2 * np.arange(len(lines) + 1),
    )  # fmt: skip
    found = lanes_beside(np.array([50.0, 0.5]), roads, own=0)
    assert [(one.lane, one.apart_m) for one in found] == [("lane-1", 2.5), ("lane-2", 5.5), ("lane-3", 8.5)]
    assert lanes_beside(np.array([50.0, 500.0]), roads, own=-1) == ()
    assert lanes_beside(np.array([50.0, 0.5]), roads, own=-1)[0].apart_m == pytest.approx(0.5)
