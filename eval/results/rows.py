"""Rows of the results: a method's trajectory, map and localization in figures."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final, Literal

import numpy as np

from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, FloatArray, Refinement, Trajectory
from hippodrome.eval.methods.materials import Materials, Outcome, ScoredTrajectory
from hippodrome.eval.methods.refusal import refusal_in_a_row
from hippodrome.eval.metrics.alignment import DegenerateAlignment
from hippodrome.eval.metrics.map_quality import closures, matched_lane_accuracy, matched_lane_ids, score_closures
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.results.model import ErrorSummary, Latency, Row, summarize, summarize_localization
from hippodrome.sim.recording import Recording

FITS: Final[tuple[Literal["se2", "sim2"], ...]] = ("se2", "sim2")


def row_of(outcome: Outcome, materials: Materials) -> Row:
    """The row of a method that made a trajectory, whatever else it made or failed in.

    Beside its errors it has those after the best rigid fit (``ape_se2``) and the best similarity fit (``ape_sim2``), which tell
    a wrong shape from a wrong place and scale.
    """
    truth = materials.mapping.ground_truth()
    fields: dict[str, Any] = {f"ape_{fit}": _fitted(outcome.scored.trajectory, truth, fit) for fit in FITS}
    return Row(
        method=outcome.method.label,
        failure=outcome.failure,
        refused=refusal_in_a_row(outcome.refined) if outcome.refined is not None else None,
        **_errors(outcome.scored),
        **fields,
        cpu_percent=100 * outcome.cpu_s / materials.duration_s,
        latency_ms=latency(outcome.step_s),
        peak_rss_bytes=outcome.peak_rss_bytes,
        map_bytes=outcome.map_bytes,
        covered=outcome.covered,
        localization=None if outcome.localized is None else summarize_localization(outcome.localized),
        **_map_figures(outcome, materials.mapping),
        **outcome.mapped.figures,
    )


def _fitted(trajectory: Trajectory, truth: Trajectory, fit: Literal["se2", "sim2"]) -> ErrorSummary | None:
    """The APE after a fit; None where the poses do not determine it, as on a straight road."""
    try:
        return summarize(ape(trajectory, truth, fit))
    except DegenerateAlignment:
        return None


def latency(step_s: FloatArray) -> Latency | None:
    """Median and 99th percentile of times (N,) in s; None if there are none."""
    if len(step_s) == 0:
        return None
    return Latency(median=1e3 * float(np.median(step_s)), p99=1e3 * float(np.percentile(step_s, 99.0)))


def _map_figures(outcome: Outcome, recording: Recording) -> dict[str, Any]:
    """What the truth says of a map of our kind: loop closures of a semi-metric one, lanes and breaks of a refined one."""
    found = outcome.mapped.cognitive_map
    if found is None:
        return {}
    if found.frame == "semi-metric":
        return {"closures": _closure_figures(found, recording)}
    breaks = outcome.mapped.state.breaks if isinstance(outcome.mapped.state, Refinement) else ()
    return {
        "lanes": _lane_figures(found, recording),
        "breaks": [{**asdict(stretch), "status": stretch.status.name} for stretch in breaks],
    }


def _closure_figures(semi_metric: CognitiveMap, recording: Recording) -> dict[str, Any]:
    """Loop closures judged by where the vehicle truly was."""
    truth = recording.ground_truth()
    true_poses = interpolate(truth.t_s, truth.poses, semi_metric.t_s)
    judged = score_closures(*closures(semi_metric), true_poses, semi_metric.t_s)
    return {**asdict(judged), "precision": judged.precision, "recall": judged.recall}


def _errors(scored: ScoredTrajectory) -> dict[str, Any]:
    return {"ape": summarize(scored.ape), "rpe": summarize(scored.rpe), "rpe_20m": summarize(scored.rpe_20m)}


def _lane_figures(cognitive_map: CognitiveMap, recording: Recording) -> dict[str, Any] | None:
    """How many vertices are on the lane that was driven at their time; None if the map was not matched to lanes."""
    if cognitive_map.road_match is None or not any(recording.samples.lane_ids):  # only the simulator knows the lane
        return None
    samples = recording.samples
    steps = np.clip(np.searchsorted(samples.t_s, cognitive_map.t_s), 0, len(samples.t_s) - 1)
    true_lanes = [samples.lane_ids[lane] for lane in samples.lane[steps]]
    accuracy = matched_lane_accuracy(matched_lane_ids(cognitive_map.road_match), true_lanes)
    return {**asdict(accuracy), "share_right": accuracy.share_right, "precision": accuracy.precision}
