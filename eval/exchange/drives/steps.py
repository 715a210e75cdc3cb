"""From frames and self-motion, each with times of its own, to the steps of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.clock import disjoint
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion, truth_at
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import MAX_STEPS

SAME_TIME_S: Final = 1e-4  # a frame and a row of self-motion closer than this are of one instant: time stamps are rounded


def begin_s(motion: Motion) -> float:
    """When the first row of self-motion began, which no row says: it is taken to last a median interval."""
    return float(motion.t_s[0] - np.median(np.diff(motion.t_s)))


def frames_within(frames: Sequence[ForeignFrame], motion: Motion, source: Path) -> list[ForeignFrame]:
    """The frames within the time that the self-motion covers; of a drive without any frame, none.

    Raises ExchangeError, naming ``source`` and both ranges, if there are frames and none of them lies in that time.
    """
    if not frames:
        return []
    begins_s = begin_s(motion)
    found = [frame for frame in frames if begins_s + SAME_TIME_S < frame.t_s <= motion.t_s[-1] + SAME_TIME_S]
    if not found:
        raise disjoint(str(source), (frames[0].t_s, frames[-1].t_s), (begins_s, float(motion.t_s[-1])))
    return found


def steps_of(frames: Sequence[ForeignFrame], motion: Motion, truth: Trajectory | None) -> Samples:
    """The steps of the drive: one ends wherever a row of self-motion or a frame does.

    A row that a frame cuts in two holds in both parts. Times begin with the first row. Where the truth is unknown, poses are NaN;
    what only a simulation knows is NaN or empty. Raises ExchangeError if there are too many steps, or two frames at one time.
    """
    frame_s = np.array([frame.t_s for frame in frames])
    on_a_row = np.abs(motion.t_s[_nearest(motion.t_s, frame_s)] - frame_s) <= SAME_TIME_S
    t_s = np.union1d(motion.t_s, frame_s[~on_a_row])
    if len(t_s) > MAX_STEPS:
        raise ExchangeError(f"{len(t_s)} steps, a recording has at most {MAX_STEPS}")
    begins_s = begin_s(motion)
    row = np.minimum(np.searchsorted(motion.t_s, t_s), len(motion.t_s) - 1)
    frame = np.full(len(t_s), -1, dtype=np.int32)
    frame[_nearest(t_s, frame_s)] = np.arange(len(frame_s), dtype=np.int32)
    if np.count_nonzero(frame >= 0) != len(frame_s):
        raise ExchangeError(f"two frames within {SAME_TIME_S:g} s of one another: not a drive of one camera")
    count = len(t_s)
    return Samples(
        t_s=t_s - begins_s,
        dt_s=np.diff(t_s, prepend=begins_s),
        speed=motion.speed[row],
        yaw_rate_radps=motion.yaw_rate_radps[row],
        frame=frame,
        poses_m=np.full((count, 3), np.nan) if truth is None else truth_at(truth, t_s),
        speed_mps=np.full(count, np.nan),
        lane=np.zeros(count, dtype=np.int32),
        lane_position_m=np.full(count, np.nan),
        lane_ids=("",),
    )


def _nearest(t_s: FloatArray, wanted_s: FloatArray) -> NDArray[np.intp]:
    """Index (M,) of the time (N,) nearest to each wanted one (M,)."""
    after = np.clip(np.searchsorted(t_s, wanted_s), 1, len(t_s) - 1)
    return after - (wanted_s - t_s[after - 1] < t_s[after] - wanted_s)
