"""One scenario from its two recordings to its rows, maps, trajectories and figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, HippodromeError, StartPose, Trajectory
from hippodrome.eval.figures.scenario import draw_scenario
from hippodrome.eval.files.scenarios import portable
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import (
    Materials,
    Scored,
    Topometric,
    file_stem,
    gather,
    refine_config,
    score_trajectory,
)
from hippodrome.eval.methods.stages import (
    dead_reckoning,
    localize_recording,
    map_recording,
    refine_map,
)
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.map_quality import (
    closures,
    matched_lane_accuracy,
    matched_lane_ids,
    score_closures,
)
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.report.evidence import write_map_evidence
from hippodrome.eval.results.model import (
    Network,
    Row,
    ScenarioResult,
    summarize,
    summarize_localization,
)
from hippodrome.eval.rivals.rows import NO_ATTRACTOR, Rival, rivals
from hippodrome.proto.codec import save_map
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario

DEAD_RECKONING, SEMI_METRIC = "dead reckoning", "semi-metric"
MAP_FILES = {"paper": "topometric-paper.pbstream", "route": "topometric-default.pbstream"}  # read by name since 0.1
MODES: tuple[tuple[str, Literal["paper", "route"]], ...] = (("topometric (paper)", "paper"), ("topometric", "route"))


@dataclass(frozen=True, slots=True)
class EvaluationTask:
    """A scenario whose recordings are finished, below ``out``."""

    scenario: Scenario
    out: Path
    figures: bool = True  # a sweep of thousands leaves them: they take most of a short scenario's time


def evaluate_scenario(task: EvaluationTask) -> ScenarioResult:
    """Map, refine in both modes, localize, score, draw; everything is written below ``out/<scenario name>``."""
    warm_up()
    materials = gather(task.scenario, task.out)
    truth, duration_s = materials.mapping.ground_truth(), materials.duration_s
    reckoned, reckoning_s = dead_reckoning(materials.mapping.self_motion())
    semi_metric, mapping_s = map_recording(materials.mapping.observations(), materials.scenario.mapper)
    map_bytes = save_map(materials.folder / "semi-metric.pbstream", semi_metric, _provenance(materials, SEMI_METRIC))
    at_vertices = Trajectory(semi_metric.t_s, interpolate(reckoned.t_s, reckoned.poses, semi_metric.t_s))
    scored = {
        DEAD_RECKONING: score_trajectory(at_vertices, truth, metric=False),
        SEMI_METRIC: score_trajectory(Trajectory(semi_metric.t_s, semi_metric.poses), truth, metric=False),
    }
    rows = [
        _own_frame_row(DEAD_RECKONING, scored, truth, cpu_percent=100 * reckoning_s / duration_s),
        _own_frame_row(
            SEMI_METRIC,
            scored,
            truth,
            cpu_percent=100 * mapping_s / duration_s,
            map_bytes=map_bytes,
            closures=_closure_figures(semi_metric, materials.mapping),
            **_counts(semi_metric),
        ),
    ]
    others = rivals(materials, semi_metric.t_s)
    rows += [_rival_row(rival, truth) for rival in others]
    scored |= {
        one.method: one.scored for one in others if one.scored is not None and one.method != NO_ATTRACTOR
    }  # the same poses
    found: dict[str, Topometric] = {}
    for method, mode in MODES:
        try:
            found[method] = _topometric(method, mode, semi_metric, materials)
        except HippodromeError as error:
            rows.append(Row(method=method, failure=str(error), **_counts(semi_metric)))
        else:
            cpu_percent = 100 * (mapping_s + found[method].cpu_s) / duration_s
            rows.append(_topometric_row(method, found[method], materials.mapping, cpu_percent))
    scored |= {method: topometric.scored for method, topometric in found.items()}
    _write_evidence(materials, scored, found)
    write_map_evidence(materials, scored, found)
    if task.figures:
        draw_scenario(materials, semi_metric, scored, found)
    return _result(materials, rows, mapping_s, found)


def _topometric(method: str, mode: Literal["paper", "route"], semi_metric: CognitiveMap, materials: Materials) -> Topometric:
    """One refinement mode, and localization in its map. Mode ``paper`` is told where the drive began, as the paper's was."""
    scenario, truth = materials.scenario, materials.mapping.ground_truth()
    start = StartPose(*(float(value) for value in truth.poses[0])) if mode == "paper" else None
    refinement, cpu_s = refine_map(semi_metric, materials.roads, refine_config(scenario, mode), start)
    refined = refinement.cognitive_map
    map_bytes = save_map(materials.folder / MAP_FILES[mode], refined, _provenance(materials, method))
    localization = localize_recording(materials.drive.observations(), refined, materials.roads, scenario.localizer)
    return Topometric(
        refinement=refinement,
        scored=score_trajectory(Trajectory(refined.t_s, refined.poses), truth, metric=True),
        map_bytes=map_bytes,
        cpu_s=cpu_s,
        localization=localization,
        localized=score_localization(localization.estimates, materials.drive.ground_truth(), localization.step_s),
    )


def _errors(scored: Scored) -> dict[str, Any]:
    return {"ape": summarize(scored.ape), "rpe": summarize(scored.rpe), "rpe_20m": summarize(scored.rpe_20m)}


