"""The experience map: a vertex for each keyframe, an edge for each driven step and each loop closure, and how its poses relax.

Two departures from the paper. Edges hold raw odometry: the read-out of the attractor networks jumps at injections, so that edges
taken from it could never be matched to roads. Vertices are never merged, even where a place is recognised: the time and the
motion of a keyframe would be lost with its vertex.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from hippodrome.core import se2
from hippodrome.core.mapping.config import ExperienceMapConfig
from hippodrome.core.mapping.pose_graph import relax_pose_graph
from hippodrome.core.types import EdgeKind, Edges, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Closure:
    """A loop closure: a keyframe at a known place, as seen from the keyframe that made the place's view cell."""

    source: int  # vertex of the keyframe that made the view cell
    target: int  # vertex of the keyframe that was recognised
    motion: tuple[float, float, float]  # along, across, heading of the target seen from the source
    spacing: float  # distance between keyframes at the time, map units: the standard deviations are relative to it
    margin: float  # filtered margin of the recognition


def odometry_edges(motions: FloatArray, config: ExperienceMapConfig) -> Edges:
    """Edges between consecutive keyframes from their raw motions (S, 3); row 0 leads to the first keyframe and is no edge."""
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
    """The loop closures as edges, with standard deviations in map units."""
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


def with_median_offsets(closures: list[Closure], motions: FloatArray, config: ExperienceMapConfig) -> list[Closure]:
    """The closures ordered by target, each with the median along-track offset of the closures within ``steady_reach`` of it.

    While two passes of a road run side by side, the offset between the nth keyframe of one and of the other stays what it is, but
    for odometry's error. A single view measures it by a parabola through three scores; the median over some 30 m halves that
    error and takes out the outliers. Over longer ways the drift of the scale would outweigh what the median gains.

    Args:
        closures: loop closures in any order.
        motions: raw motion to each keyframe from the one before, (S, 3).
        config: its ``steady_reach`` is used.
    """
    ordered = sorted(closures, key=lambda c: (c.target, c.source))
    way = np.cumsum(np.hypot(motions[:, 0], motions[:, 1]))
    target_way = np.array([way[c.target] for c in ordered])
    offset = np.array([way[c.source] + c.motion[0] - way[c.target] for c in ordered])  # alike along one pass of a road
    smoothed = []
    for i, closure in enumerate(ordered):
        reach = config.steady_reach * closure.spacing
        first, last = np.searchsorted(target_way, [target_way[i] - reach, target_way[i] + reach], side="left")
        near = offset[first : last + 1]
        same_pass = near[np.abs(near - offset[i]) <= reach]
        along = closure.motion[0] + float(np.median(same_pass)) - float(offset[i])
        smoothed.append(replace(closure, motion=(along, *closure.motion[1:])))
    return smoothed


def concatenated(a: Edges, b: Edges) -> Edges:
    """One set of edges that holds the edges of ``a``, then those of ``b``."""
    return Edges(
        source=np.concatenate([a.source, b.source]),
        target=np.concatenate([a.target, b.target]),
        motion=np.concatenate([a.motion, b.motion]),
        sigma=np.concatenate([a.sigma, b.sigma]),
        kind=np.concatenate([a.kind, b.kind]),
        margin=np.concatenate([a.margin, b.margin]),
    )


def relaxed_poses(motions: FloatArray, edges: Edges, config: ExperienceMapConfig) -> FloatArray:
    """Poses (V, 3) of the vertices that fit the edges, the first at the origin; the search begins at dead reckoning.

    ``motions`` (V, 3) lead to each keyframe from the one before; row 0 is ignored.
    """
    reckoned = se2.integrate(np.zeros(3), np.concatenate([np.zeros((1, 3)), motions[1:]])[: len(motions)])
    if config.relaxation == "robust":
        return relax_pose_graph(reckoned, edges, config.pose_graph)
    return relax_ratslam(reckoned, edges, config.ratslam_correction, config.ratslam_sweeps)


def relax_ratslam(poses: FloatArray, edges: Edges, correction: float, sweeps: int) -> FloatArray:
    """Relax the experience map as RatSLAM does (Milford and Wyeth 2008): edge by edge, both ends are moved to reduce its error.

    Args:
        poses: before the correction, (V, 3).
        edges: odometry and closures, whose errors are corrected.
        correction: share of an edge's error that is corrected at once, half of it at either end.
        sweeps: passes over all edges.

    Returns:
        Poses (V, 3), moved so that the first is at the origin again.
    """
    relaxed: FloatArray = _relax(poses.copy(), edges.source, edges.target, edges.motion, 0.5 * correction, sweeps)
    seen_from_first: FloatArray = se2.between(relaxed[:1], relaxed)
    return seen_from_first


@njit(cache=True)
def _relax(poses: FloatArray, source: IntArray, target: IntArray, motion: FloatArray, share: float, sweeps: int) -> FloatArray:
    """The compiled part of ``relax_ratslam``: sweeps over the edges, which change ``poses`` (V, 3) in place.

    The error of an edge is the pose at which its motion, seen from its source, puts the target, less the target's pose. The
    target moves by ``share`` of the error, the source by as much the other way, so that the error becomes smaller.
    """
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
