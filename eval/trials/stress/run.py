"""``hippodrome stress``: the default refinement from real frames, under errors it may meet, over towns and seeds.

Every case starts from the same recorded frames of a town and seed and changes one thing: the self-motion (sensed anew), the loop
closures (false ones added), or the road network (displaced, with driven roads missing, or another town's). Cases of the same
self-motion share one map. Each row is kept as soon as it is known, and can be rerun alone by its scenario, seed and case.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import process_time

import numpy as np

import hippodrome.core.types
from hippodrome._files import write_atomically
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, MatchStatus, StartPose, Trajectory
from hippodrome.eval.figures.stress import draw_stress
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.methods.materials import RPE_DELTA_M, refine_config
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.calibration import nees, pose_errors
from hippodrome.eval.metrics.trajectory import ape, rpe
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.results.model import to_json
from hippodrome.eval.run import make_recordings
from hippodrome.eval.trials.stress.cases import (
    FOREIGN_SEED,
    StressCase,
    chosen_cases,
    in_self_similar_grid,
)
from hippodrome.eval.trials.stress.perturbations import driven_streets, with_false_closures, without_roads
from hippodrome.eval.trials.stress.table import (
    FAR_M,
    WRONG_M,
    StressRow,
    stress_markdown,
)
from hippodrome.sim.record import RecordingPlan, finish, sensed_anew
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NOISE_LEVELS, NoiseLevel
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.town import build_town


@dataclass(frozen=True, slots=True)
class StressTask:
    """All cases that share the recording of one scenario."""

    scenario: Scenario
    cases: tuple[StressCase, ...]
    out: Path
    path: Path  # of the scenario, for the command that reruns a row

    def plan(self) -> RecordingPlan:
        return RecordingPlan(self.scenario, "mapping", self.out)

    def rerun(self, case: StressCase) -> str:
        return f"hippodrome stress {self.path} --seeds {self.scenario.seed} --case '{case.name}'"

    def row_file(self, case: StressCase) -> Path:
        """Where the case's row is kept: named by all that it depends on."""
        text = json.dumps(
            [self.plan().folder().name, self.scenario.model_dump_json(exclude={"town"}), asdict(case), _code_sha256()]
        )
        return self.out / "rows" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"


def stress(paths: Sequence[Path], seeds: Sequence[int], names: Sequence[str], workers: int, out: Path) -> None:
    """Run cases over scenarios x seeds; writes ``stress.json``, ``stress.md`` and ``stress.png``."""
    cases = chosen_cases(names)
    tasks = [task for path in paths for seed in seeds for task in _tasks(path, seed, cases, out, path == paths[0])]
    with worker_pool(workers) as pool:
        make_recordings([task.plan() for task in tasks], pool)
        rows = [row for part in pool.run("refine", run_cases, tasks, weight=lambda task: len(task.cases)) for row in part]
    rows.sort(key=lambda row: [case.name for case in cases].index(row.case))
    write_atomically(
        out / "stress.json", to_json({"cases": [asdict(case) for case in cases], "rows": [asdict(row) for row in rows]}).encode()
    )
    text = stress_markdown(rows)
    write_atomically(out / "stress.md", text.encode())
    draw_stress(out / "stress.png", {case.name: [row.ape_mean_m for row in rows if row.case == case.name] for case in cases})
    print(f"{text}\n{out / 'stress.json'}, {out / 'stress.md'}, {out / 'stress.png'}")


def _tasks(path: Path, seed: int, cases: Sequence[StressCase], out: Path, with_grid: bool) -> list[StressTask]:
    """Cases grouped by drive: the lateral wander of their noise level makes another one, and so does the self-similar grid."""
    scenario = read_scenario(path, seed=seed)
    groups: dict[tuple[NoiseLevel, bool], list[StressCase]] = {}
    for case in cases:
        if with_grid or not case.self_similar:
            groups.setdefault((case.noise, case.self_similar), []).append(case)
    return [
        StressTask(
            (in_self_similar_grid(scenario, out) if grid else scenario).model_copy(update={"noise": level}),
            tuple(group),
            out,
            path,
        )
        for (level, grid), group in groups.items()
    ]


