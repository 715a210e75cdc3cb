"""Standard deviations of odometry, driver and closures, estimated from the refinement's own residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.types import FloatArray

BEND_CUT_M2 = 2.0  # metres off the centreline per 1/m of curvature; a rear axle 2.7 m behind the front one cuts 2.7^2 / 2 at most
BEND_SHIFT_M = 1.0  # along-track shift between a bend as it is drawn and as it is driven
STANDSTILL_M = 0.1  # shorter steps are as uncertain as one of this length: quantised motions, gyro noise while standing

# Below these values no sensor or driver is believable, and the equations lose their condition. A refined path can follow its lane
# as closely as it likes, so that the residuals do not show that a driver wanders and a network is off by decimetres.
FLOORS = {"along": 0.005, "across": 0.005, "heading": 0.0005, "log_scale": 0.0003, "lateral_m": 0.2, "lane_heading_rad": 0.05}


CHI_SQ_1_MEDIAN = 0.455  # the same with 1
CHI_SQ_3_MEDIAN = 2.366  # median of a chi-squared distribution with 3 degrees of freedom
# Keyframes move along the road until they fit their closures, so that what is left tells too little of the closures' error there.
LEAST_ALONG_FACTOR = 0.65
LARGEST_CHANGE = 2.0  # factor by which one estimate may change a sigma at most


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of all factors; those of odometry grow with the root of the driven metres.

    The defaults are wide: estimation begins with them and narrows them.
    """

    along: float = 0.10  # m per root m
    across: float = 0.05  # m per root m
    heading: float = 0.01  # rad per root m
    log_scale: float = 0.005  # per root m
    lateral_m: float = 0.3  # lateral sigma: the vehicle's distance from the lane's centreline
    lane_heading_rad: float = 0.05  # the vehicle's heading against the lane's direction
    closure_factor: float = 1.0  # factor on the closures' own sigmas
    closure_along_factor: float | None = None  # the same along the road, where it is estimated apart; None: as the others
    scale_inverse_freedom: float = 0.25  # 1 / degrees of freedom (Student-t) of the scale's steps, which may jump; 0: normal
    road_inverse_freedom: float = 1.0  # the same of the road's residuals: 1 is Cauchy, as turns are drawn otherwise than driven

    def step_sigmas(self, length_m: FloatArray) -> FloatArray:
        """Standard deviations (N, 4) of odometry over steps of the given lengths (N,): along, across, heading, log scale.

        They grow with the root of the length, as those of a random walk do.
        """
        root = np.sqrt(np.maximum(length_m, STANDSTILL_M))[:, None]
        sigmas: FloatArray = root * np.array([self.along, self.across, self.heading, self.log_scale])
        return sigmas

    def road_sigmas(self, curvature_1pm: FloatArray, added_lateral_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sigmas across the lane (N,), in metres, and of the heading against the lane's (N,): larger in bends.

        Bends are cut by drivers and drawn as polylines. ``added_lateral_m`` (N,) is a lateral sigma beyond the driver's.
        """
        lateral = np.hypot(np.hypot(self.lateral_m, added_lateral_m), BEND_CUT_M2 * curvature_1pm)
        heading = np.hypot(self.lane_heading_rad, BEND_SHIFT_M * curvature_1pm)
        return lateral, heading


def variance_factors(residual: FloatArray, count: float, freedom_used: FloatArray) -> FloatArray:
    """Factors (M,) by which the variances behind whitened residuals should change: sum r^2 / (count - freedom used).

    This is Helmert's variance component estimation: the solution uses up tr(J Sigma J^T) of the ``count`` degrees of freedom. It
    has the same fixed point as expectation maximisation (for Student-t: Lange, Little, Taylor 1989), but gets there in a few
    rounds. Residuals are counted, and their robust weights not summed, because a weight above 1 adds no freedom.

    Args:
        residual: whitened and robustly weighted, (N, M).
        count: number of residuals, without those that have next to no weight.
        freedom_used: tr(J Sigma J^T) per component, (M,).

    Returns:
        The factors, within ``LARGEST_CHANGE`` squared either way.
    """
    freedom_left = np.maximum(count - freedom_used, 1e-3 * count + 1.0)
    factor: FloatArray = np.clip(np.sum(residual**2, axis=0) / freedom_left, LARGEST_CHANGE**-2, LARGEST_CHANGE**2)
    return factor


def rescaled(
    noise: Noise, odometry: FloatArray, road: FloatArray, closure_median_sq: float | None, along_median_sq: float | None = None
) -> Noise:
    """The noise with its sigmas times the roots of variance factors, kept above ``FLOORS``.

    Args:
        noise: the noise so far.
        odometry: variance factors of odometry: along, across, heading, log scale, (4,).
        road: variance factors of the road: across the lane and heading, (2,) or more; the rest is ignored.
        closure_median_sq: median over the closures of their squared whitened residual of three components, without robust weight;
            None without closures. A median, as closures may be false.
        along_median_sq: the same of the component along the road alone.
    """
    names = ("along", "across", "heading", "log_scale", "lateral_m", "lane_heading_rad")
    factors = np.sqrt(np.concatenate([odometry, road[:2]]))
    updates = {n: float(max(getattr(noise, n) * f, FLOORS[n])) for n, f in zip(names, factors, strict=True)}
    closure_factor = noise.closure_factor
    if closure_median_sq is not None:
        closure_factor = float(np.clip(closure_factor * np.sqrt(closure_median_sq / CHI_SQ_3_MEDIAN), 0.2, 5.0))
    along_factor = noise.closure_along_factor
    if along_factor is not None and along_median_sq is not None:
        along_factor = float(np.clip(along_factor * np.sqrt(along_median_sq / CHI_SQ_1_MEDIAN), LEAST_ALONG_FACTOR, 5.0))
    return replace(noise, **updates, closure_factor=closure_factor, closure_along_factor=along_factor)
