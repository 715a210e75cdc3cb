"""Messages of MCAP files and ROS bags: which topics are used, their clocks, velocities and pictures."""

import zlib

import cv2
import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame
from hippodrome.eval.exchange.drives.images import decode
from hippodrome.eval.exchange.readers.messages import OdometryRow, PoseRow, Stamped, choose, in_order, motion_of_odometry
from hippodrome.eval.exchange.readers.pixels import ENCODINGS, png_of


def test_topics_are_chosen_by_their_use(tmp_path):
    topics = {
        "/depth": ("images", "Image"), "/rear": ("images", "Image"), "/front": ("images", "Image"),
        "/wheels": ("odometry", "Odometry"), "/fused": ("odometry", "Odometry"), "/pose": ("poses", "Pose"), "/imu": ("", "Imu"),
    }  # fmt: skip
    found = choose(tmp_path, topics, [])
    assert (found.images, found.odometry, found.truth) == ("/rear", "/wheels", None)
    found = choose(tmp_path, topics, ["/depth", "/fused", "/pose"])
    assert (found.images, found.odometry, found.truth) == ("/depth", "/fused", "/pose")
    found = choose(tmp_path, topics, ["/fused", "/wheels"])
    assert (found.odometry, found.truth) == ("/fused", "/wheels")
    assert choose(tmp_path, topics, ["/pose"]).odometry == "/wheels"
    for wrong, complaint in ((["/imu"], "neither images"), (["/depth", "/front"], "more than one camera")):
        with pytest.raises(HippodromeError, match=complaint):
            choose(tmp_path, topics, wrong)


def stamped(times_s, values=None):
    values = values or times_s
    return [Stamped(int(t * 1e9), zlib.crc32(repr(v).encode()), v) for t, v in zip(times_s, values, strict=True)]


def test_one_drive_has_one_clock(capsys):
    assert [one.value for one in in_order(stamped([0.1, 0.2, 0.2, 0.3]), "log: /odom")] == [0.1, 0.2, 0.3]
    assert "1 message(s) that repeat" in capsys.readouterr().out
    assert [one.value for one in in_order(stamped([0.1, 0.3, 0.2, 0.4]), "log: /odom")] == [0.1, 0.2, 0.3, 0.4]
    assert "1 message(s) that came late" in capsys.readouterr().out
    two = [*np.arange(0.1, 9.0, 0.1), *np.arange(0.1, 9.0, 0.1)]
    with pytest.raises(HippodromeError, match=r"8\.800 s earlier than one before it: more than one drive"):
        in_order(stamped(two), "log: /odom")
    with pytest.raises(HippodromeError, match="with other content"):
        in_order(stamped(sorted(two), list(range(len(two)))), "log: /odom")


def odometry(speed, yaw_rate, moving, filled=True):
    rows = []
    for number in range(30):
        turn = 0.03 * number * moving
        at = (10.0 * np.sin(turn), 10.0 * (1.0 - np.cos(turn)), 0.0)
        attitude = (0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)) if filled else (0.0,) * 4
        rows.append(OdometryRow(PoseRow(at, attitude), speed, yaw_rate))
    return stamped([0.1 * number for number in range(30)], rows)


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "moving", "filled", "found"),
    [
        (3.0, 0.3, 1, True, (3.0, 0.3)), (0.0, 0.0, 1, True, (3.0, 0.3)), (0.0, 0.3, 1, True, (3.0, 0.3)),
        (3.0, 0.0, 1, True, (3.0, 0.3)), (0.0, 0.0, 0, True, (0.0, 0.0)), (3.0, 0.0, 0, True, (3.0, 0.0)),
        (0.0, 0.0, 1, False, (0.0, 0.0)),
    ],
)  # fmt: skip
def test_empty_velocities_are_made_of_the_poses(speed, yaw_rate, moving, filled, found):
    motion = motion_of_odometry(odometry(speed, yaw_rate, moving, filled), "log: /odom")
    assert motion.speed == pytest.approx(found[0], abs=1e-3)
    assert motion.yaw_rate_radps == pytest.approx(found[1], abs=1e-9)


def test_every_encoding_shows_the_picture():
    """A colour that is the same all over comes back from each encoding, through OpenCV's own conversions there and back."""
    blue, green, red = 200, 120, 40
    bgr = np.tile(np.array([blue, green, red], np.uint8), (16, 20, 1))
    grey = int(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)[0, 0])
    for encoding, (channels, size, _) in ENCODINGS.items():
        image = np.full((16, 20, channels), grey, np.uint8)
        if encoding.startswith(("bgr", "8UC3", "8UC4")):
            image[:, :, :3] = bgr
        elif encoding.startswith("rgb"):
            image[:, :, :3] = bgr[:, :, ::-1]
        elif encoding.startswith("bayer"):
            value = {"r": red, "g": green, "b": blue}
            cells = [value[letter] for letter in encoding[6:10]]
            image = np.tile(np.array(cells, np.uint8).reshape(2, 2, 1), (8, 10, 1))
        elif channels == 2:
            image[:, :, :] = [128, grey] if encoding in ("uyvy", "yuv422") else [grey, 128]
        rows = image.reshape(16, -1)
        if size == 2:
            rows = np.stack([np.zeros_like(rows), rows], axis=2).reshape(16, -1)
        found = decode(ForeignFrame(0.0, "test", lambda r=rows, e=encoding: png_of(r.tobytes(), e, 20, 16, r.shape[1], "test")))
        coloured = encoding.startswith(("bgr", "rgb", "8UC3", "8UC4", "bayer"))
        expected = [red, green, blue] if coloured else [grey] * 3
        assert np.abs(found.astype(int) - expected).max() <= (3 if channels == 2 else 0), encoding
    big = np.stack([rows * 0 + 77, rows * 0], axis=2).astype(np.uint8)[:, :20].reshape(16, -1)
    found = decode(ForeignFrame(0.0, "test", lambda: png_of(big.tobytes(), "mono16", 20, 16, 40, "test", big_endian=True)))
    assert (found == 77).all()


def test_images_of_impossible_size_are_refused():
    for size, complaint in (((2**20, 2**10), "do not hold"), ((1, 1), "at least 2"), ((9, 4), "pairs")):
        with pytest.raises(HippodromeError, match=complaint):
            png_of(bytes(400), "yuyv", *size, 2 * size[0], "test")
