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
    scale_tail: float = 0.25  # 1 / degrees of freedom of the scale's Student-t: 4, as it may jump; 0: normal
    road_tail: float = 1.0  # likewise of the road's: 1 (Cauchy), as turns are drawn otherwise than driven

    def step_sigmas(self, length_m: FloatArray) -> FloatArray:
        """Sigmas (N, 4) of along, across, heading, log scale over steps of the given lengths."""
        root = np.sqrt(np.maximum(length_m, STANDSTILL_M))[:, None]
        sigmas: FloatArray = root * np.array([self.along, self.across, self.heading, self.log_scale])
        return sigmas

    def road_sigmas(self, curvature_1pm: FloatArray, freedom_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sigmas (N,) across the lane and of the lane's heading; bends are cut, and drawn as polylines."""
        lateral = np.hypot(np.hypot(self.lateral_m, freedom_m), BEND_CUT_M2 * curvature_1pm)
        heading = np.hypot(self.lane_heading_rad, BEND_SHIFT_M * curvature_1pm)
        return lateral, heading


# metres off the centreline per 1/m of curvature; a rear axle 2.7 m behind the front one cuts 2.7^2 / 2 = 3.6 at most
BEND_CUT_M2 = 2.0
BEND_SHIFT_M = 1.0  # along-track shift between the bend that is drawn and the one that is driven
STANDSTILL_M = 0.1  # a step shorter than this is as uncertain as this: quantised motions, gyro noise while standing
FLOORS = {"along": 0.005, "across": 0.005, "heading": 0.0005, "log_scale": 0.0003, "lateral_m": 0.2, "lane_heading_rad": 0.05}
# below these, no sensor or driver is believable, and the equations lose their condition. A path can follow its lane as closely as
# it likes: that a driver wanders and a network is off by decimetres is not seen in the residuals


def per_freedom(residual: FloatArray, count: float, used: FloatArray) -> FloatArray:
    """Squares of ``count`` whitened, weighted residuals (N, M) per degree of freedom that the solution left them, (M,).

    Helmert's variance components: the estimate used up ``used`` = tr(J Sigma J^T). It shares its fixed point with expectation
    maximisation (Student-t: Lange, Little, Taylor 1989) but comes there in a few rounds; one round may change a sigma at most by
    ``LARGEST_CHANGE``. The number of residuals counts, not the sum of their weights: a weight above 1 adds no freedom.
    """
    freedom = np.maximum(count - used, 1e-3 * count + 1.0)
    ratio: FloatArray = np.clip(np.sum(residual**2, axis=0) / freedom, LARGEST_CHANGE**-2, LARGEST_CHANGE**2)
    return ratio


def reestimated(noise: Noise, steps_sq: FloatArray, roads_sq: FloatArray, closure_median_sq: float | None) -> Noise:
    """Sigmas times the root of their squared residuals per degree of freedom.

    ``steps_sq`` (4,): odometry; ``roads_sq`` (2 or more): across, heading; ``closure_median_sq``: over closures, of 3 components.
    """
    names = ("along", "across", "heading", "log_scale", "lateral_m", "lane_heading_rad")
    factors = np.sqrt(np.concatenate([steps_sq, roads_sq[:2]]))
    updates = {n: float(max(getattr(noise, n) * f, FLOORS[n])) for n, f in zip(names, factors, strict=True)}
    factor = noise.closure_factor
    if closure_median_sq is not None:
        factor = float(np.clip(factor * np.sqrt(closure_median_sq / CHI_SQ_3_MEDIAN), 0.2, 5.0))
    return replace(noise, **updates, closure_factor=factor)


CHI_SQ_3_MEDIAN = 2.366
LARGEST_CHANGE = 2.0
