"""The tracker as a program of the stream; runs in its own environment, by that environment's Python, and imports no hippodrome.

    python runner.py MESSAGES VOCABULARY SETTINGS FOLDER [paced] < stream > stream

MESSAGES is the module that ``proto/method_stream.proto`` was compiled to. In FOLDER, which becomes the working directory, the
tracker saves its map and loads it from. After mapping there are ``final.tum`` and ``keyframes.tum``, the tracker's own
trajectories of its camera after all optimisation; ``own.json`` has what it took, without loading and saving.

To localize, the tracker maps until its map has merged with the loaded one, and from then on tracks in that map alone. If it were
in localization mode from the first frame on, it would search its own new and empty map only.
"""

import importlib.util
import json
import os
import resource
import sys
import time
from math import atan2, cos, sin
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed
from pyorbslam3 import Sensor, Slam

SETTLE_S = 5.0  # time at the end for local mapping and loop closing, which lag behind the tracker
GREY = np.array([0.299, 0.587, 0.114])  # weights of red, green and blue


def main() -> None:
    """Answer the messages of one drive, save, report."""
    messages, vocabulary, settings, folder, *paced = sys.argv[1:]
    source: Any = sys.stdin.buffer
    sink: Any = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the tracker prints goes to the log
    os.chdir(folder)  # it takes the names of map files without a folder only
    spec = importlib.util.spec_from_file_location("method_stream_pb2", messages)
    assert spec is not None
    assert spec.loader is not None
    pb = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pb)

    def asked() -> Any:
        return parse_length_prefixed(pb.ToMethod, source)

    def answer(**message: Any) -> None:
        serialize_length_prefixed(pb.FromMethod(**message), sink)
        sink.flush()

    begin = asked().begin
    localizes, ahead_m = begin.phase == pb.Begin.LOCALIZE, begin.camera.ahead_of_rear_axle_m
    slam = Slam(vocabulary, settings, Sensor.STEREO, use_viewer=False)
    loaded_s, began = cpu_s(), time.monotonic()
    answer(ready=pb.Ready(version=1))
    merged, frames, tracked, first_t_s = False, 0, 0, None
    while (message := asked()).WhichOneof("message") == "observation":
        one = message.observation
        if not one.right_pixels:
            answer(answer=pb.Answer())
            continue
        first_t_s = one.t_s if first_t_s is None else first_t_s
        if paced:
            time.sleep(max(0.0, began + one.t_s - first_t_s - time.monotonic()))
        result = slam.track_stereo(grey(one, one.pixels), grey(one, one.right_pixels), one.t_s)
        frames, tracked = frames + 1, tracked + int(result.ok)
        known = result.ok and (merged or not localizes)
        pose = body_pose(np.asarray(result.pose_wc, dtype=np.float64), ahead_m) if result.ok else (0.0, 0.0, 0.0)
        if localizes and not merged and slam.map_changed() and frames > 1:
            merged = True  # from the next frame on, poses are the loaded map's
            slam.activate_localization_mode()
        answer(answer=pb.Answer(known=known, pose=pb.Pose(x=pose[0], y=pose[1], heading_rad=pose[2])))
    if not localizes:
        time.sleep(SETTLE_S)
    Path("own.json").write_text(json.dumps({"cpu_s": cpu_s() - loaded_s, "peak_rss_bytes": peak_rss_bytes()}) + "\n")
    slam.shutdown()
    if tracked and not localizes:
        slam.save_trajectory_tum("final.tum")
        slam.save_keyframe_trajectory_tum("keyframes.tum")
    answer(finished=pb.Finished())


def grey(one: Any, pixels: bytes) -> np.ndarray:
    """A grey image (H, W) of an observation."""
    image = np.frombuffer(pixels, np.uint8).reshape(one.height, one.width, one.channels)
    return image[:, :, 0].copy() if one.channels == 1 else (image @ GREY).astype(np.uint8)


def body_pose(camera: np.ndarray, ahead_m: float) -> tuple[float, float, float]:
    """Pose of the rear axle in the plane, of that of the camera (4, 4), whose world has x to the right, y down, z ahead."""
    heading = atan2(-camera[0, 2], camera[2, 2])
    return float(camera[2, 3] - ahead_m * cos(heading)), float(-camera[0, 3] - ahead_m * sin(heading)), heading


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
