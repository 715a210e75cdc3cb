"""Pictures are looked at by people; tests hold what can be computed: drawn, the same each time, from the right data."""

import cv2
import numpy as np
import pytest

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import AttractorStates, CognitiveMap, Edges, LocalizationEstimate, ViewCells, Visits
from hippodrome.eval.figures import style
from hippodrome.eval.figures.errors import draw_error_profiles, draw_error_violins
from hippodrome.eval.figures.frames import draw_contact_sheet
from hippodrome.eval.figures.localization import (
    draw_localization_error,
    draw_localization_strip,
    grid_sheet,
    head_ring,
    strip_steps,
)
from hippodrome.eval.figures.maps import draw_cognitive_map, draw_error_map, draw_maps_over_truth
from hippodrome.eval.metrics.trajectory import Score

COUNT = 40
T_S = 0.1 * np.arange(COUNT)
POSES = np.column_stack([5.0 * np.arange(COUNT), np.sin(T_S), np.zeros(COUNT)])
ERRORS_M = np.linspace(0.0, 30.0, COUNT)


def network():
    none = np.full(1, -1, np.int32)
    ends, start = np.array([[0.0, 0.0], [200.0, 0.0]]), np.array([0, 2], np.int32)
    return RoadNetwork(
        ("a_0",), ("a",), np.zeros(1, np.int32), np.zeros(1, bool), np.ones(1), np.ones(1), ends, start,
        np.zeros(0, np.int32), np.zeros(2, np.int32), none, none,
    )  # fmt: skip


def cognitive_map(count=COUNT):
    steps = np.arange(max(count - 1, 0), dtype=np.int32)
    single = np.float32
    return CognitiveMap(
        "semi-metric",
        T_S[:count],
        POSES[:count],
        np.zeros(count, np.int32),
        ViewCells("gradient", np.zeros((1, 1), np.int8), np.zeros(1, single), (1,)),
        Edges(steps, steps + 1, *[np.ones((len(steps), 3))] * 2, (steps % 2).astype(np.uint8), steps.astype(single)),
        Visits(T_S[:count], np.arange(count, dtype=np.int32), np.zeros((count, 3))),
        AttractorStates(np.zeros((count, 2), single), np.zeros((count, 2), single), *[np.zeros((count, 1, 2, 2), single)] * 3),
    )  # fmt: skip


def estimate(t_s=0.0, head_rad=(1.0, 1.0), head=50.0, phase_rad=0.5, grid=20.0):
    phases, reliability = np.full((1, 2, 2), phase_rad), np.full((1, 2, 2), grid)
    return LocalizationEstimate(
        t_s, np.zeros(3), np.eye(3), True, 0.0, -1, np.array(head_rad), np.full(2, head), phases, reliability
    )


def scores():
    return {
        "semi-metric": Score("d", 10.0 * ERRORS_M, T_S, COUNT, COUNT),
        "topometric": Score("d", 0.1 * ERRORS_M, T_S, COUNT, COUNT),
    }


def frames(count):
    return [np.full((12, 16, 3), 20 * i, np.uint8) for i in range(count)]


DRAWINGS = {
    "over": lambda path: draw_maps_over_truth(path, network(), POSES, {"topometric": POSES + 1.0}, "title"),
    "map": lambda path: draw_cognitive_map(path, cognitive_map()),
    "empty map": lambda path: draw_cognitive_map(path, cognitive_map(0)),
    "error map": lambda path: draw_error_map(path, network(), POSES, ERRORS_M),
    "perfect map": lambda path: draw_error_map(path, network(), POSES, np.zeros(COUNT)),
    "profiles": lambda path: draw_error_profiles(path, scores(), scores()),
    "no profiles": lambda path: draw_error_profiles(path, {}, {}),
    "violins": lambda path: draw_error_violins(path, scores(), scores()),
    "perfect violins": lambda path: draw_error_violins(path, {"a": Score("d", np.zeros(3), T_S[:3], 3, 3)}, {}),
    "localization": lambda path: draw_localization_error(path, T_S, ERRORS_M, ERRORS_M > 10.0),
    "strip": lambda path: draw_localization_strip(path, frames(2), [estimate(0.0), estimate(3.9)], T_S, ERRORS_M),
    "sheet": lambda path: draw_contact_sheet(path, frames(7), [str(i) for i in range(7)], columns=3),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_every_figure_is_drawn_with_ink(tmp_path, name):
    DRAWINGS[name](tmp_path / "a.png")
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture.shape[0] > 100
    assert picture.shape[1] > 100
    assert (picture < 128).any()
    assert b"Software" not in (tmp_path / "a.png").read_bytes()


def test_the_same_figure_has_the_same_bytes(tmp_path):
    for name in ("a.png", "b.png"):
        draw_maps_over_truth(tmp_path / name, network(), POSES, {"topometric": POSES})
    for kind in ("png", "svg", "pdf"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert b">topometric</text>" in (tmp_path / "a.svg").read_bytes(), "letters stay letters"


def test_the_head_ring_peaks_at_the_mean_and_is_flat_while_uninformed():
    ring = head_ring(estimate(head_rad=(1.0, 1.0)))
    assert -np.pi + 2.0 * np.pi * np.argmax(ring) / len(ring) == pytest.approx(1.0, abs=0.09)
    assert np.ptp(head_ring(estimate(head=0.0))) < 1e-12


def test_the_grid_sheet_peaks_at_the_phase_and_wraps():
    sheet = grid_sheet(estimate(phase_rad=np.pi), 0)
    assert np.unravel_index(np.argmax(sheet), sheet.shape) == (0, 0)
    assert sheet[1, 0] == pytest.approx(sheet[-1, 0])
    assert sheet.sum() == pytest.approx(2.0)  # two populations


def test_strip_steps_crowd_towards_the_start():
    steps = strip_steps(0.1 * np.arange(1000), columns=8)
    assert steps[0] == 0
    assert steps[-1] == 999
    assert len(steps) == 8
    assert (np.diff(steps, n=2) > 0).all()


def test_a_sheet_needs_a_caption_for_each_frame(tmp_path):
    with pytest.raises(ValueError, match="2 frames and 1 captions"):
        draw_contact_sheet(tmp_path / "a.png", frames(2), ["one"])


def test_of_a_large_network_the_lanes_around_the_drive_are_drawn(monkeypatch):
    roads = straight_roads(40)  # one every 100 m
    drive_m = np.array([[10.0, 1000.0], [60.0, 1050.0]])
    assert len(style._drawn_lanes(roads, drive_m)) == 40
    monkeypatch.setattr(style, "WHOLE_LANES_M", 1e3)
    assert style._drawn_lanes(roads, drive_m).tolist() == [7, 8, 9, 10, 11, 12, 13]


def straight_roads(count):
    points = [[[0.0, 100.0 * k], [100.0, 100.0 * k]] for k in range(count)]
    none, starts = np.full(count, -1, dtype=np.int32), np.arange(count + 1, dtype=np.int32)
    return RoadNetwork(
        lane_ids=tuple(f"{k}_0" for k in range(count)), edge_ids=tuple(map(str, range(count))),
        lane_edge=starts[:-1], is_internal=np.zeros(count, dtype=np.bool_), width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 8.0), points_m=np.array(points).reshape(-1, 2), point_start=2 * starts,
        successor=np.zeros(0, dtype=np.int32), successor_start=0 * starts, left_lane=none, right_lane=none,
    )  # fmt: skip