def _own_frame_row(method: str, scored: Mapping[str, Scored], truth: Trajectory, **fields: Any) -> Row:
    """A row for an estimate in a frame and scale of its own: beside its errors, those after the best rigid and similarity fit."""
    trajectory = scored[method].trajectory
    fits = {f"ape_{fit}": summarize(ape(trajectory, truth, fit)) for fit in ("se2", "sim2")}
    return Row(method=method, **_errors(scored[method]), **fits, **fields)


def _rival_row(rival: Rival, truth: Trajectory) -> Row:
    if rival.scored is None:
        return Row(method=rival.method, **rival.fields)
    return _own_frame_row(rival.method, {rival.method: rival.scored}, truth, **rival.fields)


def _topometric_row(method: str, topometric: Topometric, recording: Recording, cpu_percent: float) -> Row:
    refined = topometric.refinement.cognitive_map
    return Row(
        method=method,
        **_errors(topometric.scored),
        cpu_percent=cpu_percent,
        map_bytes=topometric.map_bytes,
        localization=summarize_localization(topometric.localized),
        lanes=_lane_figures(refined, recording),
        estimates={name: value if np.isfinite(value) else None for name, value in topometric.refinement.estimates.items()},
        breaks=[{**asdict(stretch), "status": stretch.status.name} for stretch in topometric.refinement.breaks],
        **_counts(refined),
    )


def _counts(cognitive_map: CognitiveMap) -> dict[str, Any]:
    return {"vertices": len(cognitive_map.t_s), "edges": len(cognitive_map.edges.source)}


def _closure_figures(cognitive_map: CognitiveMap, recording: Recording) -> dict[str, Any]:
    """Closures against truth: a figure of the harness, the mapper never sees it."""
    truth = recording.ground_truth()
    true_poses = interpolate(truth.t_s, truth.poses, cognitive_map.t_s)
    found = score_closures(*closures(cognitive_map), true_poses, cognitive_map.t_s)
    return {**asdict(found), "precision": found.precision, "recall": found.recall}


def _lane_figures(cognitive_map: CognitiveMap, recording: Recording) -> dict[str, Any] | None:
    if cognitive_map.road_match is None:
        return None
    samples = recording.samples
    steps = np.clip(np.searchsorted(samples.t_s, cognitive_map.t_s), 0, len(samples.t_s) - 1)
    true = [samples.lane_ids[lane] for lane in samples.lane[steps]]
    accuracy = matched_lane_accuracy(matched_lane_ids(cognitive_map.road_match), true)
    return {**asdict(accuracy), "share_right": accuracy.share_right, "precision": accuracy.precision}


def _result(materials: Materials, rows: list[Row], mapping_s: float, found: Mapping[str, Topometric]) -> ScenarioResult:
    scenario = materials.scenario
    tours = {
        role: recording.manifest["tour"]
        for role, recording in (("mapping", materials.mapping), ("localization", materials.drive))
    }
    return ScenarioResult(
        name=scenario.name,
        seed=scenario.seed,
        network=_network(materials),
        noise=scenario.noise_name,
        frames=materials.mapping.frame_count,
        duration_s=materials.duration_s,
        rows=tuple(rows),
        tours=tours,
        town_notes=list(materials.town.notes),
        configuration=_configuration(scenario),
        timings={
            "mapping_cpu_s": mapping_s,
            **{f"{method}: refinement_cpu_s": one.cpu_s for method, one in found.items()},
            **{f"{method}: localization_step_ms": 1e3 * float(one.localization.step_s.mean()) for method, one in found.items()},
        },
    )


def _network(materials: Materials) -> Network:
    """Size of the road network: directed edges, and their length along the rightmost lane."""
    roads, spec = materials.town.network, materials.scenario.town
    is_road = ~roads.is_internal
    first_lane = np.unique(roads.lane_edge[is_road], return_index=True)[1]
    km = float(roads.lane_lengths_m()[is_road][first_lane].sum()) / 1e3
    return Network(
        path=portable(spec.network) if spec.network else None,
        generator=None if spec.network else spec.kind,
        edges=len(first_lane),
        km=km,
    )


def _configuration(scenario: Scenario) -> dict[str, Any]:
    """The effective configuration; a network file is named so that results do not depend on where it lies."""
    values: dict[str, Any] = json.loads(scenario.model_dump_json())  # JSON has no infinity: such a limit becomes null
    if scenario.town.network is not None:
        values["town"]["network"] = portable(scenario.town.network)
    return values


def _provenance(materials: Materials, method: str) -> dict[str, str]:
    configuration = json.dumps(_configuration(materials.scenario), sort_keys=True)
    return {"method": method, "scenario": configuration, "recording": materials.mapping.folder.name}


def _write_evidence(materials: Materials, scored: Mapping[str, Scored], found: Mapping[str, Topometric]) -> None:
    """Every figure in the tables can be computed again from these files, with evo for one."""
    folder = materials.folder
    write_tum(folder / "ground-truth.tum", materials.mapping.ground_truth())
    write_tum(folder / "localization-ground-truth.tum", materials.drive.ground_truth())
    for method, one in scored.items():
        write_tum(folder / f"{file_stem(method)}.tum", one.trajectory)
    for method, topometric in found.items():
        known = [estimate for estimate in topometric.localization.estimates if estimate.localized]
        if known:
            poses = np.stack([estimate.pose for estimate in known])
            write_tum(folder / f"{file_stem(method)}-localization.tum", Trajectory(np.array([e.t_s for e in known]), poses))
    text = json.dumps(_configuration(materials.scenario), indent=1, sort_keys=True) + "\n"
    write_atomically(folder / "scenario.json", text.encode())
