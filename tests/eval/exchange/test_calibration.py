"""Calibrations in the formats that people have, and what they do to frames."""

import json

import cv2
import numpy as np
import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.calibration import Calibration, scaled, undistorter
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.readers.calibration import read_calibration

MATRIX = np.array([[40.0, 0.0, 31.5], [0.0, 41.0, 23.5], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.3, 0.1, 0.001, 0.002, 0.0])
ROS = """image_width: 64
image_height: 48
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [40, 0, 31.5, 0, 41, 23.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0.001, 0.002, 0]}
"""


def opencv_yaml(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 64)
    storage.write("image_height", 48)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", DISTORTION)
    storage.release()


def test_opencv_and_ros(tmp_path):
    opencv_yaml(tmp_path / "cv.yaml")
    (tmp_path / "ros.yaml").write_text(ROS)
    for name in ("cv.yaml", "ros.yaml"):
        found = read_calibration(tmp_path / name)
        assert np.array_equal(found.matrix, MATRIX)
        assert np.array_equal(found.distortion, DISTORTION)
        assert found.size_px == (64, 48)
        assert found.distorted


@pytest.mark.parametrize(
    "text",
    [
        "40 0 31.5\n0 41 23.5\n0 0 1\n",
        "K = np.array([[4e1,0,31.5],\n [0,41,2.35e1],\n [0,0,1]])\n\nCamera height: 1.65 m\n",
        "P0: 1 0 9 0 0 1 9 0 0 0 1 0\nP2: 40 0 31.5 4 0 41 23.5 0 0 0 1 0\n",
        "resolution: [64, 48]\nintrinsics: [40, 41, 31.5, 23.5]\n",
    ],
)
def test_pinholes(tmp_path, text):
    (tmp_path / "c.txt").write_text(text)
    found = read_calibration(tmp_path / "c.txt")
    assert np.allclose(found.matrix, MATRIX)
    assert not found.distorted


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "0 numbers, expected 9"),
        ("1 2 3", "3 numbers, expected 9"),
        ("P2: 1 2 3", "3 numbers, expected 12"),
        ("1 2 3 4 5 6 7 8 9", "not a camera matrix"),
        ("camera_matrix: [1, 2]", "2 numbers in a matrix of 9"),
        ("a: b", "no camera_matrix in it"),
        ("a: [", "not valid YAML"),
        (ROS.replace("0.002, 0]", "0.002, 0, 7]"), "6 distortion coefficients"),
        (ROS.replace("[40,", "[many,"), "not numbers"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path, text, complaint):
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(ExchangeError, match=complaint):
        read_calibration(tmp_path / "c.yaml")


def test_a_calibration_of_larger_frames_is_scaled_and_one_of_others_refused():
    full = Calibration(np.diag([2.0, 2.0, 1.0]) @ MATRIX, DISTORTION, (128, 96))
    assert np.allclose(scaled(full, (64, 48), "c").matrix, MATRIX)
    with pytest.raises(ExchangeError, match="of another shape"):
        scaled(full, (64, 64), "c")
    with pytest.raises(ExchangeError, match="principal point"):
        scaled(Calibration(MATRIX, DISTORTION, None), (24, 18), "c")


def test_straight_lines_become_straight():
    """Points of a straight line, drawn where the distorted lens sees them, lie on a straight line afterwards."""
    matrix, size = np.array([[400.0, 0.0, 319.5], [0.0, 400.0, 239.5], [0.0, 0.0, 1.0]]), (640, 480)
    line = np.column_stack([np.linspace(-0.6, 0.6, 4000), np.full(4000, 0.4), np.ones(4000)])
    seen = cv2.projectPoints(line, np.zeros(3), np.zeros(3), matrix, DISTORTION)[0].reshape(-1, 2)
    image = np.zeros((480, 640, 3), np.uint8)
    for x, y in np.round(seen).astype(int):
        if 0 <= x < 640 and 0 <= y < 480:
            image[y, x] = 255
    rows, _ = np.nonzero(undistorter(Calibration(matrix, DISTORTION, None), size)(image)[:, :, 0] > 100)
    assert np.ptp(seen[:, 1]) > 10.0
    assert np.abs(rows - 399.5).max() < 3.0


def test_an_import_keeps_the_intrinsics_and_frees_frames_of_distortion(tmp_path, capsys):
    rng = np.random.default_rng(1)
    (tmp_path / "seq").mkdir()
    for number in range(4):
        cv2.imwrite(str(tmp_path / "seq" / f"{number}.png"), rng.integers(0, 256, (48, 64, 3), np.uint8))
    (tmp_path / "o.csv").write_text("".join(f"{0.1 * number},5,0\n" for number in range(5)))
    (tmp_path / "ros.yaml").write_text(ROS)
    given = ["import", str(tmp_path / "seq"), "--fps", "10", "--odometry", str(tmp_path / "o.csv"), "--size", "32x24"]
    assert main([*given, "--calibration", str(tmp_path / "ros.yaml"), "--out", str(tmp_path / "in")]) == DONE
    manifest = json.loads((tmp_path / "in" / "manifest.json").read_text())
    assert manifest["imported"]["calibration"] == {
        "focal_px": [20.0, 20.5], "principal_px": [15.75, 11.75], "undistorted": True
    }  # fmt: skip
    assert manifest["camera"]["fov_deg"] == pytest.approx(np.degrees(2 * np.arctan(32 / 40)))
    assert main([*given, "--calibration", str(tmp_path / "none.yaml"), "--out", str(tmp_path / "in2")]) == BAD_INPUT
    assert "none.yaml" in capsys.readouterr().err
