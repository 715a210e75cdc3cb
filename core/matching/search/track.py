"""The drive as the matching sees it: raw consecutive motions turned into headings at even arc lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, Visits

WANDER = 1.5  # factor by which the scale may leave its usual value for a while, as after a re-start of visual odometry
WIDE_SCALES = (0.1, 1.0, 10.0)  # metres per map unit tried when the visits carry no usable time


@dataclass(frozen=True, slots=True)
class Track:
    """T samples, ``step`` map units of driving apart. Stops and uneven vertex spacing are gone, translation and rotation too."""

    arc: FloatArray  # (T,) map units driven since the first visit
    heading_rad: FloatArray  # (T,) unwrapped, zero at the first visit
    visit_arc: FloatArray  # (S,) where each visit lies on that axis
    step: float

    def visit_samples(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """The sample (S,) nearest to each visit."""
        return np.clip(np.round(self.visit_arc / self.step).astype(np.int64), 0, len(self.arc) - 1)


def make_track(visits: Visits, step: float) -> Track:
    """Sample the visits' motions every ``step`` map units."""
    visit_arc = driven(visits)
    heading = np.cumsum(visits.motion[:, 2])
    arc = np.arange(0.0, visit_arc[-1] + 0.5 * step, step)
    moved = np.concatenate([[True], np.diff(visit_arc) > 0.0])  # of a standstill the last heading counts
    last = np.concatenate([np.flatnonzero(moved)[1:] - 1, [len(moved) - 1]])
    return Track(arc, np.interp(arc, visit_arc[last], heading[last]), visit_arc, step)


def driven(visits: Visits) -> FloatArray:
    """Arc length (S,) driven up to each visit, map units; a motion's chord is lengthened to the circular arc of its turn."""
    half_turn = 0.5 * np.clip(np.abs(visits.motion[:, 2]), 0.0, np.pi)
    chord = np.hypot(visits.motion[:, 0], visits.motion[:, 1])
    arc: FloatArray = np.cumsum(chord / np.sinc(half_turn / np.pi))
    return arc


def scale_range(visits: Visits, network: RoadNetwork) -> tuple[float, float, float]:
    """Least, typical and largest possible metres per map unit: a driver's brisk speed is 25-130 % of the network's limits.

    Brisk: the 90th percentile of the speeds while moving, in map units; stops and jams do not lower it much.
    """
    seconds, units = np.diff(visits.t_s), np.diff(driven(visits))
    moving = (seconds > 0.0) & (units > 0.0)
    if not np.any(units > 0.0):
        raise HippodromeError("cognitive map: the vehicle never moved, so there is no route to match; record a longer drive")
    if not np.any(moving):
        return WIDE_SCALES
    speed = units[moving] / seconds[moving]
    brisk = float(np.percentile(speed, 90.0))
    limit = network.speed_limit_mps[~network.is_internal]
    usual = float(np.median(limit))
    return 0.25 / WANDER * usual / brisk, usual / brisk, 1.3 * WANDER * float(np.max(limit)) / brisk
