"""Runs in the tracker's own environment, by that environment's Python: imports nothing of hippodrome.

    python runner.py VOCABULARY.txt SETTINGS.yaml WIDTH HEIGHT PACED < frames

Standard input: per frame the time stamp (float64, little endian), then the left and the right image, grey bytes. The working
directory receives ``live.tum`` (each pose as it was when its frame came), ``final.tum`` and ``keyframes.tum`` (after all
optimisation) and, last of all, ``result.json``: without it the run did not end well.
"""

import json
import resource
import sys
import time
from pathlib import Path
from typing import BinaryIO

import numpy as np
from pyorbslam3 import Sensor, Slam

SETTLE_S = 5.0  # for local mapping and loop closing, which run behind the tracker


def main() -> None:
    """Track every frame of standard input, save, report."""
    vocabulary, settings, width, height, paced = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5] == "1"
    slam = Slam(vocabulary, settings, Sensor.STEREO, use_viewer=False)
    loaded_s, began = cpu_s(), time.monotonic()
    live: list[str] = []
    frames, first_t_s, longest_s = 0, 0.0, 0.0
    while (pair := read_pair(sys.stdin.buffer, width, height)) is not None:
        t_s, left, right = pair
        first_t_s = t_s if frames == 0 else first_t_s
        if paced:
            time.sleep(max(0.0, began + t_s - first_t_s - time.monotonic()))
        asked = time.monotonic()
        result = slam.track_stereo(left, right, t_s)
        longest_s = max(longest_s, time.monotonic() - asked)
        frames += 1
        if result.ok:
            live.append(tum_line(t_s, np.asarray(result.pose_wc, dtype=np.float64)))
    time.sleep(SETTLE_S)
    tracked_s, wall_s = cpu_s(), time.monotonic() - began
    slam.shutdown()
    Path("live.tum").write_text("\n".join(live) + "\n")
    if live:
        slam.save_trajectory_tum("final.tum")
        slam.save_keyframe_trajectory_tum("keyframes.tum")
    atlas = sorted(Path().glob("*.osa"))
    report = {
        "frames": frames,
        "tracked": len(live),
        "cpu_s": tracked_s - loaded_s,
        "loading_cpu_s": loaded_s,
        "wall_s": wall_s,
        "longest_frame_s": longest_s,
        "peak_rss_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        "map_bytes": atlas[0].stat().st_size if atlas else None,
    }
    Path("result.json").write_text(json.dumps(report, indent=1) + "\n")


def read_pair(stream: BinaryIO, width: int, height: int) -> tuple[float, np.ndarray, np.ndarray] | None:
    """The next time stamp and pair of grey images (H, W); None at the end."""
    size = width * height
    data = stream.read(8 + 2 * size)
    if len(data) < 8 + 2 * size:
        return None
    images = np.frombuffer(data, np.uint8, 2 * size, offset=8).reshape(2, height, width)
    return float(np.frombuffer(data, "<f8", 1)[0]), images[0].copy(), images[1].copy()


def tum_line(t_s: float, pose: np.ndarray) -> str:
    """``t x y z qx qy qz qw`` of a pose (4, 4)."""
    x, y, z = (float(value) for value in pose[:3, 3])
    return " ".join(repr(value) for value in (t_s, x, y, z, *quaternion(pose[:3, :3])))


def quaternion(r: np.ndarray) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a rotation (3, 3): the eigenvector of Bar-Itzhack's matrix, stable at every angle."""
    k = np.array([
        [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
        [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
        [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    x, y, z, w = np.linalg.eigh(k)[1][:, -1]
    return float(x), float(y), float(z), float(w)


def cpu_s() -> float:
    """User and system time of this process, all threads."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
