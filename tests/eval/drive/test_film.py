"""A film in MP4 is whole, or refused: OpenCV says nothing where the disk is full."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.drive import film

PICTURES = [np.full((64, 96, 3), 20 * number, dtype=np.uint8) for number in range(9)]


def test_a_film_is_whole(tmp_path):
    film._write_mp4(tmp_path / "a.mp4", PICTURES)
    assert film._pictures_in(tmp_path / "a.mp4") == len(PICTURES)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


@pytest.mark.parametrize("written", [0, 6])
def test_a_film_that_was_cut_short_is_refused(tmp_path, monkeypatch, written):
    class Writer:
        """As OpenCV's on a full disk: it takes all pictures, and writes some."""

        def __init__(self, *arguments):
            self._writer, self._left = whole(*arguments), written

        def write(self, picture):
            if self._left:
                self._writer.write(picture)
            self._left = max(self._left - 1, 0)

        def __getattr__(self, name):
            return getattr(self._writer, name)

    whole = film.cv2.VideoWriter
    Writer.fourcc = whole.fourcc
    monkeypatch.setattr(film.cv2, "VideoWriter", Writer)
    with pytest.raises(HippodromeError, match=f"{written} of 9 pictures of an MP4 were written; free some space"):
        film._write_mp4(tmp_path / "a.mp4", PICTURES)
    assert not list(tmp_path.iterdir())
