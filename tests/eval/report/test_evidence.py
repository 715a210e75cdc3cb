"""What the report's map draws: vertices placed as scored, errors beside them, frames where they are needed."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.methods.materials import score_trajectory
from hippodrome.eval.methods.method import SEMI_METRIC, TOPOMETRIC
from hippodrome.eval.report.evidence import (
    APART,
    EVEN_FRAMES,
    WORST,
    read_map_evidence,
    write_map_evidence,
)

FRAMES, STEP_S = 400, 0.2


class Camera:
    """A recording of a drive round a circle whose frames are grey levels: frame ``i`` is all ``i % 256``."""

    folder = SimpleNamespace(name="circle-mapping-0")
    frame_count = FRAMES

    def __init__(self):
        self.t_s = np.arange(FRAMES) * STEP_S
        turn = 2.0 * np.pi * self.t_s / self.t_s[-1]
        self.poses = np.column_stack([200.0 + 50.0 * np.cos(turn), 100.0 + 50.0 * np.sin(turn), se2.wrap(turn + np.pi / 2)])
        self.samples = SimpleNamespace(t_s=self.t_s, frame_steps=np.arange(FRAMES))

    def ground_truth(self):
        return Trajectory(self.t_s, self.poses)

    def frame(self, number):
        return np.full((30, 40, 3), number % 256, np.uint8)


@pytest.fixture
def made(tmp_path):
    camera = Camera()
    truth, vertices = camera.ground_truth(), np.arange(0, FRAMES, 5)
    off = camera.poses[vertices].copy()
    off[30, 0] += 9.0
    off[31, 0] += 8.0
    off[60, 1] += 7.0
    own = camera.poses[vertices].copy()  # the same path, but in a frame of its own, turned and moved
    own = se2.compose(se2.inverse(own[0]), own)
    scored = {
        SEMI_METRIC: score_trajectory(Trajectory(camera.t_s[vertices], own), truth, SEMI_METRIC.alignment),
        TOPOMETRIC: score_trajectory(Trajectory(camera.t_s[vertices], off), truth, TOPOMETRIC.alignment),
    }
    estimates = [SimpleNamespace(t_s=float(t), pose=pose) for t, pose in zip(camera.t_s, camera.poses, strict=True)]
    localized = SimpleNamespace(t_s=camera.t_s, errors_m=np.zeros(FRAMES), localized=camera.t_s > 10.0)
    found = {TOPOMETRIC: SimpleNamespace(localized=localized, localization=SimpleNamespace(estimates=estimates))}
    far = np.array([[5000.0, 5000.0], [5100.0, 5000.0]])
    lanes = (np.array([[150.0, 100.0], [200.0, 100.0], [250.0, 100.0]]), far)
    roads = SimpleNamespace(lane_count=2, lane_points_m=lambda lane: lanes[lane])
    materials = SimpleNamespace(folder=tmp_path, mapping=camera, drive=camera, roads=roads,
                                town=SimpleNamespace(net_file=SimpleNamespace(name="circle.net.xml")))  # fmt: skip
    write_map_evidence(materials, scored, found)
    return tmp_path, camera, vertices


def test_vertices_lie_where_they_were_scored(made):
    folder, camera, vertices = made
    semi_metric, topometric = read_map_evidence(folder / "map.json").methods
    np.testing.assert_allclose(semi_metric.x_m, camera.poses[vertices, 0], atol=0.01)
    assert max(semi_metric.error_m) < 0.01
    assert topometric.error_m[30] == pytest.approx(9.0, abs=0.01)


def test_worst_places_are_different_places_and_have_their_frames(made):
    folder, camera, vertices = made
    evidence = read_map_evidence(folder / "map.json")
    worst = evidence.methods[1].worst
    assert worst[:2] == [30, 60]  # 31 is the same place as 30
    assert len(worst) == WORST and all(abs(a - b) >= APART for i, a in enumerate(worst) for b in worst[:i])
    assert {round(float(camera.t_s[vertices[vertex]]), 2) for vertex in worst} <= set(evidence.thumbnails.t_s)


def test_tiles_are_the_frames_of_their_times(made):
    folder, _, _ = made
    tiles = read_map_evidence(folder / "map.json").thumbnails
    sheet = cv2.imread(str(folder / "thumbnails.jpg"))
    assert EVEN_FRAMES <= len(tiles.t_s) <= EVEN_FRAMES + 2 * WORST
    assert sheet.shape[1] == tiles.columns * tiles.width
    for place in (0, 17, len(tiles.t_s) - 1):
        row, column = divmod(place, tiles.columns)
        centre = sheet[int((row + 0.5) * tiles.height), int((column + 0.5) * tiles.width)]
        assert int(centre[0]) == pytest.approx(round(tiles.t_s[place] / STEP_S) % 256, abs=3)  # JPEG


def test_roads_far_away_are_left_out_and_straight_ones_thinned(made):
    folder, _, _ = made
    evidence = read_map_evidence(folder / "map.json")
    assert evidence.roads == [[150.0, 100.0, 250.0, 100.0]]


def test_the_localized_drive_is_there_second_by_second(made):
    folder, camera, _ = made
    (drive,) = read_map_evidence(folder / "map.json").drives
    assert len(drive.t_s) == pytest.approx(camera.t_s[-1], abs=1.5)
    assert next(t for t, known in zip(drive.t_s, drive.localized, strict=True) if known) == pytest.approx(11.0, abs=0.01)
