"""Initial hypotheses of the route search: near a prior pose, or anywhere in the network if nothing is known.

If nothing is known, a coarse search begins in all bins at an *anchor*, a sample of the drive that much turning follows, as turns
tell roads apart. It goes over a short part of the drive only. The hypotheses that explain this part are refined to fine bins and
rated again over the same turns. The few that are left are traced backwards in time, from the anchor to the drive's beginning.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hippodrome.core.matching.search.backward import backward
from hippodrome.core.matching.search.coarse import good_states, hypotheses_in
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.floor import Floor
from hippodrome.core.matching.search.hypotheses import HYPOTHESIS, NOWHERE, PLACE, Hypotheses
from hippodrome.core.matching.search.passes import forward_pass, last_survivors
from hippodrome.core.matching.search.problem import InitialHypotheses, SearchProblem, compiled_drive, compiled_model
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.lane_graph import mirrored, reversed_network
from hippodrome.core.roads.lanes_ahead import SearchGraph, build_search_graph
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, StartPose

_HORIZON = 60  # steps (300 m) over which the turns after an anchor are counted: about what makes a start unique
_MOST_TURN_RAD = 0.5  # most that the turn of one step counts, so that U-turns do not outweigh other turns
_NO_PLACES = np.empty(0, PLACE)


def anchor_samples(track: Track, most: int) -> list[int]:
    """Up to ``most`` samples at which to begin the search for an unknown start, the best one first.

    The vehicle turns much after them, so that few places in the network fit. Turns count less the later they come, and not at all
    after ``_HORIZON`` steps. Chosen samples are at least ``_HORIZON`` steps apart.
    """
    turning = np.minimum(np.abs(np.diff(track.heading_rad, append=track.heading_rad[-1])), _MOST_TURN_RAD)
    weight = 1.0 - np.arange(_HORIZON) / _HORIZON
    turning_ahead = np.correlate(np.concatenate([turning, np.zeros(_HORIZON - 1)]), weight, "valid")
    chosen: list[int] = []
    for t in np.argsort(-turning_ahead, kind="stable").tolist():
        if all(abs(t - other) >= _HORIZON for other in chosen):
            chosen.append(t)
        if len(chosen) == most:
            break
    return chosen


class Start(NamedTuple):
    """Where the drive may have begun, by a search that began at one anchor."""

    initial: InitialHypotheses  # at the drive's beginning
    step_nats: float  # mean log likelihood of a step after the anchor, for the best of the hypotheses there; -inf: there is none


def starts_without_prior(problem: SearchProblem, coarse: SearchProblem, anchor: int, config: RouteSearchConfig) -> Start:
    """Find hypotheses for the beginning of the drive without a start pose, by a search that begins at sample ``anchor``.

    The coarse search rates all bins and scales at the anchor, a fine one those that it finds good; what both find good is traced
    back to the beginning of the drive.
    """
    return starts_from_states(problem, anchor, good_states(problem, coarse, anchor, config), config)


def starts_from_states(
    problem: SearchProblem, anchor: int, hypotheses: Hypotheses, config: RouteSearchConfig, floor: Floor | None = None
) -> Start:
    """As ``starts_without_prior``, from the states at the anchor that the coarse search finds good.

    What stays below the floor over the turns after the anchor is dropped.
    """
    hypotheses, step_nats = _good_over_horizon(problem, anchor, hypotheses, config, floor)
    if anchor == 0 or len(hypotheses) == 0:
        return Start(InitialHypotheses(hypotheses, _NO_PLACES), step_nats)
    return Start(_traced_to_beginning(problem, anchor, hypotheses, config, floor), step_nats)


def from_scratch(hypotheses: Hypotheses) -> InitialHypotheses:
    """The same hypotheses on the network with scores of 0: what their scores are of is still to be searched."""
    fresh = hypotheses.copy()
    fresh["score_nats"] = 0.0
    return InitialHypotheses(fresh, _NO_PLACES)


def starts_near_pose(problem: SearchProblem, start: StartPose, config: RouteSearchConfig) -> InitialHypotheses:
    """Hypotheses near a start pose, at every scale, and one at the pose itself, in case it lies off the network."""
    scales = len(problem.log_scale)
    prior = _prior_nats(problem.graph, start)
    near = np.flatnonzero(prior >= prior.max() - config.beam_nats).astype(np.int32)
    on_network = hypotheses_in(problem.graph, near, np.arange(scales, dtype=np.int32), float(problem.track.heading_rad[0]))
    on_network["score_nats"] = np.repeat(prior[near], scales)
    off, places = np.zeros(scales, HYPOTHESIS), np.zeros(scales, PLACE)
    off["bin"], off["scale_bin"] = -1 - np.arange(scales), np.arange(scales)
    off["score_nats"] = -config.off_network.leave_nats
    off["heading_offset_rad"] = float(wrap(np.array(start.heading_rad - problem.track.heading_rad[0])))
    places["x_m"], places["y_m"] = start.x_m, start.y_m
    places["driven_m"] = start.sigma_m / config.off_network.drift  # after so long a drive off the network it is as uncertain
    return InitialHypotheses(np.concatenate([on_network, off]), places)


def _prior_nats(graph: SearchGraph, start: StartPose) -> Float32Array:
    """Log prior (N,) of beginning in each bin, up to a constant: normal in the place and in the heading."""
    away = np.hypot(graph.points_m[:, 0] - start.x_m, graph.points_m[:, 1] - start.y_m) / start.sigma_m
    turned = wrap(graph.heading_rad.astype(np.float64) - start.heading_rad) / start.sigma_rad
    return (-0.5 * (away**2 + turned**2)).astype(np.float32)


def _good_over_horizon(
    problem: SearchProblem, anchor: int, hypotheses: Hypotheses, config: RouteSearchConfig, floor: Floor | None
) -> tuple[Hypotheses, float]:
    """Those of the hypotheses at the anchor that also explain the turns after it in fine bins, with their scores there.

    Without this, all fine states of a good coarse one would be traced back over the whole drive before it. The second value is
    the mean log likelihood of a step on the best route from any of them. There are none if no route scores ``least_nats``.
    """
    drive = compiled_drive(problem, problem.track.heading_rad[anchor : anchor + _HORIZON])
    steps = len(drive.heading_rad) - 1
    if steps < 1 or len(hypotheses) == 0:
        return hypotheses, 0.0
    model, initial = compiled_model(problem), from_scratch(hypotheses)  # the coarse scores are of the same turns
    fresh = initial.hypotheses
    least_nats = None if floor is None else floor.from_sample(anchor)[: len(drive.heading_rad)]
    survivors = forward_pass(drive, model, initial, config.beam_nats, config.most_survivors, least_nats=least_nats)
    if survivors.died_out and floor is not None:
        return fresh[:0], NOWHERE
    last = last_survivors(survivors).hypotheses["score_nats"]
    through = backward(drive, model, config.seed_margin_nats, survivors, np.zeros(len(last), np.float32))[: len(fresh)]
    fresh["score_nats"] = through
    return fresh[through > NOWHERE], NOWHERE if survivors.died_out else float(last.max()) / steps


def _traced_to_beginning(
    problem: SearchProblem, anchor: int, hypotheses: Hypotheses, config: RouteSearchConfig, floor: Floor | None
) -> InitialHypotheses:
    """Trace hypotheses at sample ``anchor`` to the beginning of the drive, by a search that runs backwards in time.

    It runs on the reversed network, where lanes are driven from their end to their beginning and all headings are turned by pi.
    """
    network = reversed_network(problem.network)
    graph = build_search_graph(network, problem.graph.reach_limit_m, problem.bin_m)
    backwards = replace(problem, network=network, graph=graph)
    drive = compiled_drive(backwards, problem.track.heading_rad[anchor::-1] + np.pi)
    initial = InitialHypotheses(_time_reversed(problem.graph, hypotheses), _NO_PLACES)
    least_nats = None if floor is None else floor.back_from_sample(anchor)
    survivors = forward_pass(
        drive, compiled_model(backwards), initial, config.beam_nats, config.most_survivors, least_nats=least_nats
    )
    if survivors.died_out and floor is not None:
        return InitialHypotheses(hypotheses[:0], _NO_PLACES)
    first, places = last_survivors(survivors)
    good = first["score_nats"] >= first["score_nats"].max() - config.seed_margin_nats
    first = _time_reversed(problem.graph, first[good])
    first["score_nats"] = 0.0  # the whole drive decides, and not this part of it
    return InitialHypotheses(first, places)


def _time_reversed(graph: SearchGraph, hypotheses: Hypotheses) -> Hypotheses:
    """Convert hypotheses between a lane graph and that of the reversed network: the same places, with time running backwards.

    Bins are counted from the other end of their lane, and the driven length beyond a bin's centre changes its sign.
    """
    turned = hypotheses.copy()
    turned["bin"], turned["remainder_m"] = mirrored(graph, hypotheses["bin"]), -hypotheses["remainder_m"]
    return turned
