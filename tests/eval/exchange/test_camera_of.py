"""The camera of a recording that comes from elsewhere: one that ours cannot be is a sentence, whatever its manifest says."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from hippodrome.eval.exchange.drives.camera import camera_of
from hippodrome.sim.recording import RecordingError


def drive(**camera):
    return SimpleNamespace(folder=Path("there"), manifest={"camera": camera})


def test_a_camera_whose_calibration_is_unknown_is_none():
    assert camera_of(drive(width=640, height=480)) is None
    assert camera_of(drive(width=640, height=480, fov_deg=80.0)).width == 640


@pytest.mark.parametrize(
    ("odd", "words"),
    [
        ({"width": 5312}, "camera.width: must be a number of at most 4096, not 5312"),
        ({"rate_hz": 960.0}, "camera.rate_hz: must be a number of at most 200, not 960.0"),
        ({"fov_deg": None}, "camera.fov_deg: must be a number, not null"),
        ({"focal": 3}, "camera.focal: unknown key"),
    ],
)
def test_one_that_ours_cannot_be_is_told_with_the_cure(odd, words):
    with pytest.raises(RecordingError) as caught:
        camera_of(drive(**{"width": 640, "height": 480, "fov_deg": 80.0, **odd}))
    assert str(caught.value).startswith(f"there/manifest.json: {words}")
    assert "import the drive anew" in str(caught.value)
