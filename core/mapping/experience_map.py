"""The experience map: a vertex per visit, an edge per driven step and per loop closure, and how its poses relax.

Edges hold raw odometry. The attractor read-out jumps at injections, so edges taken from it could never be matched to roads.
Vertices are never merged: a visit's time and motion would be lost with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numba import njit

from hippodrome.core import se2
from hippodrome.core.mapping.pose_graph import PoseGraphConfig, optimise
from hippodrome.core.types import EdgeKind, Edges, FloatArray, IntArray


@dataclass(frozen=True)
class ExperienceMapConfig:
    """Standard deviations of the edges: lengths relative to the way driven or to the view spacing, so that no unit enters."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    relaxation: Literal["robust", "ratslam"] = "robust"
    pose_graph: PoseGraphConfig = field(default_factory=PoseGraphConfig)
    odometry_along: float = 0.1  # of the step: slow drift of the scale, as a random walk
    odometry_across: float = 0.02  # of the step
    odometry_turn_rad: float = 0.02  # per step: some tens of degrees over a thousand
    closure_along: float = 0.2  # view spacings: 1 m at 5 m
    closure_across: float = 0.1  # view spacings
    closure_turn_rad: float = 0.06
    steady_reach: float = 3.0  # view spacings before and after: longer, and the drift of the scale outweighs the median
    ratslam_correction: float = 0.5  # share of each link's error that is corrected per sweep
    ratslam_sweeps: int = 100  # RatSLAM relaxes a few sweeps per frame; at the end of a drive it has had thousands

    def __post_init__(self) -> None:
        odometry = (self.odometry_along, self.odometry_across, self.odometry_turn_rad)
        closure = (self.closure_along, self.closure_across, self.closure_turn_rad)
        if min(*odometry, *closure) <= 0.0:
            raise ValueError("experience map: standard deviations must be positive")
        if not 0.0 < self.ratslam_correction <= 1.0 or self.ratslam_sweeps < 1:
            raise ValueError("experience map: ratslam_correction must lie in (0, 1] and ratslam_sweeps be at least 1")


@dataclass(frozen=True, slots=True)
class Closure:
    """A later visit of a place, and how it is seen from the visit that made the place's view cell."""

    source: int
    target: int
    motion: tuple[float, float, float]  # along, across, heading of the target seen from the source
    spacing: float  # view spacing at the time: what the standard deviations are relative to
    margin: float


def odometry_edges(motions: FloatArray, config: ExperienceMapConfig) -> Edges:
    """Edges between consecutive visits; ``motions`` (S, 3), row 0 belongs to no edge."""
    steps = motions[1:]
    count = len(steps)
    length = np.hypot(steps[:, 0], steps[:, 1])
    typical = float(np.median(length)) if count else 1.0
    floor = np.maximum(length, 0.1 * typical)  # a turn on the spot is not free of error
    share = np.array([config.odometry_along, config.odometry_across])
    sigma = np.concatenate([floor[:, None] * share, np.full((count, 1), config.odometry_turn_rad)], axis=1)
    source = np.arange(count, dtype=np.int32)
    kind = np.full(count, EdgeKind.ODOMETRY, dtype=np.uint8)
    return Edges(source, source + np.int32(1), steps, sigma, kind, np.zeros(count, dtype=np.float32))


def closure_edges(closures: list[Closure], config: ExperienceMapConfig) -> Edges:
    """Edges across loop closures."""
    count = len(closures)
    relative = np.array([config.closure_along, config.closure_across])
    spacing = np.array([c.spacing for c in closures]).reshape(count, 1)
    return Edges(
        source=np.array([c.source for c in closures], dtype=np.int32),
        target=np.array([c.target for c in closures], dtype=np.int32),
        motion=np.array([c.motion for c in closures], dtype=np.float64).reshape(count, 3),
        sigma=np.concatenate([spacing * relative, np.full((count, 1), config.closure_turn_rad)], axis=1),
        kind=np.full(count, EdgeKind.CLOSURE, dtype=np.uint8),
        margin=np.array([c.margin for c in closures], dtype=np.float32),
    )


def steadied(closures: list[Closure], motions: FloatArray, config: ExperienceMapConfig) -> list[Closure]:
    """Closures in the order of their targets, each with the median along-track offset of its stretch.

    While two passes of a road run side by side, odometry says how their offset goes on: it does not change. A single view's
    offset is a parabola through three scores; the median over some 30 m of way halves its error and mends the outliers.
    """
    ordered = sorted(closures, key=lambda c: (c.target, c.source))
    way = np.cumsum(np.hypot(motions[:, 0], motions[:, 1]))
    at = np.array([way[c.target] for c in ordered])
    lead = np.array([way[c.source] + c.motion[0] - way[c.target] for c in ordered])  # constant along a stretch
    steady = []
    for i, closure in enumerate(ordered):
        reach = config.steady_reach * closure.spacing
        first, last = np.searchsorted(at, [at[i] - reach, at[i] + reach], side="left")
        leads = lead[first : last + 1]
        same_stretch = leads[np.abs(leads - lead[i]) <= reach]
        along = closure.motion[0] + float(np.median(same_stretch)) - float(lead[i])
        steady.append(replace(closure, motion=(along, *closure.motion[1:])))
    return steady


def joined(a: Edges, b: Edges) -> Edges:
    """Both sets of edges."""
    return Edges(
        source=np.concatenate([a.source, b.source]),
        target=np.concatenate([a.target, b.target]),
        motion=np.concatenate([a.motion, b.motion]),
        sigma=np.concatenate([a.sigma, b.sigma]),
        kind=np.concatenate([a.kind, b.kind]),
        margin=np.concatenate([a.margin, b.margin]),
    )


def relaxed_poses(motions: FloatArray, edges: Edges, config: ExperienceMapConfig) -> FloatArray:
    """Poses (V, 3) of the vertices, the first at the origin; visit ``i`` is vertex ``i``."""
    reckoned = se2.integrate(np.zeros(3), np.concatenate([np.zeros((1, 3)), motions[1:]])[: len(motions)])
    if config.relaxation == "robust":
        return optimise(reckoned, edges, config.pose_graph)
    return relax_ratslam(reckoned, edges, config.ratslam_correction, config.ratslam_sweeps)


def relax_ratslam(poses: FloatArray, edges: Edges, correction: float, sweeps: int) -> FloatArray:
    """RatSLAM's experience map correction: every link in turn moves both its ends by half of ``correction`` of its error."""
    relaxed: FloatArray = _relax(poses.copy(), edges.source, edges.target, edges.motion, 0.5 * correction, sweeps)
    back_home: FloatArray = se2.between(relaxed[:1], relaxed)
    return back_home


@njit(cache=True)
def _relax(poses: FloatArray, source: IntArray, target: IntArray, motion: FloatArray, share: float, sweeps: int) -> FloatArray:
    for _ in range(sweeps):
        for e in range(len(source)):
            a, b = source[e], target[e]
            cos, sin = np.cos(poses[a, 2]), np.sin(poses[a, 2])
            dx = poses[a, 0] + cos * motion[e, 0] - sin * motion[e, 1] - poses[b, 0]
            dy = poses[a, 1] + sin * motion[e, 0] + cos * motion[e, 1] - poses[b, 1]
            turn = se2.wrap_compiled(poses[a, 2] + motion[e, 2] - poses[b, 2])
            poses[a, 0] -= share * dx
            poses[a, 1] -= share * dy
            poses[a, 2] -= share * turn
            poses[b, 0] += share * dx
            poses[b, 1] += share * dy
            poses[b, 2] += share * turn
    return poses
