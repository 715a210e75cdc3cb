"""The drive as the route search sees it: raw consecutive motions turned into headings at even arc lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, Visits

WANDER = 1.5  # factor by which the scale may leave its usual value for a while, as after a restart of visual odometry
CALIBRATION = 0.1  # a metric odometry is off by less: tyres and stereo baselines by 1-3 %, and some more in a bend
WIDE_SCALES = (0.1, 1.0, 10.0)  # metres per map unit tried when the visits carry no usable time
MOST_DRIVEN_M = 2e6  # two days at the wheel; a longer drive comes of a motion that is none, and asks for hundreds of gigabytes
_LEAST_ARC, _LARGEST_ARC = 1e-6, 1e12  # map units of a whole drive, in units from kilometres down to micrometres
_BRISK_PERCENTILE = 90.0  # brisk speed of a drive among its speeds while moving: stops and jams do not lower it much
_BRISK_SHARES = (0.25, 1.3)  # least and largest brisk speed of a drive, as shares of the network's speed limits


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A drive sampled at T even arc lengths, ``step`` map units apart.

    Stops and uneven spacing of the visits are gone, and so are the map's translation and rotation.
    """

    arc: FloatArray  # (T,) map units driven since the first visit
    heading_rad: FloatArray  # (T,) unwrapped, zero at the first visit
    visit_arc: FloatArray  # (S,) arc length at which each visit lies
    step: float

    def visit_samples(self) -> NDArray[np.int64]:
        """The sample (S,) nearest to each visit."""
        return np.clip(np.round(self.visit_arc / self.step).astype(np.int64), 0, len(self.arc) - 1)


def make_track(visits: Visits, step: float) -> Track:
    """Sample the motions of S visits every ``step`` map units."""
    visit_arc = driven_arc(visits)
    heading = np.cumsum(visits.motion[:, 2])
    arc = np.arange(0.0, visit_arc[-1] + 0.5 * step, step)
    moved = np.concatenate([[True], np.diff(visit_arc) > 0.0])
    last_of_stop = np.concatenate([np.flatnonzero(moved)[1:] - 1, [len(moved) - 1]])  # of a stop, the last heading counts
    return Track(arc, np.interp(arc, visit_arc[last_of_stop], heading[last_of_stop]), visit_arc, step)


def _require_drivable(length_m: float) -> None:
    """Raise HippodromeError unless a drive is one that a vehicle makes: a motion that is none would take all memory."""
    if not length_m <= MOST_DRIVEN_M:
        raise HippodromeError(
            f"cognitive map: by its motions the drive is {length_m / 1e3:.3g} km long, the limit is {MOST_DRIVEN_M / 1e3:.0f}; "
            "a motion between two visits is none; check the odometry and map the drive anew"
        )


def driven_arc(visits: Visits) -> FloatArray:
    """Arc length (S,) driven up to each visit, in map units.

    The motion between two visits is a chord. It is converted to the length of the circular arc that turns by the measured angle.
    """
    half_turn = 0.5 * np.clip(np.abs(visits.motion[:, 2]), 0.0, np.pi)
    chord = np.hypot(visits.motion[:, 0], visits.motion[:, 1])
    arc: FloatArray = np.cumsum(chord / np.sinc(half_turn / np.pi))  # chord / arc = sin(half_turn) / half_turn
    return arc


def known_scale_range(metres_per_unit: float) -> tuple[float, float, float]:
    """Least, typical and largest metres per map unit of an odometry that is metric but for its calibration."""
    return metres_per_unit * (1.0 - CALIBRATION), metres_per_unit, metres_per_unit * (1.0 + CALIBRATION)


def scale_range(visits: Visits, network: RoadNetwork) -> tuple[float, float, float]:
    """Least, typical and largest possible metres per map unit, from the drive's brisk speed and the network's speed limits.

    Raises:
        HippodromeError: the vehicle never moved, or moved too little or too far for numbers to tell.
    """
    seconds, units = np.diff(visits.t_s), np.diff(driven_arc(visits))
    moving = (seconds > 0.0) & (units > 0.0)
    if not np.any(units > 0.0):
        raise HippodromeError("cognitive map: the vehicle never moved, so there is no route to match; record a longer drive")
    if not _LEAST_ARC < (driven := float(np.sum(units))) < _LARGEST_ARC:
        raise HippodromeError(f"cognitive map: a drive of {driven:.3g} map units in all is none; map the drive anew")
    if not np.any(moving):
        _require_drivable(driven * WIDE_SCALES[1])
        return WIDE_SCALES
    speed = units[moving] / seconds[moving]
    brisk = float(np.percentile(speed, _BRISK_PERCENTILE))
    limit = network.speed_limit_mps[~network.is_internal]
    usual = float(np.median(limit))
    least, largest = _BRISK_SHARES
    _require_drivable(driven * usual / brisk)
    return least / WANDER * usual / brisk, usual / brisk, largest * WANDER * float(np.max(limit)) / brisk
