"""Self-motion from the frames alone, by visual odometry."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hippodrome.core.types import Frame, Observation
from hippodrome.core.views.odometry import CameraGeometry, VisualOdometry
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion, require_increasing
from hippodrome.eval.exchange.drives.images import decode


def visual_motion(
    frames: Sequence[ForeignFrame], geometry: CameraGeometry, size_px: tuple[int, int] | None, undistort: Callable[[Frame], Frame]
) -> Motion:
    """Speed (m/s, if the camera's height is right) and yaw rate between the frames, decoded one at a time.

    Args:
        frames: The drive's, at least 3.
        geometry: Field of view and place of the camera.
        size_px: Width and height that every frame must have; None: that of the first.
        undistort: Takes a frame as recorded.

    Raises:
        ExchangeError: There are too few frames, or one cannot be read.
    """
    if len(frames) < 3:
        raise ExchangeError(f"{len(frames)} frame(s), at least 3 are needed for --odometry visual")
    t_s = np.array([frame.t_s for frame in frames])
    require_increasing(t_s, "frames")
    odometry, found = VisualOdometry(geometry), []
    for number, frame in enumerate(frames):
        image = undistort(decode(frame))
        size_px = size_px or (image.shape[1], image.shape[0])
        if (image.shape[1], image.shape[0]) != size_px:
            raise ExchangeError(f"{frame.name}: {image.shape[1]} x {image.shape[0]} pixels, expected {size_px[0]} x {size_px[1]}")
        dt_s = float(t_s[number] - t_s[number - 1]) if number else float(t_s[1] - t_s[0])
        seen = odometry.step(Observation(t_s=frame.t_s, dt_s=dt_s, speed=0.0, yaw_rate_radps=0.0, frame=image))
        found.append((seen.speed, seen.yaw_rate_radps))
    table = np.array(found[1:])  # the first frame shows no motion
    return Motion(t_s[1:], table[:, 0], table[:, 1])
