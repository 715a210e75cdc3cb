"""Self-motion from the frames alone, by visual odometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray, Frame, Observation
from hippodrome.core.views.egomotion.camera import RoadCamera, working_image, working_scale
from hippodrome.core.views.egomotion.focal import corner_pair, focal_px
from hippodrome.core.views.egomotion.odometry import RoadOdometry
from hippodrome.core.views.egomotion.static import StaticMap
from hippodrome.eval.exchange.drives.calibration import Calibration
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion, require_increasing
from hippodrome.eval.exchange.drives.images import decode

LEARNING_FRAMES: Final = 600  # frames that are looked at twice at most, to know the camera before the first of them counts
FOCAL_PAIRS: Final = 300  # pairs of frames, all over the drive, that are looked at for the focal length
STANDING_MPS: Final = 0.1  # a slower vehicle stands


@dataclass(frozen=True, slots=True, eq=False)
class SeenMotion:
    """Self-motion as the frames show it, and what they have shown of the camera."""

    motion: Motion
    notes: tuple[str, ...]  # lines to print


def pinhole(focal: float | None, calibration: Calibration | None, size_px: tuple[int, int]) -> FloatArray | None:
    """The matrix (3, 3) of a camera with frames of this size: as calibrated, else of its focal length; None without either."""
    if calibration is not None:
        return calibration.matrix
    if not focal or focal <= 0.0:
        return None
    return np.array([[focal, 0.0, 0.5 * (size_px[0] - 1)], [0.0, focal, 0.5 * (size_px[1] - 1)], [0.0, 0.0, 1.0]])


def seen_focal_px(frames: Sequence[ForeignFrame]) -> float | None:
    """The focal length that frames show between which the camera turns, in pixels of the frames; None if they do not tell it.

    Raises ExchangeError if a frame cannot be read.
    """
    pairs = []
    scale, size_px = 1.0, (0, 0)
    for number in np.unique(np.linspace(0, len(frames) - 2, FOCAL_PAIRS).astype(int)) if len(frames) > 1 else ():
        images = [decode(frame) for frame in frames[number : number + 2]]
        before, after = (working_image(image) for image in images)
        if before.shape == after.shape:
            pairs.append(corner_pair(before, after))
            scale, size_px = working_scale(images[0].shape[1]), (before.shape[1], before.shape[0])
    found = focal_px(pairs, size_px)
    return None if found is None else found / scale


def visual_motion(
    frames: Sequence[ForeignFrame], camera: RoadCamera, size_px: tuple[int, int], undistort: Callable[[Frame], Frame]
) -> SeenMotion:
    """Speed (m/s, if the camera's height is right) and yaw rate between the frames, decoded one at a time.

    The first frames are looked at twice: once to learn the horizon and what moves along with the camera, then for the motion.

    Args:
        frames: The drive's, at least 3.
        camera: What is known of the camera.
        size_px: Width and height that every frame must have.
        undistort: Takes a frame as recorded.

    Raises:
        ExchangeError: There are too few frames, or one cannot be read.
    """
    if len(frames) < 3:
        raise ExchangeError(f"{len(frames)} frame(s), at least 3 are needed for --odometry visual")
    require_increasing(np.array([frame.t_s for frame in frames]), "frames")
    first = RoadOdometry(camera)
    for observation in _observations(frames[:LEARNING_FRAMES], size_px, undistort):
        first.step(observation)
        if first.knows_camera:
            break
    odometry = RoadOdometry(*first.learned())
    found = []
    for observation in _observations(frames, size_px, undistort):
        seen = odometry.step(observation)
        found.append((seen.t_s, seen.speed, seen.yaw_rate_radps))
    table = np.array(found[1:])  # the first frame shows no motion
    motion = Motion(table[:, 0], table[:, 1], table[:, 2])
    return SeenMotion(motion, _notes(motion, *odometry.learned(), len(frames)))


def _observations(
    frames: Sequence[ForeignFrame], size_px: tuple[int, int], undistort: Callable[[Frame], Frame]
) -> Iterator[Observation]:
    """The frames as observations that know nothing of the motion."""
    last_s = frames[0].t_s - (frames[1].t_s - frames[0].t_s)
    for frame in frames:
        image = undistort(decode(frame))
        if (image.shape[1], image.shape[0]) != size_px:
            raise ExchangeError(f"{frame.name}: {image.shape[1]} x {image.shape[0]} pixels, expected {size_px[0]} x {size_px[1]}")
        yield Observation(t_s=frame.t_s, dt_s=frame.t_s - last_s, speed=0.0, yaw_rate_radps=0.0, frame=image)
        last_s = frame.t_s


def _notes(motion: Motion, camera: RoadCamera, static: StaticMap | None, count: int) -> tuple[str, ...]:
    """What the frames have shown, in words."""
    right, down = camera.heading
    row = camera.matrix[1, 2] + camera.matrix[1, 1] * down
    share = 0.0 if static is None else float((static.mask > 0).mean())
    return (
        f"of the camera the frames show: horizon at row {row:.0f}, pitched {abs(math.degrees(math.atan(down))):.1f} degrees "
        f"{'up' if down > 0.0 else 'down'}, turned {abs(math.degrees(math.atan(right))):.1f} degrees to the "
        f"{'left' if right > 0.0 else 'right'} of where it is driven to; {share:.0%} of the picture moves along with it",
        f"the vehicle stands in {np.count_nonzero(np.abs(motion.speed) < STANDING_MPS)} of {count} frames",
    )
