"""The lever arm: how far ahead of the rear axle the point lies whose poses a file has.

A vehicle does not slip sideways at its rear axle. A camera that sits ``ahead`` of it does, in turns: between two poses it moves
by ``2 ahead sin(turn / 2)`` to the left of the mean heading, exactly so where the vehicle drives an arc of a circle. So the
motion itself tells the lever, in the unit of the poses, whatever their scale is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, Trajectory

Ahead: TypeAlias = float | Literal["auto"]  # a lever that the user says, or one to be estimated

STEP_S: Final = 0.5  # motion is looked at over so long: single steps are noise, longer ones are no arcs
PARTS: Final = 10  # stretches of the drive that are left out in turn, for the standard error
SURE_SIGMAS: Final = 4.0  # an estimate is used where it differs from 0 by so many standard errors
SURE_SHARE: Final = 0.25  # and where it explains at least this share of the sideways motion
LEAST_TURN_RAD: Final = 1.5  # sum of all turns: a straight drive tells no lever
LEAST_DRIVE_S: Final = 20.0  # shorter drives are too few turns to tell a lever from slip
LEAST_S: Final = 0.03  # a lever that is driven over in less time than this may be slip, or a lag of the headings
LONGEST_S: Final = 2.0  # a lever that takes longer than this to drive over is none of a car
HUBER_SIGMAS: Final = 1.5  # residuals beyond this weigh less: slip, jumps of the tracker
ITERATIONS: Final = 20


@dataclass(frozen=True, slots=True)
class Lever:
    """A lever and how it is known."""

    ahead: float  # in the unit of the poses; 0: they are taken as they are
    words: str  # how it is known, for people; "" where there is nothing to say


NO_LEVER: Final = Lever(0.0, "")


def lever_of(trajectory: Trajectory, said: Ahead, name: str) -> Lever:
    """The lever of planar poses.

    Args:
        trajectory: The poses of one point of the vehicle, whose headings are the vehicle's (a constant error does not matter).
        said: The lever as the user says it, or "auto", which estimates it and takes it for 0 where it cannot be told.
        name: How the words name the poses.
    """
    if said != "auto":
        where = f"those of a point {said:g} ahead of the rear axle" if said else "those of the rear axle"
        return Lever(said, f"{name}: its poses are taken for {where}, as --camera-ahead or --truth-ahead says")
    found = estimated(trajectory)
    if found is None:
        return NO_LEVER
    ahead, sigma = found
    words = (
        f"{name}: its poses lie {ahead:.2f} +- {sigma:.2f} (in their unit of length) ahead of the point that does not slip "
        "sideways in turns, the rear axle, as their own motion tells; they are moved there"
    )
    return Lever(ahead, words)


def at_axle(trajectory: Trajectory, ahead: float) -> Trajectory:
    """The poses of the rear axle, from those of a point ``ahead`` of it."""
    if ahead == 0.0:
        return trajectory
    return Trajectory(trajectory.t_s, se2.compose(trajectory.poses, np.array([-ahead, 0.0, 0.0])))


def moved_to_axle(trajectory: Trajectory, said: Ahead, name: str) -> Trajectory:
    """The poses of the rear axle, by the lever of ``lever_of``, which is printed."""
    lever = lever_of(trajectory, said, name)
    if lever.words:
        print(f"note: {lever.words}")
    return at_axle(trajectory, lever.ahead)


def estimated(trajectory: Trajectory) -> tuple[float, float] | None:
    """The lever and its standard error, in the unit of the poses; None where the motion does not tell one that matters.

    Sideways motion is explained by a heading that is askew by a constant angle, and by the lever (robust regression).
    """
    steps = _steps(trajectory)
    if steps is None:
        return None
    ahead_of, aside, turn = steps
    if float(np.abs(turn).sum()) < LEAST_TURN_RAD:
        return None
    design = np.column_stack([ahead_of, turn])
    askew, lever = _robust(design, aside)
    parts = np.arange(len(aside)) * PARTS // len(aside)
    without = np.array([_robust(design[parts != part], aside[parts != part])[1] for part in range(PARTS)])
    sigma = float(np.sqrt((PARTS - 1) / PARTS * np.sum((without - without.mean()) ** 2)))
    slip = aside - askew * ahead_of
    explained = 1.0 - _spread(slip - lever * turn) / max(_spread(slip), 1e-300)
    speed = float(np.abs(ahead_of).mean()) / STEP_S
    matters = LEAST_S * speed < abs(lever) < LONGEST_S * speed
    sure = abs(lever) > SURE_SIGMAS * sigma and explained > SURE_SHARE
    return (float(lever), sigma) if matters and sure else None


def _steps(trajectory: Trajectory) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Motion over ``STEP_S`` along and to the left of the mean heading, and twice the sine of half of the turn; (N,) each.

    None where the drive is too short. Steps that are much longer than ``STEP_S``, over holes, are left out.
    """
    t_s = trajectory.t_s
    if len(t_s) < 3 * PARTS or t_s[-1] - t_s[0] < LEAST_DRIVE_S:
        return None
    stride = max(1, round(STEP_S / float(np.median(np.diff(t_s)))))
    if len(t_s) < stride + 2 * PARTS:
        return None
    dt_s = t_s[stride:] - t_s[:-stride]
    moved = se2.between(trajectory.poses[:-stride], trajectory.poses[stride:])
    moved = moved[dt_s <= 2.0 * float(np.median(dt_s))]
    half = moved[:, 2] / 2.0
    cos, sin = np.cos(half), np.sin(half)
    ahead_of, aside = cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]
    return (ahead_of, aside, 2.0 * sin) if len(moved) >= 2 * PARTS else None


def _robust(design: FloatArray, values: FloatArray) -> FloatArray:
    """Coefficients (K,) of a linear regression with Huber's weights; ``design`` is (N, K), ``values`` (N,)."""
    weights = np.ones(len(values))
    found: FloatArray = np.zeros(design.shape[1])
    for _ in range(ITERATIONS):
        root = np.sqrt(weights)
        found = np.asarray(np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0], np.float64)
        residual = np.abs(values - design @ found)
        limit = HUBER_SIGMAS * 1.4826 * float(np.median(residual))
        if limit <= 1e-12 * float(np.abs(values).max(initial=0.0)):
            break
        weights = limit / np.maximum(residual, limit)
    return found


def _spread(values: FloatArray) -> float:
    """Mean square of values (N,) whose largest twentieth is cut: one jump of a tracker is not what the drive is like."""
    kept = np.sort(np.abs(values))[: max(1, int(0.95 * len(values)))]
    return float(np.mean(kept**2))
