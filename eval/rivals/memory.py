"""Peak memory of each of our methods, measured as ORB-SLAM3's is: in a process that does nothing else, fed through a pipe."""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hippodrome._processes import dying_with_me
from hippodrome.eval.methods.materials import Materials, gather, refine_config, true_start
from hippodrome.eval.methods.method import NO_ATTRACTOR, RATSLAM, REFINED, SEMI_METRIC, Method
from hippodrome.eval.pool import Workers
from hippodrome.eval.results.model import Results, Row, ScenarioResult
from hippodrome.eval.rivals.lean import Job
from hippodrome.sim.scenario import Scenario

MEASURED: Final = (SEMI_METRIC, RATSLAM, NO_ATTRACTOR, *REFINED)  # not dead reckoning: it keeps one pose, and has no peak
COMMAND: Final = (sys.executable, "-m", "hippodrome.eval.rivals.lean")


@dataclass(frozen=True, slots=True)
class MemoryTask:
    """A method to measure on the mapping drive of a scenario, whose recordings are below ``out``."""

    method: Method
    scenario: Scenario
    out: Path


def with_peak_rss(results: Results, scenario: Scenario, out: Path, pool: Workers) -> Results:
    """The results with the peak memory in the rows of ``MEASURED``."""
    peaks = pool.run("memory", peak_rss_bytes, [MemoryTask(method, scenario, out) for method in MEASURED])
    by_label = {method.label: peak for method, peak in zip(MEASURED, peaks, strict=True)}
    scenarios = (ScenarioResult(**{**dict(one), "rows": [_with(row, by_label) for row in one.rows]}) for one in results.scenarios)
    return Results(scenarios=tuple(scenarios))


def peak_rss_bytes(task: MemoryTask) -> int | None:
    """The most memory that a fresh process holds while it runs the method; None if it failed, as its row says already."""
    materials = gather(task.scenario, task.out)
    with subprocess.Popen(
        COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, preexec_fn=dying_with_me()
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(BrokenPipeError), process.stdin as pipe:
            pickle.dump(_job(task.method, materials), pipe)
            for observation in materials.mapping.observations():
                pickle.dump(observation, pipe)
        answer = process.stdout.read()
    return int(answer) if process.returncode == 0 else None


def _job(method: Method, materials: Materials) -> Job:
    """What the process is asked to do."""
    config = materials.scenario.mapper
    if method == RATSLAM:
        return Job("RatSLAM", config)
    if method == NO_ATTRACTOR:
        return Job("no attractor", config)
    if method.mode is None:
        return Job("mapper", config)
    start = true_start(materials.mapping) if method.mode == "paper" else None
    return Job("mapper", config, (materials.roads, refine_config(materials.scenario, method.mode), start))


def _with(row: Row, peaks: dict[str, int | None]) -> Row:
    return row.model_copy(update={"peak_rss_bytes": peaks[row.method]}) if row.method in peaks else row
