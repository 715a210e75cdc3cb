"""A yardstick: a Bayes filter on the lane graph, given the same motions and injections.

The state is a bin of 2 m on a lane and a step of the scale; what moves the vehicle sideways or off the road it cannot say. It
keeps every hypothesis at once, so that it needs no challengers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.localization.beliefs.motion import Motion
from hippodrome.core.localization.config import Injection, LocalizerConfig
from hippodrome.core.roads.lane_graph import LaneGraph, build_lane_graph
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

BIN_M = 2.0
REACH_M = 24.0  # longest spread at once: twice the drive of 4 m that makes one due, at twice the scale, and its tail
SPREAD_M = 4.0  # driven distance, at the map's scale, after which the bins are moved
SCALE_STEP, SCALE_STEPS = 0.06, 21  # of ln(scale): two standard deviations of the prior on either side
CHANGE_SHARE = 0.02  # of a lane change within one spread
OUTLIER = 0.02  # likelihood of an injection anywhere, relative to that at its place: one in eight names another place
ANYWHERE = 1e-3  # of the mass, spread over all bins each time: nothing is ever ruled out, a kidnapping least of all
LANE_HEADING_RAD = 0.25  # of a vehicle against its lane's chord: bends and lane changes
NEAR_M = 15.0  # the read-out is the mean of the bins around the likeliest
SQ_UNKNOWN = 1e2  # rad^2


@dataclass(frozen=True, slots=True, eq=False)
class LanePose:
    """``belief`` (S, N) over scales and bins, summing to 1; ``waiting`` is what was driven since the bins were moved."""

    graph: LaneGraph
    belief: FloatArray
    log_scales: FloatArray  # (S,)
    waiting: Motion
    heading_rad: float
    sq_heading: float
    config: LocalizerConfig

    @classmethod
    def uniform(cls, network: RoadNetwork, log_scale: float, config: LocalizerConfig) -> Self:
        """Anywhere on the network; the scale is the map's with the motion's prior about it."""
        graph = build_lane_graph(network, REACH_M, BIN_M)
        offsets: FloatArray = SCALE_STEP * (np.arange(SCALE_STEPS, dtype=np.float64) - SCALE_STEPS // 2)
        prior = np.exp(-0.5 * (offsets / config.motion.scale_prior) ** 2)
        belief: FloatArray = np.repeat(prior[:, None], graph.bin_count, axis=1).astype(np.float64)
        return cls(graph, belief / belief.sum(), log_scale + offsets, Motion(0.0, 0.0, 0.0), 0.0, SQ_UNKNOWN, config)

    @property
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive), the mean."""
        return float(self.belief.sum(axis=1) @ self.log_scales)

    @property
    def pose(self) -> FloatArray:
        """(3,) the mean around the likeliest bin, and what was driven since."""
        xy_m, _ = self._read_out()
        ahead_m = self.waiting.travelled * math.exp(self.log_scale)
        heading_rad = self.heading_rad - 0.5 * self.waiting.turned_rad
        return np.array([xy_m[0] + ahead_m * math.cos(heading_rad), xy_m[1] + ahead_m * math.sin(heading_rad), self.heading_rad])

    @property
    def covariance(self) -> FloatArray:
        """(3, 3) of ``pose``, over all hypotheses."""
        covariance = np.zeros((3, 3))
        covariance[:2, :2], covariance[2, 2] = self._read_out()[1], self.sq_heading
        return covariance

    def _read_out(self) -> tuple[FloatArray, FloatArray]:
        bins, points = self.belief.sum(axis=0), self.graph.points_m
        near = np.hypot(*(points - points[int(np.argmax(bins))]).T) < NEAR_M
        xy_m = bins[near] @ points[near] / bins[near].sum()
        apart = points - xy_m
        along = BIN_M**2 / 12.0 + self.config.injection.across_m**2  # within a bin, and of the driver beside the lane's centre
        return xy_m, (bins[:, None] * apart).T @ apart + along * np.eye(2)

    def predict(self, motion: Motion) -> Self:
        """The heading turns; the bins move once enough was driven."""
        noise, waiting = self.config.motion, self.waiting
        walk = max(noise.gyro_rad_per_sqrt_s, motion.gyro_rad_per_sqrt_s)
        sq_heading = min(SQ_UNKNOWN, self.sq_heading + walk**2 * motion.dt_s + (noise.gyro_gain * motion.turned_rad) ** 2)
        heading_rad = float(wrap_compiled(self.heading_rad + motion.turned_rad))
        waiting = Motion(waiting.travelled + motion.travelled, waiting.turned_rad + motion.turned_rad, waiting.dt_s + motion.dt_s)
        moved = replace(self, waiting=waiting, heading_rad=heading_rad, sq_heading=sq_heading)
        due = waiting.travelled * math.exp(float(self.log_scales[SCALE_STEPS // 2])) >= SPREAD_M
        return moved._spread() if due else moved

    def _spread(self) -> Self:
        graph, noise, driven = self.graph, self.config.motion, self.waiting
        sigma = noise.speed * math.sqrt(max(driven.dt_s, 1e-9)) / max(driven.dt_s, 1e-9)  # relative, of the distance
        moved = _moved(
            self.belief, driven.travelled * np.exp(self.log_scales), sigma, (graph.reach_start, graph.reach_bin, graph.reach_m,
            graph.reach_changes),
        )  # fmt: skip
        walk = noise.scale_walk_per_sqrt_m**2 * driven.travelled * math.exp(self.log_scale) / (2.0 * SCALE_STEP**2)
        padded = np.pad(moved, ((1, 1), (0, 0)), mode="edge")
        moved = (1.0 - 2.0 * walk) * moved + walk * (padded[:-2] + padded[2:])
        turned = wrap_compiled(graph.heading_rad - self.heading_rad)
        seen = moved * (OUTLIER + np.exp(-0.5 * turned**2 / (self.sq_heading + LANE_HEADING_RAD**2)))[None, :]
        total, anywhere = float(seen.sum()), _anywhere(self.belief)
        kept = (1.0 - ANYWHERE) * seen / total if total > 0.0 else 0.0
        return replace(self, belief=kept + (ANYWHERE if total > 0.0 else 1.0) * anywhere, waiting=Motion(0.0, 0.0, 0.0))

    def inject(self, injection: Injection) -> Self:
        """Bayes' rule; the heading by its own scalar filter."""
        moved = self._spread() if self.waiting.travelled * math.exp(self.log_scale) >= BIN_M else self
        apart = moved.graph.points_m - injection.pose[:2]
        sq = np.einsum("ni,ij,nj->n", apart, np.linalg.inv(injection.covariance[:2, :2] + BIN_M**2 / 12.0 * np.eye(2)), apart)
        sq += wrap_compiled(moved.graph.heading_rad - injection.pose[2]) ** 2 / (injection.covariance[2, 2] + LANE_HEADING_RAD**2)
        belief = moved.belief * (OUTLIER + np.exp(-0.5 * sq))[None, :]
        difference = float(wrap_compiled(injection.pose[2] - self.heading_rad))
        total = self.sq_heading + injection.covariance[2, 2]
        agrees = difference**2 < self.config.injection.gate * total
        gain = float(self.sq_heading / total) if agrees else 0.5  # a conflict: either may be the wrong one
        return replace(
            moved,
            belief=belief / belief.sum(),
            heading_rad=float(wrap_compiled(self.heading_rad + gain * difference)),
            sq_heading=float((1.0 - gain) * self.sq_heading + (0.0 if agrees else 0.25 * difference**2)),
        )


def _anywhere(belief: FloatArray) -> FloatArray:
    """The scales as they are believed, the bins all alike."""
    flat: FloatArray = np.repeat(belief.sum(axis=1, keepdims=True) / belief.shape[1], belief.shape[1], axis=1)
    return flat


@njit(cache=True)
def _moved(
    belief: FloatArray, driven_m: FloatArray, sigma: float, reach: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
) -> FloatArray:
    """Each bin's mass over the bins about ``driven_m`` (S,) ahead of it, shared by how well their distance fits."""
    start, target, metres, changes = reach
    moved = np.zeros_like(belief)
    for s in range(belief.shape[0]):
        distance = driven_m[s]
        spread = max(0.5 * BIN_M, sigma * distance)
        for i in range(belief.shape[1]):
            mass = belief[s, i]
            if mass < 1e-12:
                continue
            total = 0.0
            for k in range(start[i], start[i + 1]):
                off = (metres[k] - distance) / spread
                if abs(off) < 3.0:
                    total += math.exp(-0.5 * off * off) * (CHANGE_SHARE if changes[k] else 1.0)
            if total == 0.0:
                continue
            for k in range(start[i], start[i + 1]):
                off = (metres[k] - distance) / spread
                if abs(off) < 3.0:
                    moved[s, target[k]] += mass / total * math.exp(-0.5 * off * off) * (CHANGE_SHARE if changes[k] else 1.0)
    return moved
