"""One scenario from its two recordings to its rows, maps, trajectories and figures: the story of an evaluation.

The first drive is mapped. The map is refined with the road network, once in each mode of the refinement. The second drive is
localized in each refined map. Everything is scored against ground truth, which the algorithms never see, and stands beside dead
reckoning and the rivals that are given the same frames. ``Mapper``, ``refine`` and ``Localizer`` of ``core`` are called here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, HippodromeError, Trajectory
from hippodrome.eval.figures.scenario import draw_scenario
from hippodrome.eval.methods.materials import (
    Materials,
    ScoredTrajectory,
    TopometricResult,
    gather,
    refine_config,
    score_trajectory,
    true_start,
)
from hippodrome.eval.methods.method import DEAD_RECKONING, NO_ATTRACTOR, REFINED, SEMI_METRIC, Method
from hippodrome.eval.methods.stages import dead_reckoning, localize_recording, map_recording, timed
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.report.evidence import write_map_evidence
from hippodrome.eval.results.evidence import write_trajectories
from hippodrome.eval.results.model import Row, ScenarioResult
from hippodrome.eval.results.rows import map_size, own_frame_row, semi_metric_figures, topometric_row
from hippodrome.eval.results.scenario import scenario_result
from hippodrome.eval.rivals.rows import run_rivals
from hippodrome.proto.codec import save_map
from hippodrome.sim.scenario import Scenario


@dataclass(frozen=True, slots=True)
class EvaluationTask:
    """A scenario whose recordings are finished, below ``out``."""

    scenario: Scenario
    out: Path
    figures: bool = True  # drawing takes most of a short scenario's time, so sweeps of many do without


def evaluate_scenario(task: EvaluationTask) -> ScenarioResult:
    """Map, refine in both modes, localize, score, write and draw. All files go to ``out/<scenario name>``.

    A method that fails has a row that says why; the other methods go on.

    Raises:
        HippodromeError: No semi-metric map can be made of the mapping drive, or it cannot be scored.
    """
    warm_up()
    materials = gather(task.scenario, task.out)
    semi_metric, mapping_s = map_recording(materials.mapping.observations(), Mapper(task.scenario.mapper))
    rows, scored = _own_frame_methods(materials, semi_metric, mapping_s)
    topometric: dict[Method, TopometricResult] = {}
    for method in REFINED:
        try:
            result = _refine_and_localize(method, semi_metric, materials)
        except HippodromeError as error:
            rows.append(Row(method=method.label, failure=str(error), **map_size(semi_metric)))
        else:
            cpu_percent = 100 * (mapping_s + result.cpu_s) / materials.duration_s
            rows.append(topometric_row(method, result, materials.mapping, cpu_percent))
            topometric[method], scored[method] = result, result.scored
    write_trajectories(materials, scored, topometric)
    write_map_evidence(materials, scored, topometric)
    if task.figures:
        draw_scenario(materials, semi_metric, scored, topometric)
    return scenario_result(materials, rows, mapping_s, topometric)


def _own_frame_methods(
    materials: Materials, semi_metric: CognitiveMap, mapping_s: float
) -> tuple[list[Row], dict[Method, ScoredTrajectory]]:
    """Dead reckoning, the semi-metric map, and the rivals: their rows, and the trajectories that figures show.

    All of them have a frame and a scale of their own, and are sampled at the times of the map's vertices.
    """
    truth, duration_s = materials.mapping.ground_truth(), materials.duration_s
    reckoned, reckoning_s = dead_reckoning(materials.mapping.self_motion())
    at_vertices = Trajectory(semi_metric.t_s, interpolate(reckoned.t_s, reckoned.poses, semi_metric.t_s))
    map_path = SEMI_METRIC.map_path(materials.folder)
    map_bytes = save_map(map_path, semi_metric, materials.provenance(SEMI_METRIC))
    figures = {"map_bytes": map_bytes, **semi_metric_figures(semi_metric, materials.mapping)}
    scored = {
        DEAD_RECKONING: score_trajectory(at_vertices, truth, DEAD_RECKONING.alignment),
        SEMI_METRIC: score_trajectory(Trajectory(semi_metric.t_s, semi_metric.poses), truth, SEMI_METRIC.alignment),
    }
    rows = [
        own_frame_row(DEAD_RECKONING, scored[DEAD_RECKONING], truth, cpu_percent=100 * reckoning_s / duration_s),
        own_frame_row(SEMI_METRIC, scored[SEMI_METRIC], truth, cpu_percent=100 * mapping_s / duration_s, **figures),
    ]
    for rival in run_rivals(materials, semi_metric.t_s):
        rows.append(rival.row)
        if rival.scored is not None and rival.method != NO_ATTRACTOR:  # its poses would cover the map's, which are the same
            scored[rival.method] = rival.scored
    return rows, scored


def _refine_and_localize(method: Method, semi_metric: CognitiveMap, materials: Materials) -> TopometricResult:
    """Refine the map in the method's mode, and localize the second drive in it. Raises HippodromeError if either refuses.

    Mode ``paper`` is told where the mapping drive began, as the paper's own method was.
    """
    assert method.mode is not None
    scenario, roads = materials.scenario, materials.roads
    start = true_start(materials.mapping) if method.mode == "paper" else None
    refinement, cpu_s = timed(refine, semi_metric, roads, refine_config(scenario, method.mode), start)
    refined = refinement.cognitive_map
    map_bytes = save_map(method.map_path(materials.folder), refined, materials.provenance(method))
    localization = localize_recording(materials.drive.observations(), Localizer(refined, roads, scenario.localizer))
    return TopometricResult(
        refinement=refinement,
        scored=score_trajectory(Trajectory(refined.t_s, refined.poses), materials.mapping.ground_truth(), method.alignment),
        map_bytes=map_bytes,
        cpu_s=cpu_s,
        localization=localization,
        localized=score_localization(localization.estimates, materials.drive.ground_truth(), localization.step_s),
    )
