"""Peak memory of each of our methods, measured as ORB-SLAM3's is: of a process that does nothing else, fed through a pipe."""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from hippodrome.core.types import StartPose
from hippodrome.eval.evaluate import MODES, SEMI_METRIC
from hippodrome.eval.methods.materials import Materials, gather, refine_config
from hippodrome.eval.pool import Workers
from hippodrome.eval.results.model import Results, Row, ScenarioResult
from hippodrome.eval.rivals.lean import Job
from hippodrome.eval.rivals.rows import NO_ATTRACTOR, RATSLAM
from hippodrome.sim.scenario import Scenario

COMMAND = (sys.executable, "-m", "hippodrome.eval.rivals.lean")


@dataclass(frozen=True, slots=True)
class MemoryTask:
    """A method on the mapping drive of a scenario below ``out``."""

    method: str
    scenario: Scenario
    out: Path


def with_peak_rss(results: Results, scenario: Scenario, out: Path, pool: Workers) -> Results:
    """The results with the peak memory in the rows of our methods. Dead reckoning keeps a pose, and has none."""
    tasks = [MemoryTask(method, scenario, out) for method in (SEMI_METRIC, RATSLAM, NO_ATTRACTOR, *dict(MODES))]
    found = dict(zip((task.method for task in tasks), pool.run("memory", peak_rss_bytes, tasks), strict=True))
    scenarios = (ScenarioResult(**{**dict(one), "rows": [_with(row, found) for row in one.rows]}) for one in results.scenarios)
    return Results(scenarios=tuple(scenarios))


def peak_rss_bytes(task: MemoryTask) -> int | None:
    """Of a fresh process that runs the method; None if it failed, as its row says already."""
    materials = gather(task.scenario, task.out)
    with subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(BrokenPipeError), process.stdin as pipe:
            pickle.dump(_job(task.method, materials), pipe)
            for observation in materials.mapping.observations():
                pickle.dump(observation, pipe)
        answer = process.stdout.read()
    return int(answer) if process.returncode == 0 else None


def _job(method: str, materials: Materials) -> Job:
    config = materials.scenario.mapper
    if method == RATSLAM:
        return Job("RatSLAM", config)
    if method == NO_ATTRACTOR:
        return Job("no attractor", config)
    mode = dict(MODES).get(method)
    if mode is None:
        return Job("mapper", config)
    pose = materials.mapping.ground_truth().poses[0]
    start = StartPose(*(float(value) for value in pose)) if mode == "paper" else None
    return Job("mapper", config, (materials.roads, refine_config(materials.scenario, mode), start))


def _with(row: Row, found: dict[str, int | None]) -> Row:
    return row.model_copy(update={"peak_rss_bytes": found[row.method]}) if row.method in found else row
