"""Pictures of the networks: bumps where they are, as bright as they are sharp, in the colours of their populations."""

import math

import cv2
import numpy as np
import pytest
from PIL import Image

from hippodrome.core.navigation.types import Command, DrivingState
from hippodrome.eval.drive.brain import COLOURS, grid_sheet, head_ring
from hippodrome.eval.drive.film import SIZE, STRIP_PX, Film


def test_the_ring_is_bright_where_the_vehicle_heads():
    ring = head_ring(np.array([0.5 * math.pi, 0.0]), np.array([200.0, 0.0]), None, 101)
    north, south, east = ring[6, 50], ring[94, 50], ring[50, 94]
    assert north.sum() > 3 * south.sum() and south.sum() < 60
    assert np.argmax(north) == np.argmax(COLOURS[0]) and east.sum() < 60


def test_the_heading_that_is_stood_by_is_a_line():
    none, east = (head_ring(np.zeros(2), np.zeros(2), heading, 101) for heading in (None, 0.0))
    assert (none != east).any() and (none[:, :50] == east[:, :50]).mean() > 0.98


def test_a_sheet_is_bright_at_its_bump_and_north_is_up():
    sheet = grid_sheet(np.array([[0.0, 0.5 * math.pi], [0.0, 0.0]]), np.array([[100.0, 100.0], [0.0, 0.0]]), 72)
    row, column = np.unravel_index(int(sheet.sum(axis=2).argmax()), (72, 72))
    assert abs(column - 36) <= 2 and abs(row - 18) <= 2


class NoDriver:
    estimate = track = plan = None


@pytest.mark.parametrize("kind", ["webp", "mp4"])
def test_a_film_is_written_also_of_a_driver_that_shows_nothing(hamlet, tmp_path, kind):
    with hamlet.world() as world:
        film = Film(world, hamlet.mission())
        sensed = world.reset(1)
        for _ in range(9):
            film.look(sensed, NoDriver(), Command(0.0, 0.0, state=DrivingState.HALTED, reason="says a long reason " * 9))
            sensed = world.step(1.0, 0.0)
    film.write(tmp_path / f"film.{kind}")
    size = 2 * SIZE[0], SIZE[1] + STRIP_PX
    if kind == "webp":
        with Image.open(tmp_path / "film.webp") as picture:
            assert picture.size == size and picture.n_frames == 3
    else:
        movie = cv2.VideoCapture(str(tmp_path / "film.mp4"))
        assert (movie.get(cv2.CAP_PROP_FRAME_WIDTH), movie.get(cv2.CAP_PROP_FRAME_HEIGHT)) == size
        assert movie.get(cv2.CAP_PROP_FRAME_COUNT) == 3
    assert not [path for path in tmp_path.iterdir() if path.suffix not in (".webp", ".mp4")]
