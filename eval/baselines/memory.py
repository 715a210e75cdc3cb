"""Peak memory of each of our methods, measured as ORB-SLAM3's is: of a process that does nothing else, the whole of it."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from hippodrome.core.types import HippodromeError, StartPose
from hippodrome.eval.baselines.rivals import NO_ATTRACTOR, RATSLAM, map_without_attractor, run_ratslam
from hippodrome.eval.evaluate import DEAD_RECKONING, MODES, SEMI_METRIC
from hippodrome.eval.materials import Materials, gather
from hippodrome.eval.results import Results, Row, ScenarioResult
from hippodrome.eval.stages import dead_reckoning, map_recording, refine_map
from hippodrome.sim.scenario import Scenario


@dataclass(frozen=True, slots=True)
class MemoryTask:
    """A method on the mapping drive of a scenario below ``out``."""

    method: str
    scenario: Scenario
    out: Path


def with_peak_rss(results: Results, scenario: Scenario, out: Path, workers: int) -> Results:
    """The results with the peak memory in the rows of our methods."""
    tasks = [MemoryTask(method, scenario, out) for method in (DEAD_RECKONING, SEMI_METRIC, RATSLAM, NO_ATTRACTOR, *dict(MODES))]
    spawn = multiprocessing.get_context("spawn")  # a fork would inherit the memory of this process
    try:
        with ProcessPoolExecutor(workers, mp_context=spawn, max_tasks_per_child=1) as fresh:
            found = dict(zip((task.method for task in tasks), fresh.map(peak_rss_bytes, tasks), strict=True))
    except BrokenProcessPool:
        raise HippodromeError(
            "peak memory: a process died (out of memory?); run the command again with fewer --workers"
        ) from None
    scenarios = (ScenarioResult(**{**dict(one), "rows": [_with(row, found) for row in one.rows]}) for one in results.scenarios)
    return Results(scenarios=tuple(scenarios))


def peak_rss_bytes(task: MemoryTask) -> int | None:
    """Run the method in this process; the most memory that the process ever held, None if the method failed."""
    try:
        _run(task.method, gather(task.scenario, task.out))
    except HippodromeError:
        return None  # its row says so already
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def _run(method: str, materials: Materials) -> None:
    observations, config = materials.mapping.observations(), materials.scenario.mapper
    if method == DEAD_RECKONING:
        dead_reckoning(materials.mapping.self_motion())
    elif method == RATSLAM:
        run_ratslam(observations)
    elif method == NO_ATTRACTOR:
        map_without_attractor(observations, config)
    else:
        semi_metric, _ = map_recording(observations, config)
        if method in dict(MODES):
            mode: Literal["paper", "default"] = dict(MODES)[method]
            pose = materials.mapping.ground_truth().poses[0]
            start = StartPose(*(float(value) for value in pose)) if mode == "paper" else None
            refine_map(semi_metric, materials.roads, replace(materials.scenario.refine, mode=mode), start)


def _with(row: Row, found: dict[str, int | None]) -> Row:
    return row.model_copy(update={"peak_rss_bytes": found[row.method]}) if row.method in found else row
