"""Rows of the results: a method's trajectory, map and localization in figures."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, Trajectory
from hippodrome.eval.methods.materials import ScoredTrajectory, TopometricResult
from hippodrome.eval.methods.method import Method
from hippodrome.eval.metrics.map_quality import closures, matched_lane_accuracy, matched_lane_ids, score_closures
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.results.model import Row, summarize, summarize_localization
from hippodrome.sim.recording import Recording


def own_frame_row(method: Method, scored: ScoredTrajectory, truth: Trajectory, **fields: Any) -> Row:
    """The row of a method whose trajectory has a frame and a scale of its own.

    Beside its errors it has those after the best rigid fit (``ape_se2``) and the best similarity fit (``ape_sim2``), which tell
    a wrong shape from a wrong place and scale.

    Args:
        method: The method.
        scored: Its trajectory and errors.
        truth: The mapping drive's true trajectory.
        **fields: Further fields of the row.
    """
    fits = {f"ape_{fit}": summarize(ape(scored.trajectory, truth, fit)) for fit in ("se2", "sim2")}
    return Row(method=method.label, **_errors(scored), **fits, **fields)


def semi_metric_figures(semi_metric: CognitiveMap, recording: Recording) -> dict[str, Any]:
    """Fields of the semi-metric map's row: its size, and its loop closures judged by where the vehicle truly was."""
    truth = recording.ground_truth()
    true_poses = interpolate(truth.t_s, truth.poses, semi_metric.t_s)
    judged = score_closures(*closures(semi_metric), true_poses, semi_metric.t_s)
    figures = {**asdict(judged), "precision": judged.precision, "recall": judged.recall}
    return {"closures": figures, **map_size(semi_metric)}


def topometric_row(method: Method, result: TopometricResult, recording: Recording, cpu_percent: float) -> Row:
    """The row of a refined map, and of the second drive's localization in it.

    Args:
        method: The method.
        result: What the refinement and the localizer gave.
        recording: The mapping drive.
        cpu_percent: CPU time of mapping and refinement, in per cent of the mapping drive's duration.
    """
    refinement = result.refinement
    return Row(
        method=method.label,
        **_errors(result.scored),
        cpu_percent=cpu_percent,
        map_bytes=result.map_bytes,
        localization=summarize_localization(result.localized),
        lanes=_lane_figures(refinement.cognitive_map, recording),
        estimates={name: value if np.isfinite(value) else None for name, value in refinement.estimates.items()},
        breaks=[{**asdict(stretch), "status": stretch.status.name} for stretch in refinement.breaks],
        **map_size(refinement.cognitive_map),
    )


def map_size(cognitive_map: CognitiveMap) -> dict[str, int]:
    """Fields of a row: the numbers of vertices and edges."""
    return {"vertices": len(cognitive_map.t_s), "edges": len(cognitive_map.edges.source)}


def _errors(scored: ScoredTrajectory) -> dict[str, Any]:
    return {"ape": summarize(scored.ape), "rpe": summarize(scored.rpe), "rpe_20m": summarize(scored.rpe_20m)}


def _lane_figures(cognitive_map: CognitiveMap, recording: Recording) -> dict[str, Any] | None:
    """How many vertices are on the lane that was driven at their time; None if the map was not matched to lanes."""
    if cognitive_map.road_match is None:
        return None
    samples = recording.samples
    steps = np.clip(np.searchsorted(samples.t_s, cognitive_map.t_s), 0, len(samples.t_s) - 1)
    true_lanes = [samples.lane_ids[lane] for lane in samples.lane[steps]]
    accuracy = matched_lane_accuracy(matched_lane_ids(cognitive_map.road_match), true_lanes)
    return {**asdict(accuracy), "share_right": accuracy.share_right, "precision": accuracy.precision}
