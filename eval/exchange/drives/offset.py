"""The offset between two clocks, told by turns that both saw: of wheels or a gyroscope, of the truth, of the camera's frames.

The turns of the two are correlated at every offset at which they overlap. An offset is believed where the correlation is high and
no other offset has one nearly as high: a drive that hardly turns, or that goes round and round, tells none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from hippodrome.core.types import FloatArray, Frame, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion
from hippodrome.eval.exchange.drives.images import decode

TimeOffset: TypeAlias = float | Literal["auto"]

STEP_S: Final = (0.02, 0.5)  # least and largest step of the common time grid
LEAST_OVERLAP_S: Final = 20.0  # and half of the shorter of the two
LEAST_TURN_RAD: Final = 1.0  # sum of the turns of the self-motion, without which there is nothing to correlate
LEAST_CORRELATION: Final = 0.5
LEAD: Final = 0.15  # how far the best correlation is above that of any offset that is no neighbour of it
NEIGHBOUR_S: Final = 3.0  # offsets nearer than this to the best one see the same turns
MAX_STEPS: Final = 2_000_000  # of the grid
WIDTH_PX: Final = 320  # largest width at which frames are compared
FARTHEST_SHIFT_PX: Final = 60.0  # between two frames; what is farther is a mistake
UPPER_SHARE: Final = 0.6  # of the height: below is the road, which moves with the drive


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """An angle that grows with the turns to the left, in any unit, at increasing times."""

    t_s: FloatArray  # (N,)
    angle: FloatArray  # (N,)
    name: str  # for people: "the frames", "the truth"


@dataclass(frozen=True, slots=True)
class Offset:
    """Seconds to add to the times of the one to lay them on those of the other, and how sure that is."""

    seconds: float
    correlation: float
    next_best: float  # correlation of the best offset that is no neighbour


def turns_of_motion(motion: Motion) -> Turns:
    """The integrated yaw rate."""
    dt_s = np.diff(motion.t_s)
    begin_s = motion.t_s[0] - float(np.median(dt_s))
    angle = np.concatenate([[0.0], np.cumsum(motion.yaw_rate_radps * np.diff(motion.t_s, prepend=begin_s))])
    return Turns(np.concatenate([[begin_s], motion.t_s]), angle, "the self-motion")


def turns_of_trajectory(trajectory: Trajectory, name: str) -> Turns:
    """The heading."""
    return Turns(trajectory.t_s, np.unwrap(trajectory.poses[:, 2]), name)


def turns_of_frames(frames: Sequence[ForeignFrame], undistort: Callable[[Frame], Frame]) -> Turns:
    """How far the picture moved to the right, which it does when the camera turns left, in pixels, frame by frame.

    Raises ExchangeError if a frame cannot be read.
    """
    shifts, before = [], None
    for frame in frames:
        after = _upper_part(undistort(decode(frame)))
        if before is not None:
            shifts.append(_shift(before, after) if after.shape == before.shape else 0.0)
        before = after
    return Turns(np.array([frame.t_s for frame in frames]), np.concatenate([[0.0], np.cumsum(shifts)]), "the frames")


def offset_between(moved: Turns, fixed: Turns, option: str = "--time-offset") -> Offset:
    """The offset that lays ``moved`` on ``fixed``, which ``told_offset`` judges; ``option`` is what would say it instead.

    Raises ExchangeError if one of them is too short, or hardly turns.
    """
    step_s = float(np.clip(max(np.median(np.diff(moved.t_s)), np.median(np.diff(fixed.t_s))) / 2.0, *STEP_S))
    first, second = _rates(moved, step_s), _rates(fixed, step_s)
    least = max(LEAST_OVERLAP_S, 0.5 * min(len(first), len(second)) * step_s) / step_s
    if min(len(first), len(second)) < least:
        raise ExchangeError(f"less than {LEAST_OVERLAP_S:g} s of {moved.name} or {fixed.name}: no offset can be told; "
                            f"give {option} SECONDS")  # fmt: skip
    lags, correlation = _correlations(first, second, least)
    best = int(np.argmax(correlation))
    shift = lags[best] + _vertex(correlation, best)
    far = np.abs(lags - lags[best]) * step_s > NEIGHBOUR_S
    next_best = float(correlation[far].max(initial=0.0))
    seconds = fixed.t_s[0] - moved.t_s[0] + shift * step_s
    return Offset(float(seconds), float(correlation[best]), next_best)


def told_offset(moved: Turns, fixed: Turns, option: str = "--time-offset") -> float:
    """The offset, which is printed with its correlation. Raises ExchangeError, naming ``option``, where it is not sure."""
    if float(np.abs(np.diff(moved.angle)).sum()) < LEAST_TURN_RAD:
        raise ExchangeError(f"{moved.name} hardly turns: no offset can be told; give {option} SECONDS")
    found = offset_between(moved, fixed, option)
    how = f"correlation of the turns of {moved.name} and of {fixed.name} {found.correlation:.2f}, {found.next_best:.2f} elsewhere"
    if found.correlation < LEAST_CORRELATION or found.correlation - found.next_best < LEAD:
        raise ExchangeError(f"no sure time offset ({how}; best {found.seconds:.3f} s); give {option} SECONDS")
    print(f"note: time offset {found.seconds:+.3f} s ({how})")
    return found.seconds


def _rates(turns: Turns, step_s: float) -> FloatArray:
    """Turn (N,) in each step of a grid that begins with the first time. Raises ExchangeError if there are too many."""
    count = (turns.t_s[-1] - turns.t_s[0]) / step_s
    if not count <= MAX_STEPS:
        raise ExchangeError(
            f"{turns.name}: {turns.t_s[-1] - turns.t_s[0]:.0f} s, too long to tell a time offset; check the clocks"
        )
    grid = turns.t_s[0] + step_s * np.arange(int(count) + 1)
    return np.diff(np.interp(grid, turns.t_s, turns.angle))


def _correlations(first: FloatArray, second: FloatArray, least: float) -> tuple[FloatArray, FloatArray]:
    """Lags of the first behind the second, in steps, and the correlation at each, where at least ``least`` steps overlap."""
    ones = np.ones(len(first)), np.ones(len(second))
    centred = first - first.mean(), second - second.mean()

    def at_lags(a: FloatArray, b: FloatArray) -> Any:
        return fftconvolve(b, a[::-1])

    overlap = at_lags(*ones)
    powers = at_lags(centred[0] ** 2, ones[1]), at_lags(ones[0], centred[1] ** 2)
    floor = 1e-3 * np.mean(centred[0] ** 2) * overlap, 1e-3 * np.mean(centred[1] ** 2) * overlap
    scale = np.sqrt(np.maximum(powers[0], floor[0]) * np.maximum(powers[1], floor[1]))
    found = np.where(scale > 0.0, at_lags(*centred) / np.where(scale > 0.0, scale, 1.0), 0.0)
    kept = overlap >= least - 0.5
    return (np.arange(len(overlap)) - (len(first) - 1.0))[kept], found[kept]


def _vertex(values: FloatArray, at: int) -> float:
    """Where a parabola through the value at ``at`` and its neighbours is highest, in steps from there."""
    if not 0 < at < len(values) - 1:
        return 0.0
    before, here, after = (float(value) for value in values[at - 1 : at + 2])
    bend = before - 2.0 * here + after
    return 0.0 if bend >= 0.0 else 0.5 * (before - after) / bend


def _upper_part(frame: Frame) -> NDArray[np.float32]:
    """The upper part of a frame, grey, at most ``WIDTH_PX`` wide: it shows what is far and moves with turns."""
    height, width = frame.shape[:2]
    grey: Any = cv2.cvtColor(frame[: max(int(UPPER_SHARE * height), 2)], cv2.COLOR_RGB2GRAY)
    across = min(WIDTH_PX, width)
    size = (across, max(2, round(len(grey) * across / width)))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.float32)


def _shift(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """By how many columns the picture moved to the right, by phase correlation (Kuglin and Hines, 1975)."""
    window = cv2.createHanningWindow((before.shape[1], before.shape[0]), cv2.CV_32F)
    (shift, _), _ = cv2.phaseCorrelate(before, after, window)
    return float(np.clip(shift, -FARTHEST_SHIFT_PX, FARTHEST_SHIFT_PX))
