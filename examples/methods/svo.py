"""SVO, the semi-direct visual odometry of Forster et al. (2014), as a program: the package svo-cpp in an environment of its own.

hippodrome eval my-town.yaml --out out/svo      # with this in my-town.yaml:

    camera: {width: 640, height: 480, grain: true}
    methods:
      SVO:
        command: "{python} examples/methods/svo.py {sequence} {out}"
        environment: examples/methods/svo-requirements.txt
        needs: [640x480, grain]

One camera has no scale, and SVO begins anew where it loses its way. So each stretch that it tracks gets the length that the
wheels say, and between two stretches the wheels and the gyro lead on. It wants frames of 640x480 at 10 Hz, with grain.
"""

import json
import math
import sys
from pathlib import Path

import cv2
import numpy as np
import svo_cpp

# Made for a drone that looks down. Where a car looks ahead, corners move less between the first two frames, and more are lost.
CONFIG = {"init_min_disparity": 15.0, "quality_min_fts": 25, "quality_max_drop_fts": 100, "max_fts": 300, "grid_size": 20}
PATIENCE = 30  # frames in which it shall find a beginning


def main(sequence, out):
    """Write ``trajectory.tum`` of the drive in ``sequence`` into ``out``."""
    camera = json.loads((sequence / "camera.json").read_text())
    frames = [line.split() for line in (sequence / "rgb.txt").read_text().splitlines() if not line.startswith("#")]
    times = np.array([float(t_s) for t_s, _ in frames])
    wheels = integrated(np.loadtxt(sequence / "odometry.csv", delimiter=","), times)
    seen = tracked(camera, times, [sequence / name for _, name in frames])
    poses = joined(wheels, seen)
    turned = np.column_stack([np.zeros((len(poses), 3)), np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)])
    np.savetxt(out / "trajectory.tum", np.column_stack([times, poses[:, :2], turned]), fmt="%.9f")
    print(f"SVO tracked {np.isfinite(seen[:, 0]).sum()} of {len(seen)} frames")


def tracked(camera, times, paths):
    """SVO's camera (N, 4) from where its stretch began: ahead, to the left, turned; and the stretch's number. NaN: lost."""
    focal_px, (x_px, y_px) = camera["focal_px"], camera["centre_px"]
    svo_cpp.set_svo_config(CONFIG)
    svo = svo_cpp.SVO(svo_cpp.PinholeCamera(camera["width"], camera["height"], focal_px, focal_px, x_px, y_px))
    svo.start()
    seen, stretch, since = np.full((len(paths), 4), np.nan), 0, 0
    for i, (t_s, path) in enumerate(zip(times, paths, strict=True)):
        svo.addImage(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), float(t_s))
        if svo.stage() == svo_cpp.Stage.DEFAULT_FRAME:
            pose = svo.lastFrame().T_f_w
            right, _, ahead = np.ravel(pose.inverse().translation())
            # The binding gives no rotation. A camera that turns about its vertical axis alone shows it by where its origin is.
            back_right, _, back = -np.ravel(pose.translation())
            turned = math.atan2(-back_right, back) - math.atan2(-right, ahead)
            seen[i] = ahead, -right, -turned if math.hypot(ahead, right) > 0 else 0.0, stretch
        lost = i > 0 and np.isfinite(seen[i - 1, 0]) and not np.isfinite(seen[i, 0])
        if lost or (not np.isfinite(seen[i, 0]) and i - since > PATIENCE):
            stretch, since = stretch + 1, i  # what it finds from now on has another scale
            svo.reset()
            svo.start()
    return seen


def integrated(odometry, times):
    """Poses (N, 3) at ``times`` by wheels and gyro alone."""
    t_s, speed, yaw_rate = odometry.T
    dt_s = np.diff(t_s, prepend=0.0)
    heading = np.cumsum(yaw_rate * dt_s)
    x, y = np.cumsum(speed * dt_s * np.cos(heading)), np.cumsum(speed * dt_s * np.sin(heading))
    return np.column_stack([np.interp(times, t_s, column) for column in (x, y, heading)])


def joined(wheels, seen):
    """Poses (N, 3): from frame to frame by SVO where it has both, scaled to the wheels' way; by wheels and gyro elsewhere."""
    way, turn = np.hypot(*np.diff(wheels[:, :2], axis=0).T), np.diff(wheels[:, 2])
    for number in np.unique(seen[np.isfinite(seen[:, 3]), 3]):
        at = np.flatnonzero(seen[:, 3] == number)
        length = np.hypot(*np.diff(seen[at, :2], axis=0).T)
        if length.sum() > 0.0:
            way[at[:-1]] = length * way[at[:-1]].sum() / length.sum()
            known = np.hypot(*seen[at, :2].T) > 0.05 * length.sum()  # near its origin, a place does not tell the turn
            turned = np.remainder(np.diff(seen[at, 2]) + math.pi, 2 * math.pi) - math.pi
            turn[at[:-1]] = np.where(known[1:] & known[:-1], turned, turn[at[:-1]])
    heading = np.append(0.0, np.cumsum(turn))
    course = heading[1:] - turn / 2
    return np.column_stack(
        [np.append(0.0, np.cumsum(way * np.cos(course))), np.append(0.0, np.cumsum(way * np.sin(course))), heading]
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
