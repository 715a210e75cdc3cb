"""Decoys as a control: how well chance explains a drive in this very network.

A decoy is a drive that never was: the real one with every turn to the other side, or with its turns in reverse order. Whatever
route explains a decoy well does so by chance, and in the same network, at the same length and with as many turns as the drive
itself: its cost is what chance achieves. A right route costs far less. A wrong one costs about as much as a decoy, sometimes a
little more, sometimes a little less. Decoys have this use where sequences are identified in a database (J. E. Elias, S. P. Gygi,
"Target-decoy search strategy", 2007).

Two decoys are used because each has a blind spot. Where traffic keeps right, U-turns and sharp turns are driven to one side only,
so that a mirrored drive fits badly whatever the network. And a drive with few turns, reversed, may be much like itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from hippodrome.core.matching.search.coarse import CoarseStates, coarse_problem, good_states
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.floor import Floor
from hippodrome.core.matching.search.hypotheses import NOWHERE
from hippodrome.core.matching.search.passes import best_nats
from hippodrome.core.matching.search.problem import SearchProblem
from hippodrome.core.matching.search.route import Route
from hippodrome.core.matching.search.starts import anchor_samples, from_scratch, starts_from_states
from hippodrome.core.matching.search.track import Track

Control: TypeAlias = Callable[[int, int, float, float], float]  # the last four arguments of ``decoy_nats``, and its answer

FACTOR = 2.0  # chance must cost at least this many times what the route costs: wrong ones cost 0.6 to 1.6 times as much
_WINDOW = 120  # steps (600 m) around the most turning that are tried by themselves: there may be misfits elsewhere
_MOST_BINS = 25_000  # coarse bins (100 km of lanes) around a part that its decoys may begin in
_LOG_SCALE = 0.4  # most that the log scale at which a decoy begins differs from that of the part
_GOOD_STEP_NATS = (
    0.5  # mean cost of a step up to which a longer part is tried as a whole: a right route has 0.1-0.3, chance about 1
)
_LEAST_TURN_RAD = 0.7  # less turning than half a crossing fits everywhere, to the left as to the right


def control_of(problem: SearchProblem, config: RouteSearchConfig, route: Route) -> Control:
    """The control for the parts of one drive and its route."""
    return partial(decoy_nats, problem, coarse_problem(problem, config), config, route)


def decoy_nats(
    problem: SearchProblem, coarse: SearchProblem, config: RouteSearchConfig, route: Route, first: int, end: int,
    least_nats: float, settled_nats: float,
) -> float:  # fmt: skip
    """Log likelihood of the best route of a decoy of the samples ``first`` to ``end - 1`` of the drive, from an unknown start.

    It is that of the better explained one of two decoys, or -inf if both stay below ``least_nats``; the search ends as soon as
    that is so. The second decoy is not searched if the first one reaches ``settled_nats``.
    """
    best, among = NOWHERE, _around(coarse, route, first, end)
    for make_decoy in (mirrored_part, reversed_part):
        if best < settled_nats:
            decoy = replace(problem, track=make_decoy(problem.track, first, end))
            best = max(best, _best_decoy_nats(decoy, coarse, config, Floor.over(decoy.track, max(best, least_nats)), among))
    return best


def _best_decoy_nats(
    decoy: SearchProblem, coarse: SearchProblem, config: RouteSearchConfig, floor: Floor, among: CoarseStates
) -> float:
    """Log likelihood of the best route of one decoy from an unknown start, or -inf if it stays below the floor.

    The search begins at an anchor in the first half. Few decoys get over the samples after it, and need not be traced back.
    """
    samples = len(decoy.track.arc)
    anchor = next((t for t in anchor_samples(decoy.track, samples) if t <= samples // 2), 0)
    hypotheses = good_states(decoy, coarse, anchor, config, floor, among)
    onward = best_nats(decoy, from_scratch(hypotheses), config, floor, anchor)
    if anchor == 0 or onward == NOWHERE:
        return onward
    return best_nats(decoy, starts_from_states(decoy, anchor, hypotheses, config, floor).initial, config, floor)


def _around(coarse: SearchProblem, route: Route, first: int, end: int) -> CoarseStates:
    """The coarse states in which decoys of a part of the route begin: in its surroundings, at about its scale.

    Chance has as much to choose from there as elsewhere, so that a country need not be searched for what a town tells.
    """
    away = np.hypot(*(coarse.graph.points_m - route.points_m[first:end].mean(axis=0)).T)
    bins = np.sort(np.argpartition(away, _MOST_BINS)[:_MOST_BINS]) if len(away) > _MOST_BINS else np.arange(len(away))
    off = np.abs(coarse.log_scale - np.median(route.log_scale[first:end]))
    return CoarseStates(bins.astype(np.int32), np.flatnonzero(off <= max(_LOG_SCALE, off.min())).astype(np.int32))


def mirrored_part(track: Track, first: int, end: int) -> Track:
    """The samples ``first`` to ``end - 1`` of a track with every turn to the other side."""
    arc, heading = track.arc[first:end] - track.arc[first], track.heading_rad[first:end]
    return Track(arc, heading[0] - heading, arc, track.step)


def reversed_part(track: Track, first: int, end: int) -> Track:
    """The samples ``first`` to ``end - 1`` of a track with its turns in reverse order, each to its own side."""
    arc, heading = track.arc[first:end] - track.arc[first], track.heading_rad[first:end]
    return Track(arc, heading[-1] - heading[::-1], arc, track.step)


def evidence_nats(route: Route, first: int, end: int, control: Control, enough_nats: float) -> float:
    """Evidence that the samples ``first`` to ``end - 1`` of the route were driven: ``FACTOR`` times their log likelihood, less
    that of the decoys.

    It is cut off at ``enough_nats``. The turns around one place are tried if the whole part leaves it open, or is too poor. They
    are not if decoys explain the whole as well as the route does.
    """
    if turned_rad(route.track, first, end) < _LEAST_TURN_RAD:
        return 0.0
    window_first, window_end = _most_turning(route.track, first, end)
    is_good = float(np.mean(route.score_nats[first + 1 : end])) > -_GOOD_STEP_NATS
    if (window_first, window_end) == (first, end) or not is_good:
        return _evidence_within(route, window_first, window_end, control, enough_nats)
    found = _evidence_within(route, first, end, control, enough_nats)
    chance_does_as_well = found <= _own_nats(route, first, end) / FACTOR
    if found < enough_nats and not chance_does_as_well and _is_evident(route, window_first, window_end, control, enough_nats):
        return enough_nats
    return found


def turned_rad(track: Track, first: int, end: int) -> float:
    """By how much the headings of a part of the track differ at most."""
    return float(np.ptp(track.heading_rad[first:end]))


def _evidence_within(route: Route, first: int, end: int, control: Control, enough_nats: float) -> float:
    """``evidence_nats`` of exactly these samples. It is not told by how much it is below 0."""
    own = _own_nats(route, first, end)
    return min(own - control(first, end, own - enough_nats, own), enough_nats)


def _is_evident(route: Route, first: int, end: int, control: Control, enough_nats: float) -> bool:
    """Whether the evidence of exactly these samples is as much as ``enough_nats``."""
    own = _own_nats(route, first, end)
    return control(first, end, own - enough_nats, own - enough_nats) <= own - enough_nats


def _own_nats(route: Route, first: int, end: int) -> float:
    """``FACTOR`` times the log likelihood of these samples of the route. The step that leads to the first does not count."""
    return FACTOR * float(np.sum(route.score_nats[first + 1 : end]))


def _most_turning(track: Track, first: int, end: int) -> tuple[int, int]:
    """First and end sample of the ``_WINDOW`` samples within a part of the track over which the vehicle turns most."""
    if end - first <= _WINDOW:
        return first, end
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(track.heading_rad[first:end])))])
    begin = first + int(np.argmax(turned[_WINDOW - 1 :] - turned[: len(turned) - _WINDOW + 1]))
    return begin, begin + _WINDOW
