"""Route search: a hidden Markov model over (position on the lane graph) x (log scale), with unknown start and scale.

It is Viterbi map matching in the manner of P. Newson and J. Krumm, "Hidden Markov map matching through noise and sparseness",
2009, but what is observed is motion instead of positions: the heading and length of each step. It sees the raw motions only, so
that false loop closures cannot hurt it. ``starts`` tells how an unknown start is found; from there, bins of 1 m are searched over
the whole drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.matching.search.coarse import coarse_problem
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.passes import TracedRoute, most_likely_route
from hippodrome.core.matching.search.problem import InitialHypotheses, SearchProblem, search_problem
from hippodrome.core.matching.search.starts import Start, anchor_samples, starts_near_pose, starts_without_prior
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.types import Float32Array, FloatArray, HippodromeError, IntArray, StartPose, Visits

_WINDOW = 24  # steps (120 m) over which the score is averaged: single corners must not decide
_SETTLED = 200  # steps (1 km): a wrong route explains no drive for so long


@dataclass(frozen=True, slots=True, eq=False)
class RouteAlternatives:
    """Places other than the best route's: sample ``t`` of the track owns rows ``row_start[t]:row_start[t + 1]``."""

    row_start: NDArray[np.int64]  # (T + 1,)
    points_m: Float32Array  # (rows, 2)
    through_nats: Float32Array  # (rows,) score of the best complete route through this place, less that of the best of all
    log_scale: FloatArray  # (rows,) ln(metres per map unit) of that route there


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """The most likely route through the T samples of a track, and the alternatives to it."""

    track: Track
    points_m: FloatArray  # (T, 2) on the lane, or dead-reckoned off the network
    lane: IntArray  # (T,) -1: off the network
    position_m: FloatArray  # (T,) arc length on the lane; nan off the network
    log_scale: FloatArray  # (T,) ln(metres per map unit)
    heading_offset_rad: FloatArray  # (T,) network heading minus odometry heading
    score_nats: FloatArray  # (T,) log likelihood of each step
    total_nats: float  # log likelihood of the whole route
    alternatives: RouteAlternatives

    def explained(self, limit_nats: float) -> BoolArray:
        """Mask (T,) of the samples that lie on the network, in no window of which a step costs ``limit_nats`` in the mean."""
        width = min(_WINDOW, len(self.score_nats))
        mean_score = np.convolve(self.score_nats, np.full(width, 1.0 / width), "valid")
        bad = np.convolve(mean_score <= -limit_nats, np.ones(width), "full") > 0.5
        mask: BoolArray = ~bad & (self.lane >= 0)
        return mask

    def settles(self, anchor: int, limit_nats: float) -> bool:
        """Whether the route explains the whole drive, or a long part of it with the anchor inside.

        A search that begins elsewhere would find nothing better.
        """
        unexplained = np.flatnonzero(~self.explained(limit_nats))
        place = np.searchsorted(unexplained, anchor)
        bounds = np.concatenate([[-1], unexplained, [len(self.lane)]])
        around = int(bounds[place + 1] - bounds[place] - 1)
        return around >= min(_SETTLED, len(self.lane))


def search_route(visits: Visits, network: RoadNetwork, config: RouteSearchConfig, start: StartPose | None = None) -> Route:
    """The most likely drive through the network.

    Without a start pose the search begins at an anchor, the sample of the drive that most turning follows. Should no place of the
    network fit the turns after it, or should the answer leave the drive around it unexplained, other anchors are tried too (the
    first may lie on a road that the network lacks), and the answer that explains the whole drive best is kept.

    Args:
        visits: the drive's raw motions, in map units.
        network: the roads.
        config: states, bounds and costs.
        start: a prior on the drive's first pose, in the network frame; the drive need not begin there exactly.

    Raises:
        HippodromeError: the vehicle never moved, or no route of the network is as long as the drive.
    """
    return most_likely_drive(search_problem(visits, network, config), config, start)


def most_likely_drive(problem: SearchProblem, config: RouteSearchConfig, start: StartPose | None = None) -> Route:
    """As ``search_route``, for a problem that is set up already."""
    if start is not None:
        return best_route(problem, starts_near_pose(problem, start, config), config)
    coarse = coarse_problem(problem, config)
    routes: list[Route] = []
    poor: list[Start] = []
    for anchor in anchor_samples(problem.track, config.anchors):
        start_there = starts_without_prior(problem, coarse, anchor, config)
        if start_there.step_nats < -config.good_start_nats:
            poor.append(start_there)
            continue
        routes.append(best_route(problem, start_there.initial, config))
        if routes[-1].settles(anchor, config.off_network.step_nats):
            break
    if not routes:
        best_start = max(poor, key=lambda candidate: candidate.step_nats)
        routes.append(best_route(problem, best_start.initial, config))
    return max(routes, key=lambda route: route.total_nats)


def best_route(
    problem: SearchProblem, initial: InitialHypotheses, config: RouteSearchConfig, place_prior: FloatArray | None = None
) -> Route:
    """The most likely route from given hypotheses at the drive's first sample.

    Args:
        problem: the drive, the lane graph, the scales and the costs.
        initial: hypotheses to begin with.
        config: bounds of the search.
        place_prior: (T, 3) x, y and 1/sigma^2 of the place at each sample of the track, as far as it is known.

    Raises:
        HippodromeError: no route of the network is as long as the drive.
    """
    traced = most_likely_route(problem, initial, config, place_prior)
    if traced is None:
        length_m = problem.track.arc[-1] * np.exp(np.mean(problem.log_scale))
        raise HippodromeError(
            f"cognitive map: no route of this network is about {length_m:.0f} m long; is it the one that was driven?"
        )
    return _route(problem, traced)


def _route(problem: SearchProblem, traced: TracedRoute) -> Route:
    """The traced route in terms of lanes and arc lengths on them instead of bins of the lane graph."""
    graph, hypotheses = problem.graph, traced.hypotheses
    on_network, bin_ = hypotheses["bin"] >= 0, np.maximum(hypotheses["bin"], 0)
    lane = graph.lane[bin_]
    position = np.clip(graph.position_m[bin_] + hypotheses["remainder_m"], 0.0, problem.network.lane_lengths_m()[lane])
    return Route(
        track=problem.track,
        points_m=traced.points_m,
        lane=np.where(on_network, lane, -1).astype(np.int32),
        position_m=np.where(on_network, position, np.nan),
        log_scale=problem.log_scale[hypotheses["scale_bin"]],
        heading_offset_rad=hypotheses["heading_offset_rad"].astype(np.float64),
        score_nats=np.diff(traced.score_nats, prepend=0.0),
        total_nats=float(traced.score_nats[-1]),
        alternatives=_alternatives(problem, traced),
    )


def _alternatives(problem: SearchProblem, traced: TracedRoute) -> RouteAlternatives:
    """The alternatives with their scales in place of the scales' numbers."""
    found = traced.alternatives
    return RouteAlternatives(found.row_start, found.points_m, found.through_nats, problem.log_scale[found.scale_bin])
