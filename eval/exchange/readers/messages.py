"""What logs of messages have in common, MCAP files and ROS bags: which topics are used, stamps, odometry and poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, TypeVar

import numpy as np

from hippodrome._output import one_line
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion, motion_of, motion_table, trajectory_of
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.pixels import CHANNELS, png_of
from hippodrome.eval.exchange.readers.spool import Spool

__all__ = ["CHANNELS", "png_of"]  # beside what is defined here

MessageT = TypeVar("MessageT")
Kind: TypeAlias = Literal["images", "odometry", "poses", ""]  # what a topic may be used for; "": for nothing
# Customary names of the true poses; our exports use the first.
TRUTH_TOPICS: Final = ("/ground_truth", "/groundtruth", "/gt_pose")
NO_PICTURES: Final = ("depth", "disparity")  # in names of topics that others are preferred to
BACK_S: Final = 1.0  # messages that arrive late are sorted; a clock that goes back farther is another drive's
MAX_STRANGE_REPEATS: Final = 0.1  # share of messages that may repeat a time with other content
LEAST_MOVED: Final = 1e-6  # poses that moved by less, in their unit of length, stand still
LEAST_TURNED_RAD: Final = 0.1


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics that are used."""

    images: str
    odometry: str | None
    truth: str | None


@dataclass(frozen=True, slots=True)
class Stamped:
    """A message's time in nanoseconds, a checksum of its bytes, and what was read of it."""

    stamp: int
    digest: int
    value: Any


@dataclass(frozen=True, slots=True)
class PoseRow:
    """A pose as a message has it."""

    position: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class OdometryRow:
    """A pose and the velocities in the vehicle's axes."""

    pose: PoseRow
    speed: float
    yaw_rate_radps: float


def choose(path: Path, topics: Mapping[str, tuple[Kind, str]], wanted: Sequence[str]) -> Chosen:
    """The topics to be used, which are printed.

    Args:
        path: The log.
        topics: What each topic may be used for, and the type of its messages, by its name.
        wanted: Topics that the user named: of images, of odometry (a second one is the truth), of poses (the truth).

    Raises:
        ExchangeError: A wanted topic is not there or of no use, or no topic has images.
    """
    listed = ", ".join(f"{topic} ({name})" for topic, (_, name) in topics.items())[:400] or "none"
    for topic in wanted:
        if topic not in topics:
            raise ExchangeError(f"{path}: no topic '{topic}'; it has: {listed}")
        if topics[topic][0] == "":
            raise ExchangeError(f"{path}: topic '{topic}' is of {topics[topic][1]}: neither images, odometry nor poses")

    def of(kind: Kind, names: Sequence[str]) -> list[str]:
        return [topic for topic in names if topics[topic][0] == kind]

    images = of("images", wanted) or sorted(
        of("images", list(topics)), key=lambda name: any(w in name.lower() for w in NO_PICTURES)
    )
    if not images:
        raise ExchangeError(f"{path}: no topic of images that can be read; it has: {listed}")
    if len(of("images", wanted)) > 1 or len(of("odometry", wanted) + of("poses", wanted)) > 2:
        raise ExchangeError(f"{path}: --topic names more than one camera, or more than self-motion and truth; name one of each")
    odometry = of("odometry", wanted)
    truths = [*odometry[1:], *of("poses", wanted)] or [
        t for t in TRUTH_TOPICS if topics.get(t, ("", ""))[0] in ("poses", "odometry")
    ]
    truth = next((topic for topic in truths if topic not in odometry[:1]), None)
    motion = next((topic for topic in odometry or of("odometry", list(topics)) if topic != truth), None)
    others = [topic for topic, (kind, _) in topics.items() if kind and topic not in (images[0], motion, truth)]
    cameras = [topic for topic in others if topics[topic][0] == "images"]
    rest = [topic for topic in others if topic not in cameras]
    not_of = f" (not of {', '.join(cameras)[:200]})" if cameras else ""
    unused = f"; not used: {', '.join(rest)[:200]}" if rest else ""
    cure = "; --topic names others" if others else ""
    used = f"images of {images[0]}{not_of}, self-motion of {motion or 'none'}, truth of {truth or 'none'}{unused}{cure}"
    print(f"{path}: {one_line(used)}")
    return Chosen(images[0], motion, truth)


