"""``hippodrome stress``: the default refinement from real frames, under errors it may meet, over towns and seeds.

Every case starts from the same recorded frames of a town and seed and changes one thing: the self-motion (sensed anew), the loop
closures (false ones added), or the road network (displaced, or with driven roads missing). Each row can be rerun alone by its
scenario, seed and case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

from hippodrome.core.refine import refine
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, HippodromeError, MatchStatus, Trajectory
from hippodrome.eval.calibration import nees, pose_errors
from hippodrome.eval.figures.stress import draw_stress
from hippodrome.eval.materials import RPE_DELTA_M
from hippodrome.eval.metrics import ape, rpe
from hippodrome.eval.perturbations import driven_streets, with_false_closures, without_roads
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.results import to_json
from hippodrome.eval.run import make_recordings
from hippodrome.eval.scenario_files import read_scenario
from hippodrome.eval.stages import map_recording
from hippodrome.eval.stress_table import WRONG_M, StressRow, stress_markdown
from hippodrome.eval.warm_up import warm_up
from hippodrome.proto.atomic import write_atomically
from hippodrome.sim.record import RecordingPlan, finish, sensed_anew
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NOISE_LEVELS, NoiseLevel
from hippodrome.sim.survey import with_survey_error

MISSING_ROADS = 2  # driven streets taken out of the network, both directions each


@dataclass(frozen=True, slots=True)
class StressCase:
    """One thing that goes wrong."""

    name: str
    noise: NoiseLevel = "paper"
    false_closures: float = 0.0  # share of the map's closures, added between random vertices
    survey_error_m: float = 0.0
    scale_jump: float = 0.0  # standard deviation of ln(scale) at each jump
    gyro_bias_degps: float | None = None
    missing_roads: int = 0


CASES = (
    StressCase("paper", false_closures=0.01),
    StressCase("no false closures"),
    StressCase("false closures 20 %", false_closures=0.20),
    StressCase("survey error 0.5 m", survey_error_m=0.5),
    StressCase("scale jumps 10 %", scale_jump=0.10),
    StressCase("drift x 3", gyro_bias_degps=0.15),
    StressCase("missing roads", missing_roads=MISSING_ROADS),
    StressCase("realistic", noise="realistic"),
    StressCase("harsh", noise="harsh"),
)


@dataclass(frozen=True, slots=True)
class StressTask:
    """All cases that share the recording of one scenario."""

    scenario: Scenario
    cases: tuple[StressCase, ...]
    out: Path


def stress(paths: Sequence[Path], seeds: Sequence[int], names: Sequence[str], workers: int, out: Path) -> None:
    """Run cases over scenarios x seeds; writes ``stress.json``, ``stress.md`` and ``stress.png``."""
    cases = tuple(case for case in CASES if not names or case.name in names)
    if unknown := set(names) - {case.name for case in CASES}:
        raise HippodromeError(f"no stress case '{sorted(unknown)[0]}'; there are: {', '.join(case.name for case in CASES)}")
    tasks = [task for path in paths for seed in seeds for task in _tasks(read_scenario(path, seed=seed), cases, out)]
    with worker_pool(workers) as pool:
        make_recordings([RecordingPlan(task.scenario, "mapping", out) for task in tasks], pool)
        rows = [row for part in pool.run("refine", run_cases, tasks, weight=lambda task: len(task.cases)) for row in part]
    write_atomically(
        out / "stress.json", to_json({"cases": [asdict(case) for case in cases], "rows": [asdict(row) for row in rows]}).encode()
    )
    text = stress_markdown(rows)
    write_atomically(out / "stress.md", text.encode())
    draw_stress(out / "stress.png", {case.name: [row.ape_mean_m for row in rows if row.case == case.name] for case in cases})
    print(f"{text}\n{out / 'stress.json'}, {out / 'stress.md'}, {out / 'stress.png'}")


def _tasks(scenario: Scenario, cases: Sequence[StressCase], out: Path) -> list[StressTask]:
    """Cases grouped by the lateral wander of their noise level: that alone makes another drive, and other frames."""
    groups: dict[NoiseLevel, list[StressCase]] = {}
    for case in cases:
        groups.setdefault(case.noise, []).append(case)
    return [StressTask(scenario.model_copy(update={"noise": level}), tuple(group), out) for level, group in groups.items()]


def run_cases(task: StressTask) -> list[StressRow]:
    """Every case of one recording."""
    warm_up()
    plan = RecordingPlan(task.scenario, "mapping", task.out)
    recording, town = finish(plan), plan.town()
    return [_run_case(case, task.scenario, recording, town.network) for case in task.cases]


def _run_case(case: StressCase, scenario: Scenario, recording: Recording, network: RoadNetwork) -> StressRow:
    level = NOISE_LEVELS[case.noise]
    motion = {"scale_jump": max(case.scale_jump, level.scale_jump)}
    if case.gyro_bias_degps is not None:
        motion["gyro_bias_degps"] = case.gyro_bias_degps
    sensed = sensed_anew(recording, level.model_copy(update=motion), np.random.default_rng([scenario.seed, 3]))
    rng = np.random.default_rng([scenario.seed, 4])
    semi_metric, _ = map_recording(sensed.observations(), scenario.mapper)
    semi_metric = with_false_closures(semi_metric, case.false_closures, rng)
    roads = with_survey_error(network, max(case.survey_error_m, level.survey_error_m), rng)
    roads = without_roads(roads, driven_streets(recording, network, case.missing_roads, rng))
    row = StressRow(scenario.name, scenario.seed, case.name, len(semi_metric.t_s))
    began = process_time()
    try:
        refined = refine(semi_metric, roads, replace(scenario.refine, mode="default")).cognitive_map
    except HippodromeError as error:
        return replace(row, failure=str(error), cpu_s=process_time() - began)
    return _scored(row, refined, recording, process_time() - began)


def _scored(row: StressRow, refined: CognitiveMap, recording: Recording, cpu_s: float) -> StressRow:
    truth = recording.ground_truth()
    estimate = Trajectory(refined.t_s, refined.poses)
    absolute, relative = ape(estimate, truth), rpe(estimate, truth, RPE_DELTA_M)
    assert refined.road_match is not None
    vouched = refined.road_match.status == MatchStatus.MATCHED
    row = replace(row, matched_share=float(vouched.mean()), ape_all_mean_m=absolute.mean_m, cpu_s=cpu_s)
    if not vouched.any():
        return replace(row, failure="no vertex is vouched for")
    errors_m = absolute.errors_m[vouched]
    offsets = pose_errors(refined.poses, interpolate(truth.t_s, truth.poses, refined.t_s))
    spread = None if refined.covariance is None else float(nees(offsets[vouched], refined.covariance[vouched]).mean() / 3.0)
    return replace(
        row,
        wrong=int(np.count_nonzero(errors_m > WRONG_M)),
        ape_mean_m=float(errors_m.mean()),
        ape_max_m=float(errors_m.max()),
        rpe_20m_mean_m=relative.mean_m,
        nees=spread,
    )
