"""Forward and backward pass of the search over a whole drive, in bounded memory.

The forward pass keeps its survivors at checkpoints only. The backward pass begins with the last section of the drive and makes
the survivors of each section anew from its checkpoint, as in J. A. Grice, R. Hughey, D. Speck, "Reduced space sequence
alignment", 1997. The answer is that of one search over the whole drive; a drive of a single section is searched once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hippodrome.core.matching.search.backward import Alternatives, alternatives, backward
from hippodrome.core.matching.search.beam import BeamLimits, Survivors, forward
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.floor import Floor
from hippodrome.core.matching.search.hypotheses import NOWHERE, Hypotheses
from hippodrome.core.matching.search.model import Drive, SearchModel
from hippodrome.core.matching.search.problem import InitialHypotheses, SearchProblem, compiled_drive, compiled_model
from hippodrome.core.types import Float32Array, FloatArray, IntArray

_MAX_ROWS = 8_000_000  # hypotheses of a section: 200 MB
_EXACT_NATS = 4000.0  # scores below minus this are shifted back to 0, as single precision rounds them by 0.0005 and more
_CELL_M = 8.0  # length of the cells that lanes are divided into: alternatives in one cell count as one


class TracedRoute(NamedTuple):
    """The best route's hypotheses and places at T samples, and its alternatives."""

    hypotheses: Hypotheses  # (T,)
    points_m: FloatArray  # (T, 2) centre of the bin, or the dead-reckoned place
    score_nats: FloatArray  # (T,) log likelihood up to each sample
    alternatives: Alternatives


class _Section(NamedTuple):
    """A part of the drive between two checkpoints; the last sample of a section is the first one of the next."""

    first: int  # sample of the checkpoint that it begins with
    last: int  # sample of the checkpoint that it ends with
    initial: InitialHypotheses  # the survivors at the first sample
    score_offset_nats: float  # to be added to all scores of the section


def forward_pass(
    drive: Drive, model: SearchModel, initial: InitialHypotheses, beam_nats: float, most: int, enough: int = 0,
    least_nats: FloatArray | None = None,
) -> Survivors:  # fmt: skip
    """Beam search over a drive, or over as much of it as fits into memory.

    The search ends early once at most ``enough`` hypotheses survive a step, or once ``_MAX_ROWS`` have survived all steps.

    Args:
        drive: the drive.
        model: lane graph, scales and costs.
        initial: hypotheses at the first sample.
        beam_nats: a hypothesis this far behind the best one of its step is dropped.
        most: about how many hypotheses may survive a step.
        enough: the search may end once no more than these survive a step; with 0 it goes on as long as any do.
        least_nats: (T,) a hypothesis with a lower score at its sample is dropped, however good the others are; None: none is.
    """
    least_nats = np.full(len(drive.heading_rad), NOWHERE) if least_nats is None else least_nats
    limits = BeamLimits(beam_nats, most, enough, max(_MAX_ROWS, 4 * len(initial.hypotheses)), least_nats)
    return forward(drive, model, limits, *initial)


def most_likely_route(
    problem: SearchProblem, initial: InitialHypotheses, config: RouteSearchConfig, place_prior: FloatArray | None = None
) -> TracedRoute | None:
    """The most likely route from the initial hypotheses over the whole drive; None if no route of the network is as long."""
    drive = compiled_drive(problem, problem.track.heading_rad, place_prior)
    model = compiled_model(problem)
    sections, survivors = _sections(drive, model, initial, config)
    if survivors is None:
        return None
    last = last_survivors(survivors).hypotheses
    end, onward = int(np.argmax(last["score_nats"])), np.zeros(len(last), np.float32)
    cell, parts = _cells(problem), list[TracedRoute]()
    for section in reversed(sections):
        own = _samples(drive, section.first, section.last + 1)
        if survivors is None:
            survivors = forward_pass(own, model, section.initial, config.beam_nats, config.most_survivors)
        through = backward(own, model, config.margin_nats, survivors, onward)
        row = _trace_back(survivors, end)
        thinned = alternatives(survivors, through, problem.graph.points_m, cell)
        parts.append(_traced(problem, survivors, row, section.score_offset_nats, thinned))
        end, onward = int(row[0]), _onward_nats(through, section.initial)
        survivors = None  # up to 200 MB, which the section before needs anew
    return _joined(parts[::-1])


def best_nats(
    problem: SearchProblem, initial: InitialHypotheses, config: RouteSearchConfig, floor: Floor, first: int = 0
) -> float:
    """Log likelihood of the most likely route from hypotheses at sample ``first`` to the end of the drive.

    It is ``NOWHERE`` if no route of the network is as long as the drive, or if it stays below the floor; the search ends as soon
    as that is so.
    """
    drive, model = compiled_drive(problem, problem.track.heading_rad[first:]), compiled_model(problem)
    sections, survivors = _sections(drive, model, initial, config, floor.from_sample(first))
    if survivors is None:
        return NOWHERE
    return float(last_survivors(survivors).hypotheses["score_nats"].max()) + sections[-1].score_offset_nats