def in_order(messages: Sequence[Stamped], name: str) -> list[Stamped]:
    """The messages of one topic in order of time, those that repeat a time once; what was sorted or left out is printed.

    Raises ExchangeError if the time goes back by more than ``BACK_S``, or repeats with other content: more than one drive.
    """
    stamps = np.array([one.stamp for one in messages], dtype=np.int64)
    latest = np.maximum.accumulate(stamps) if len(stamps) else stamps
    back_s = (latest - stamps) / 1e9
    if (back_s > BACK_S).any():
        row = int(np.flatnonzero(back_s > BACK_S)[0])
        raise ExchangeError(
            f"{name}: message {row + 1} is {back_s[row]:.3f} s earlier than one before it: more than one drive, or a clock that "
            "was set; cut the log into drives"
        )
    if (late := int(np.count_nonzero(back_s > 0.0))) > 0:
        print(f"{name}: {late} message(s) that came late are sorted in by their time")
    ordered = sorted(messages, key=lambda one: one.stamp)
    strange = sum(a.stamp == b.stamp and a.digest != b.digest for a, b in pairwise(ordered))
    if strange > MAX_STRANGE_REPEATS * len(ordered):
        raise ExchangeError(
            f"{name}: {strange} of {len(ordered)} messages repeat a time with other content: more than one drive, or more than "
            "one source on a topic; separate them"
        )
    kept = without_repeats([(one.stamp, one) for one in ordered], name)
    return [one for _, one in kept]


def without_repeats(messages: list[tuple[int, MessageT]], name: str) -> list[tuple[int, MessageT]]:
    """Stamped messages without those whose stamp repeats the one before; prints how many of the topic ``name`` are left out."""
    kept = [one for number, one in enumerate(messages) if number == 0 or one[0] != messages[number - 1][0]]
    if len(kept) < len(messages):
        print(f"{name}: {len(messages) - len(kept)} message(s) that repeat the time of the one before are left out")
    return kept


def frames_of(messages: Sequence[Stamped], name: str) -> list[ForeignFrame]:
    """The frames of messages whose values load an image."""
    return [ForeignFrame(one.stamp / 1e9, f"{name} at {one.stamp} ns", one.value) for one in in_order(messages, name)]


def kept_image(message: Any, spool: Spool, name: str) -> Callable[[], bytes]:
    """A function that reads an image message's encoded image back; both ROS's and Foxglove's have these fields.

    Raises ExchangeError for pixels of an unknown encoding.
    """
    if hasattr(message, "format"):
        return spool.keep(bytes(message.data))
    big_endian = bool(getattr(message, "is_bigendian", False))
    return spool.keep(
        png_of(bytes(message.data), message.encoding, message.width, message.height, message.step, name, big_endian)
    )


def pose_row(pose: Any) -> PoseRow:
    """A pose message; ROS's and Foxglove's have the same fields."""
    at, turn = pose.position, pose.orientation
    return PoseRow((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))


def motion_of_odometry(messages: Sequence[Stamped], name: str) -> Motion:
    """Self-motion of messages of ``OdometryRow``: their velocities, or, where these are empty and the poses move, the poses'.

    Raises ExchangeError if there are too few of them, or their times do not increase.
    """
    kept = in_order(messages, name)
    rows: list[OdometryRow] = [one.value for one in kept]
    t_s = np.array([one.stamp for one in kept]) / 1e9
    speed, yaw_rate = np.array([row.speed for row in rows]), np.array([row.yaw_rate_radps for row in rows])
    if len(rows) > 2 and not (speed.any() and yaw_rate.any()):
        poses = _poses_or_none(rows, t_s, name)
        moved = poses is not None and float(np.ptp(poses.poses[:, :2], axis=0).max()) > LEAST_MOVED
        turned = poses is not None and float(np.ptp(np.unwrap(poses.poses[:, 2]))) > LEAST_TURNED_RAD
        if poses is not None and ((moved and not speed.any()) or (turned and not yaw_rate.any())):
            print(f"{name}: its velocities are all 0 while its poses move: the poses are differentiated")
            return motion_of(poses, name)
    return motion_table(t_s, speed, yaw_rate, name)


def truth_of_poses(messages: Sequence[Stamped], axes: Axes, name: str) -> Trajectory:
    """The true poses of messages of ``PoseRow`` or ``OdometryRow``. Raises HippodromeError."""
    kept = in_order(messages, name)
    rows = [one.value.pose if isinstance(one.value, OdometryRow) else one.value for one in kept]
    return _poses(rows, np.array([one.stamp for one in kept]) / 1e9, axes, name, True)


def _poses_or_none(rows: Sequence[OdometryRow], t_s: FloatArray, name: str) -> Trajectory | None:
    """The poses; None where their attitudes were never filled in."""
    filled = any(value != 0.0 for row in rows for value in row.pose.quaternion_xyzw)
    return _poses([row.pose for row in rows], t_s, "body", name) if filled else None


def _poses(rows: Sequence[PoseRow], t_s: FloatArray, axes: Axes, name: str, other_axes: bool = False) -> Trajectory:
    if not rows:
        raise ExchangeError(f"{name}: no messages")
    positions, quaternions = np.array([row.position for row in rows]), np.array([row.quaternion_xyzw for row in rows])
    if not (np.isfinite(positions).all() and np.isfinite(quaternions).all()):
        raise ExchangeError(f"{name}: a pose that is not finite")
    return trajectory_of(t_s, positions, quaternions, axes, name, other_axes)
