"""Noise of odometry, driver and closures, estimated from the refinement's own residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations. Those of odometry grow with the root of the driven metres. Defaults: wide, where estimation begins."""

    along: float = 0.10  # m per root m
    across: float = 0.05  # m per root m
    heading: float = 0.01  # rad per root m
    log_scale: float = 0.005  # per root m
    lateral_m: float = 0.3  # of the vehicle from the lane's centreline
    lane_heading_rad: float = 0.05  # of the vehicle from the lane's direction
    closure_factor: float = 1.0  # on the closures' own sigmas

    def step_sigmas(self, length_m: FloatArray) -> FloatArray:
        """Sigmas (N, 4) of along, across, heading, log scale over steps of the given lengths."""
        root = np.sqrt(np.maximum(length_m, STANDSTILL_M))[:, None]
        sigmas: FloatArray = root * np.array([self.along, self.across, self.heading, self.log_scale])
        return sigmas


STANDSTILL_M = 0.1  # a step shorter than this is as uncertain as this: quantised motions, gyro noise while standing
FLOORS = {"along": 0.005, "across": 0.005, "heading": 0.0005, "log_scale": 0.0003, "lateral_m": 0.05, "lane_heading_rad": 0.01}
# below these, no sensor or driver is believable, and the equations lose their condition


def reestimated(noise: Noise, steps_sq: FloatArray, across_sq: float, turned_sq: float, closure_median_sq: float | None) -> Noise:
    """One step of expectation maximisation: each sigma times the root of its mean expected squared whitened residual.

    ``steps_sq`` (4,): odometry; ``across_sq``, ``turned_sq``: road; ``closure_median_sq``: median over closures, of 3 components.
    """
    updates = {
        "along": noise.along * np.sqrt(steps_sq[0]),
        "across": noise.across * np.sqrt(steps_sq[1]),
        "heading": noise.heading * np.sqrt(steps_sq[2]),
        "log_scale": noise.log_scale * np.sqrt(steps_sq[3]),
        "lateral_m": noise.lateral_m * np.sqrt(across_sq),
        "lane_heading_rad": noise.lane_heading_rad * np.sqrt(turned_sq),
    }
    floored = {name: float(max(value, FLOORS[name])) for name, value in updates.items()}
    factor = noise.closure_factor
    if closure_median_sq is not None:
        factor = float(np.clip(factor * np.sqrt(closure_median_sq / CHI_SQ_3_MEDIAN), 0.2, 5.0))
    return replace(noise, **floored, closure_factor=factor)


CHI_SQ_3_MEDIAN = 2.366
