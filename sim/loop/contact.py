"""Whether the ego touches another vehicle or a building, and who is to blame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.ego_spec import LENGTH_M
from hippodrome.sim.loop.car import CENTRE_AHEAD_M, WIDTH_M, ahead_of
from hippodrome.sim.loop.users import Users

PAINT_M: Final = 0.05  # boxes that overlap by less have not touched: real bodies are rounded
ALONGSIDE_RAD: Final = math.radians(60.0)  # whoever heads more askew did not come from behind
ASKEW_RAD: Final = math.radians(20.0)  # whoever heads more askew than this to the ego's lane is not following it
STANDS_MPS: Final = 0.1
EGO_SIZE_M: Final = np.array([[LENGTH_M, WIDTH_M]])


def ego_box(pose_m: tuple[float, float, float]) -> FloatArray:
    """Pose (1, 3) of the middle of the ego's body."""
    return np.array([[*ahead_of(pose_m, CENTRE_AHEAD_M), pose_m[2]]])


def corners_m(poses_m: FloatArray, sizes_m: FloatArray) -> FloatArray:
    """Corners (k, 4, 2) of upright boxes: front left, front right, rear right, rear left."""
    cos, sin = np.cos(poses_m[:, 2])[:, None], np.sin(poses_m[:, 2])[:, None]
    x = 0.5 * sizes_m[:, :1] * np.array([1.0, 1.0, -1.0, -1.0])
    y = 0.5 * sizes_m[:, 1:2] * np.array([1.0, -1.0, -1.0, 1.0])
    corners: FloatArray = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + poses_m[:, None, :2]
    return corners


def touching(pose_m: tuple[float, float, float], users: Users) -> IntArray:
    """Rows of the users whose boxes overlap the ego's, by the separating axes of the two boxes."""
    if len(users.names) == 0:
        return np.zeros(0, dtype=np.int32)
    box = ego_box(pose_m)
    reach = 0.5 * (LENGTH_M + users.sizes_m[:, 0]) + 1.0
    near = np.flatnonzero(np.hypot(*(users.poses_m[:, :2] - box[0, :2]).T) < reach)
    ego = corners_m(box, EGO_SIZE_M - PAINT_M)[0]
    others = corners_m(users.poses_m[near], users.sizes_m[near] - PAINT_M)
    hits = [row for row, other in zip(near.tolist(), others, strict=True) if _overlap(ego, other)]
    return np.array(hits, dtype=np.int32)


def _overlap(a_m: FloatArray, b_m: FloatArray) -> bool:
    """Whether two rectangles (4, 2) overlap."""
    for box in (a_m, b_m):
        axes = box[[0, 1]] - box[[1, 2]]
        a, b = a_m @ axes.T, b_m @ axes.T
        if ((a.max(axis=0) <= b.min(axis=0)) | (b.max(axis=0) <= a.min(axis=0))).any():
            return False
    return True


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What the blame for a collision depends on.

    Args:
        pose_m: the ego's rear axle.
        speed_mps: the ego's, negative backwards.
        other_m: x, y, heading of the middle of the other.
        other_mps: the other's speed.
        in_own_lane: every wheel of the ego is in its lane, also through a junction.
        keeps_lane: it was so for two seconds, or the ego stands.
        same_lane: the other is on a lane that the ego is on, has just left, or drives along next.
        ways_cross: the ways of the two through a junction cross or meet.
        had_to_yield: the other had to let the ego pass, and no red signal was run.
    """

    pose_m: tuple[float, float, float]
    speed_mps: float
    other_m: tuple[float, float, float]
    other_mps: float
    in_own_lane: bool
    keeps_lane: bool
    same_lane: bool
    ways_cross: bool
    had_to_yield: bool


def is_at_fault(c: Circumstances) -> tuple[bool, str]:
    """Whether a collision is the ego's fault, and why or why not.

    It is where it backs, and but for three cases where it does not. *From behind*: the other heads the same way within 60
    degrees, its middle is behind the ego's, it is the faster one, and the ego was not changing lanes. *Had to yield*: the
    rights of way of the junction that both are in say that the other waits, and the ego ran no red signal. *Left its lane*:
    the ego is within its own lane, to 30 cm, and the other moves and is on a lane that neither crosses nor meets the ego's
    and that the ego does not follow, as long vehicles are that swing out in turns; or it stands more than 20 degrees askew
    in the ego's lane outside of junctions, as who cuts in.
    """
    if c.speed_mps < -STANDS_MPS:
        return True, "backed into another vehicle"
    cos, sin = math.cos(c.pose_m[2]), math.sin(c.pose_m[2])
    dx, dy = c.other_m[0] - c.pose_m[0], c.other_m[1] - c.pose_m[1]
    ahead_m = cos * dx + sin * dy - CENTRE_AHEAD_M
    turn = abs((c.other_m[2] - c.pose_m[2] + math.pi) % (2.0 * math.pi) - math.pi)
    alongside = turn < ALONGSIDE_RAD
    if alongside and ahead_m < 0.0 and c.other_mps > c.speed_mps and (c.keeps_lane or c.same_lane):
        return False, "run into from behind"
    if c.had_to_yield:
        return False, "the other had to yield"
    cuts_in = c.keeps_lane and turn > ASKEW_RAD if c.same_lane else not c.ways_cross
    if c.in_own_lane and c.other_mps > STANDS_MPS and cuts_in:
        return False, "the other left its lane"
    return True, "ran into another vehicle" if c.speed_mps >= STANDS_MPS else "stood in the way of another vehicle"