def run_cases(task: StressTask) -> list[StressRow]:
    """Every case of one recording; those of an earlier run of the same code are read back."""
    rows, maps = {}, dict[str, CognitiveMap]()
    for case in task.cases:
        file = task.row_file(case)
        if not file.exists():
            row = _run_case(case, task, maps)
            write_atomically(file, to_json(asdict(row)).encode())
        rows[case.name] = StressRow(**json.loads(file.read_text()))
    return list(rows.values())


def _run_case(case: StressCase, task: StressTask, maps: dict[str, CognitiveMap]) -> StressRow:
    """``maps``: those made already, by their self-motion."""
    warm_up()
    scenario, recording, town = task.scenario, finish(task.plan()), task.plan().town()
    noise = case.self_motion()
    if noise.model_dump_json() not in maps:
        sensed = sensed_anew(recording, noise, np.random.default_rng([scenario.seed, 3]))
        maps[noise.model_dump_json()], _ = map_recording(sensed.observations(), scenario.mapper)
    rng = np.random.default_rng([scenario.seed, 4])
    semi_metric = with_false_closures(maps[noise.model_dump_json()], case.false_closures, rng)
    roads = town.network
    if case.foreign:  # an imported town, too, is answered with a generated one
        elsewhere = scenario.town.model_copy(update={"network": None})
        roads = build_town(elsewhere, scenario.seed + FOREIGN_SEED, task.out / "towns").network
    survey_error_m = max(case.survey_error_m, NOISE_LEVELS[case.noise].survey_error_m)
    roads = with_survey_error(roads, survey_error_m, rng)
    roads = without_roads(roads, driven_streets(recording, town.network, case.missing_roads, rng))
    start = StartPose(*(float(value) for value in recording.ground_truth().poses[0])) if case.start_known else None
    row = StressRow(scenario.name, scenario.seed, case.name, len(semi_metric.t_s), rerun=task.rerun(case))
    began = process_time()
    try:
        refined = refine(semi_metric, roads, refine_config(scenario, "route", survey_error_m), start).cognitive_map
    except HippodromeError as error:
        return replace(row, failure=str(error), cpu_s=process_time() - began)
    row = _scored(row, refined, recording, process_time() - began)
    if case.foreign:
        return row
    return replace(row, right_share=_right_share(refined, recording, town.network, roads))


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
        far=int(np.count_nonzero(errors_m > FAR_M)),
        ape_mean_m=float(errors_m.mean()),
        ape_max_m=float(errors_m.max()),
        rpe_20m_mean_m=relative.mean_m,
        nees=spread,
    )


def _right_share(refined: CognitiveMap, recording: Recording, driven: RoadNetwork, roads: RoadNetwork) -> float:
    """Of the vertices on lanes that ``roads`` has, the share that is vouched for and less than ``FAR_M`` off."""
    samples = recording.samples
    nearest = np.clip(np.searchsorted(samples.t_s, refined.t_s - 1e-9), 0, len(samples.t_s) - 1)
    there = np.isin(np.array(driven.lane_ids)[samples.lane[nearest]], roads.lane_ids)
    errors: FloatArray = ape(Trajectory(refined.t_s, refined.poses), recording.ground_truth()).errors_m
    assert refined.road_match is not None
    right = (refined.road_match.status == MatchStatus.MATCHED) & (errors < FAR_M)
    return float(np.mean(right[there]))


@lru_cache(maxsize=1)
def _code_sha256() -> str:
    """Of the code that rows come from."""
    root, digest = Path(hippodrome.core.types.__file__).parent.parent, hashlib.sha256()
    for part in ("core", "eval"):
        for path in sorted((root / part).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
