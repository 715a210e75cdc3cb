"""Runs in the tracker's own environment, by that environment's Python: imports nothing of hippodrome.

    python runner.py JOB.json < frames

The job names vocabulary, settings, width, height, whether to pace the frames, and whether to localize in the map that the
settings load. Standard input: per frame the time stamp (float64, little endian), then the left and the right image, grey bytes.
The working directory receives ``live.tum`` (each pose as it was reported when its frame came), ``steps.txt`` (per frame: time
stamp, whether tracked, whether in the loaded map, CPU seconds so far), after mapping also ``final.tum`` and ``keyframes.tum``
(after all optimisation), and at the very end ``result.json``: without it the run did not end well.

To localize, the tracker maps until its map has merged with the loaded one, and from then on tracks in that map alone. If it were
in localization mode from the first frame on, it would search its own new and empty map only.
"""

import json
import resource
import sys
import time
from pathlib import Path
from typing import BinaryIO

import numpy as np
from pyorbslam3 import Sensor, Slam

SETTLE_S = 5.0  # time at the end for local mapping and loop closing, which lag behind the tracker


def main() -> None:
    """Track every frame of standard input, save, report."""
    job = json.loads(Path(sys.argv[1]).read_text())
    slam = Slam(job["vocabulary"], job["settings"], Sensor.STEREO, use_viewer=False)
    loaded_s, began = cpu_s(), time.monotonic()
    live: list[str] = []
    steps: list[str] = []
    first_t_s, longest_s, merged = None, 0.0, False
    while (pair := read_pair(sys.stdin.buffer, job["width"], job["height"])) is not None:
        t_s, left, right = pair
        first_t_s = t_s if first_t_s is None else first_t_s
        if job["paced"]:
            time.sleep(max(0.0, began + t_s - first_t_s - time.monotonic()))
        asked = time.monotonic()
        result = slam.track_stereo(left, right, t_s)
        longest_s = max(longest_s, time.monotonic() - asked)
        steps.append(f"{t_s!r} {int(result.ok)} {int(merged)} {cpu_s() - loaded_s:.6f}")
        if result.ok:
            live.append(tum_line(t_s, np.asarray(result.pose_wc, dtype=np.float64)))
        if job["localize"] and not merged and slam.map_changed() and len(steps) > 1:
            merged = True  # from the next frame on, poses are the loaded map's
            slam.activate_localization_mode()
    if not job["localize"]:
        time.sleep(SETTLE_S)
    tracked_s, wall_s, memory = cpu_s(), time.monotonic() - began, peak_rss_bytes()
    slam.shutdown()
    Path("live.tum").write_text("\n".join(live) + "\n")
    Path("steps.txt").write_text("\n".join(steps) + "\n")
    if live and not job["localize"]:
        slam.save_trajectory_tum("final.tum")
        slam.save_keyframe_trajectory_tum("keyframes.tum")
    atlas = [] if job["localize"] else sorted(Path().glob("*.osa"))
    report = {
        "frames": len(steps),
        "tracked": len(live),
        "cpu_s": tracked_s - loaded_s,
        "loading_cpu_s": loaded_s,
        "wall_s": wall_s,
        "longest_frame_s": longest_s,
        "peak_rss_bytes": memory,
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
    """Quaternion (x, y, z, w) of a rotation (3, 3): an eigenvector of Bar-Itzhack's matrix, stable at every angle."""
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


def peak_rss_bytes() -> int:
    """The most memory of this process; ``ru_maxrss`` would count the process that started it as well."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


if __name__ == "__main__":
    main()
