"""Mode "lanes", a yardstick: a Bayes filter (histogram filter) on the lanes of the road network.

A state is a bin of 2 m on a lane, together with one of several scales. It cannot express a sideways offset from the lane or a
place off the road. It weighs all hypotheses at once, so that it needs no challenger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.localization.beliefs.belief import NetworkActivity, no_networks
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement
from hippodrome.core.roads.lane_graph import LaneGraph, build_lane_graph
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array

BIN_M = 2.0
SPREAD_M = 4.0  # the bins are moved whenever this much was driven at the map's scale
REACH_M = 24.0  # farthest that bins are moved at once: twice SPREAD_M, as the scale may be twice the map's, three times over
SCALE_STEP, SCALE_STEPS = 0.06, 21  # ln(scale) runs over two standard deviations of the prior on either side
CHANGE_SHARE = 0.02  # probability of a lane change while the bins are moved once
OUTLIER = 0.02  # likelihood of a measured pose at a wrong place, relative to the right one: one in eight names another place
ANYWHERE = 1e-3  # probability spread over all bins each time, as the vehicle may have been carried anywhere
LANE_HEADING_RAD = 0.25  # standard deviation of the vehicle's heading about the chord of its bin: bends and lane changes
NEAR_M = 15.0  # the read-out is the mean of the bins within this of the likeliest one
LEAST_MASS = 1e-12  # bins with less probability are not moved
SQ_UNKNOWN = 1e2  # rad^2: no prior knowledge of the heading


Int64Array: TypeAlias = NDArray[np.int64]


class _Reach(NamedTuple):
    """Bins ahead of each of N bins, as in ``LaneGraph``, for compiled functions."""

    start: Int64Array  # (N + 1,) the bins ahead of bin ``i`` are the rows ``start[i]:start[i + 1]``
    target: IntArray  # (R,) the bin ahead
    distance_m: Float32Array  # (R,) the way there
    changes: UInt8Array  # (R,) lane changes on the way, 0 or 1


@dataclass(frozen=True, slots=True, eq=False)
class LaneBelief:
    """Probabilities of bins and scales, and what was driven since the bins were moved; the heading has a filter of its own."""

    graph: LaneGraph
    probability: FloatArray  # (S, N) of scales and bins, sums to 1
    log_scales: FloatArray  # (S,)
    waiting: Motion  # driven since the bins were moved
    heading_rad: float
    sq_heading: float  # variance of the heading, rad^2
    config: BeliefConfig
    keeps_challenger: ClassVar[bool] = False

    @classmethod
    def uniform(cls, network: RoadNetwork, log_scale: float, config: BeliefConfig) -> Self:
        """Anywhere on the network; the scale is the map's, with the standard deviation of the motion's prior."""
        graph = build_lane_graph(network, REACH_M, BIN_M)
        offsets: FloatArray = SCALE_STEP * (np.arange(SCALE_STEPS, dtype=np.float64) - SCALE_STEPS // 2)
        prior = np.exp(-0.5 * (offsets / config.motion.scale_prior) ** 2)
        weight: FloatArray = np.repeat(prior[:, None], graph.bin_count, axis=1).astype(np.float64)
        return cls(graph, weight / weight.sum(), log_scale + offsets, Motion(0.0, 0.0, 0.0), 0.0, SQ_UNKNOWN, config)

    @property
    def log_scale(self) -> float:
        """Mean of ln(metres per map unit of this drive)."""
        return float(self.probability.sum(axis=1) @ self.log_scales)

    @property
    def pose(self) -> FloatArray:
        """Pose (3,): the mean around the likeliest bin, moved on by what was driven since."""
        position_m, _ = self._read_out()
        ahead_m = self.waiting.travelled * math.exp(self.log_scale)
        chord_rad = self.heading_rad - 0.5 * self.waiting.turned_rad
        east_m, north_m = ahead_m * math.cos(chord_rad), ahead_m * math.sin(chord_rad)
        return np.array([position_m[0] + east_m, position_m[1] + north_m, self.heading_rad])

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``, over all hypotheses."""
        covariance = np.zeros((3, 3))
        covariance[:2, :2], covariance[2, 2] = self._read_out()[1], self.sq_heading
        return covariance

    def activity(self) -> NetworkActivity:
        """The heading; a histogram filter has no attractor networks to report."""
        return no_networks(self.heading_rad, self.sq_heading)

    def _read_out(self) -> tuple[FloatArray, FloatArray]:
        """Mean position (2,) around the likeliest bin, and the covariance (2, 2) of all bins about it."""
        bins, points_m = self.probability.sum(axis=0), self.graph.points_m
        near = np.hypot(*(points_m - points_m[int(np.argmax(bins))]).T) < NEAR_M
        mean_m = bins[near] @ points_m[near] / bins[near].sum()
        apart_m = points_m - mean_m
        sq_within = BIN_M**2 / 12.0 + self.config.injection.across_m**2  # within a bin, and beside the centre of the lane
        return mean_m, (bins[:, None] * apart_m).T @ apart_m + sq_within * np.eye(2)

    def predict(self, motion: Motion) -> Self:
        """The heading turns at once; the bins are moved when enough was driven."""
        noise, waiting = self.config.motion, self.waiting
        walk = max(noise.gyro_rad_per_sqrt_s, motion.gyro_rad_per_sqrt_s)
        sq_heading = min(SQ_UNKNOWN, self.sq_heading + walk**2 * motion.dt_s + (noise.gyro_gain * motion.turned_rad) ** 2)
        heading_rad = float(wrap_compiled(self.heading_rad + motion.turned_rad))
        waiting = Motion(waiting.travelled + motion.travelled, waiting.turned_rad + motion.turned_rad, waiting.dt_s + motion.dt_s)
        turned = replace(self, waiting=waiting, heading_rad=heading_rad, sq_heading=sq_heading)
        due = waiting.travelled * math.exp(float(self.log_scales[SCALE_STEPS // 2])) >= SPREAD_M
        return turned._moved() if due else turned

    def _moved(self) -> Self:
        """The prediction step: bins are moved by what was driven and weighted by how well they fit the heading.

        The probability also diffuses between neighbouring scales, and a little of it goes to all bins.
        """
        graph, noise, driven = self.graph, self.config.motion, self.waiting
        sigma = noise.speed * math.sqrt(max(driven.dt_s, 1e-9)) / max(driven.dt_s, 1e-9)  # relative, of the distance
        reach = _Reach(graph.reach_start, graph.reach_bin, graph.reach_m, graph.reach_changes)
        moved = _moved_ahead(self.probability, driven.travelled * np.exp(self.log_scales), sigma, reach)
        share = noise.scale_walk_per_sqrt_m**2 * driven.travelled * math.exp(self.log_scale) / (2.0 * SCALE_STEP**2)
        padded = np.pad(moved, ((1, 1), (0, 0)), mode="edge")
        moved = (1.0 - 2.0 * share) * moved + share * (padded[:-2] + padded[2:])
        off_rad = wrap_compiled(graph.heading_rad - self.heading_rad)
        likelihood = OUTLIER + np.exp(-0.5 * off_rad**2 / (self.sq_heading + LANE_HEADING_RAD**2))
        weighted = moved * likelihood[None, :]
        total, anywhere = float(weighted.sum()), _anywhere(self.probability)
        kept = (1.0 - ANYWHERE) * weighted / total if total > 0.0 else 0.0
        return replace(self, probability=kept + (ANYWHERE if total > 0.0 else 1.0) * anywhere, waiting=Motion(0.0, 0.0, 0.0))

    def inject(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose: Bayes' rule for bins and scales, a scalar Kalman update for the heading."""
        due = self.waiting.travelled * math.exp(self.log_scale) >= BIN_M
        moved = self._moved() if due else self
        probability = moved.probability * moved._likelihood(measurement)[None, :]
        difference = float(wrap_compiled(measurement.pose[2] - self.heading_rad))
        total = self.sq_heading + measurement.covariance[2, 2]
        agrees = difference**2 < self.config.injection.gate * total
        gain = float(self.sq_heading / total) if agrees else 0.5  # in a conflict either may be the wrong one
        return replace(
            moved,
            probability=probability / probability.sum(),
            heading_rad=float(wrap_compiled(self.heading_rad + gain * difference)),
            sq_heading=float((1.0 - gain) * self.sq_heading + (0.0 if agrees else 0.25 * difference**2)),
        )

    def _likelihood(self, measurement: PoseMeasurement) -> FloatArray:
        """Likelihood (N,) of a measured pose at each bin, up to a factor; outliers included."""
        apart_m = self.graph.points_m - measurement.pose[:2]
        information = np.linalg.inv(measurement.covariance[:2, :2] + BIN_M**2 / 12.0 * np.eye(2))
        sq = np.einsum("ni,ij,nj->n", apart_m, information, apart_m)
        off_rad = wrap_compiled(self.graph.heading_rad - measurement.pose[2])
        sq += off_rad**2 / (measurement.covariance[2, 2] + LANE_HEADING_RAD**2)
        likelihood: FloatArray = OUTLIER + np.exp(-0.5 * sq)
        return likelihood


def _anywhere(probability: FloatArray) -> FloatArray:
    """Probabilities (S, N) that keep the belief about the scale but spread it evenly over all bins."""
    flat: FloatArray = np.repeat(probability.sum(axis=1, keepdims=True) / probability.shape[1], probability.shape[1], axis=1)
    return flat


@njit(cache=True)
def _moved_ahead(probability: FloatArray, driven_m: FloatArray, sigma: float, reach: _Reach) -> FloatArray:
    """Probabilities (S, N) after driving ``driven_m`` (S,), whose relative standard deviation is ``sigma``.

    Each bin's probability is shared among the bins ahead of it by how well their distances fit; dead ends lose theirs.
    """
    moved = np.zeros_like(probability)
    for s in range(probability.shape[0]):
        spread_m = max(0.5 * BIN_M, sigma * driven_m[s])
        for i in range(probability.shape[1]):
            if probability[s, i] < LEAST_MASS:
                continue
            total = 0.0
            for k in range(reach.start[i], reach.start[i + 1]):
                fit = _fit(reach.distance_m[k], driven_m[s], spread_m)
                if fit > 0.0:
                    total += fit * (CHANGE_SHARE if reach.changes[k] else 1.0)
            if total == 0.0:
                continue
            for k in range(reach.start[i], reach.start[i + 1]):
                fit = _fit(reach.distance_m[k], driven_m[s], spread_m)
                if fit > 0.0:
                    moved[s, reach.target[k]] += probability[s, i] / total * fit * (CHANGE_SHARE if reach.changes[k] else 1.0)
    return moved


@njit(cache=True)
def _fit(distance_m: float, driven_m: float, spread_m: float) -> float:
    """How well a distance fits the driven one: a Gaussian of the difference, 0 beyond three standard deviations ``spread_m``."""
    off = (distance_m - driven_m) / spread_m
    return math.exp(-0.5 * off * off) if abs(off) < 3.0 else 0.0