def _sections(
    drive: Drive, model: SearchModel, initial: InitialHypotheses, config: RouteSearchConfig, least_nats: FloatArray | None = None
) -> tuple[list[_Section], Survivors | None]:
    """The sections of the forward pass in driving order, and the survivors of the last one; None if it does not reach the end
    of the drive.

    The survivors of a section are let go before the next one is searched: both together would be up to 400 MB.
    """
    first, score_offset, samples = 0, 0.0, len(drive.heading_rad)
    sections: list[_Section] = []
    while len(initial.hypotheses):
        survivors = forward_pass(
            _samples(drive, first, samples), model, initial, config.beam_nats, config.most_survivors,
            least_nats=None if least_nats is None else least_nats[first:] - score_offset,
        )  # fmt: skip
        last = first + len(survivors.row_start) - 2
        sections.append(_Section(first, last, initial, score_offset))
        if last == samples - 1:
            return sections, survivors
        if last == first:
            break
        initial = last_survivors(survivors)
        del survivors
        best = initial.hypotheses["score_nats"].max()
        best = best if best < -_EXACT_NATS else np.float32(0.0)
        initial.hypotheses["score_nats"] -= best
        first, score_offset = last, score_offset + float(best)
    return sections, None


def last_survivors(survivors: Survivors) -> InitialHypotheses:
    """The survivors of the last step, as the initial hypotheses of a further search.

    Only the places of these survivors are taken along, so that those off the network get new indices of their places.
    """
    last = survivors.hypotheses[survivors.row_start[-2] : survivors.row_start[-1]].copy()
    off = last["bin"] < 0
    places = survivors.places[-1 - last["bin"][off]]
    last["bin"][off] = -1 - np.arange(len(places))
    return InitialHypotheses(last, places)


def _samples(drive: Drive, first: int, end: int) -> Drive:
    """The samples ``first:end`` of a drive."""
    return drive._replace(heading_rad=drive.heading_rad[first:end], place_prior=drive.place_prior[first:end])


def _onward_nats(through: Float32Array, initial: InitialHypotheses) -> Float32Array:
    """Score of the best route onward from each initial hypothesis of a section: that of its best complete route, less its own."""
    onward: Float32Array = through[: len(initial.hypotheses)] - initial.hypotheses["score_nats"]
    return onward


def _trace_back(survivors: Survivors, end: int) -> IntArray:
    """Rows (t,) of the route that ends in the ``end``-th survivor of the last step, found through the parents."""
    row_start, parent = survivors.row_start, survivors.hypotheses["parent"]
    row = np.empty(len(row_start) - 1, np.int32)
    row[-1] = row_start[-2] + end
    for t in range(len(row) - 1, 0, -1):
        row[t - 1] = parent[row[t]]
    return row


def _traced(
    problem: SearchProblem, survivors: Survivors, row: IntArray, score_offset_nats: float, thinned: Alternatives
) -> TracedRoute:
    """Look up the points and scores of the part of the best route that consists of the survivors in rows ``row`` (t,).

    ``score_offset_nats`` makes the scores of the section continue those of the section before it. ``thinned`` holds the
    alternatives of the section, which are passed on.
    """
    best = survivors.hypotheses[row].copy()
    off = best["bin"] < 0
    points = problem.graph.points_m[np.maximum(best["bin"], 0)].astype(np.float64)
    places = survivors.places[-1 - best["bin"][off]]
    points[off] = np.column_stack([places["x_m"], places["y_m"]])
    return TracedRoute(best, points, best["score_nats"] + score_offset_nats, thinned)


def _joined(parts: list[TracedRoute]) -> TracedRoute:
    """Join the sections in driving order; the last sample of each is the first one of the next and counts once."""
    whole = parts[-1]
    for part in parts[-2::-1]:
        whole = TracedRoute(
            np.concatenate([part.hypotheses[:-1], whole.hypotheses]),
            np.concatenate([part.points_m[:-1], whole.points_m]),
            np.concatenate([part.score_nats[:-1], whole.score_nats]),
            _joined_alternatives(part.alternatives, whole.alternatives),
        )
    return whole


def _joined_alternatives(before: Alternatives, after: Alternatives) -> Alternatives:
    """Join the alternatives of two consecutive sections; those of the sample that both share are taken from ``after``."""
    kept = before.row_start[-2]
    return Alternatives(
        np.concatenate([before.row_start[:-2], after.row_start + kept]),
        np.concatenate([before.points_m[:kept], after.points_m]),
        np.concatenate([before.through_nats[:kept], after.through_nats]),
        np.concatenate([before.scale_bin[:kept], after.scale_bin]),
    )


def _cells(problem: SearchProblem) -> IntArray:
    """Number (N,) of the cell that each bin belongs to: every lane is cut into cells of about ``_CELL_M``."""
    graph = problem.graph
    start = graph.lane_start[graph.lane]
    cells: IntArray = start + (np.arange(graph.bin_count, dtype=np.int32) - start) // max(round(_CELL_M / problem.bin_m), 1)
    return cells
