"""``hippodrome baselines``: Table I with binocular ORB-SLAM3 beside the rest, on the same drive, and Table II of ours."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from pathlib import Path

from rich.console import Console

from hippodrome.core.types import HippodromeError
from hippodrome.eval.baselines.orbslam3.environment import NotInstalled, ensure_environment
from hippodrome.eval.baselines.orbslam3.rows import failed_rows, rows
from hippodrome.eval.baselines.orbslam3.tracker import Run, StereoDrive, run_tracker
from hippodrome.eval.baselines.orbslam3.training import VocabularyTask, train_vocabulary
from hippodrome.eval.baselines.sequences import table_two, write_table_two
from hippodrome.eval.materials import gather
from hippodrome.eval.paper_rows import quoted_rows
from hippodrome.eval.pool import Workers, worker_pool
from hippodrome.eval.results import Results, Row, ScenarioResult, read_results, to_json, write_results
from hippodrome.eval.run import RESULTS, evaluate, load_scenarios
from hippodrome.eval.tables import print_table_one, table_one_markdown
from hippodrome.proto.atomic import write_atomically
from hippodrome.sim.record import RecordingPlan, prepare, render_chunk
from hippodrome.sim.recording import CHUNK_FRAMES, Recording, read_samples
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario

ORBSLAM3_RESULTS = "orb-slam3.json"
# The size and about the baseline of the published car data sets. Without grain most of a street's surface has no corner to track.
STEREO = {"width": 640, "height": 480, "stereo_baseline_m": 0.5, "grain": True}


@dataclass(frozen=True, slots=True)
class BaselineOptions:
    """What the command line says."""

    scenario: Path
    out: Path
    runs: int
    workers: int
    seconds: float | None  # only this much of the drive, and ORB-SLAM3 only: a quick look
    paced: bool


def run_baselines(options: BaselineOptions) -> None:
    """Everything into ``options.out``; what is there already is not made again. Raises HippodromeError on bad input."""
    scenario = load_scenarios([options.scenario], None, None)[0]
    require_gl()
    if options.seconds is None:
        evaluate([options.scenario], None, None, options.workers, options.out)
    found = _orbslam3_rows(scenario, options)
    write_atomically(options.out / ORBSLAM3_RESULTS, to_json([row.model_dump(mode="python") for row in found]).encode())
    for row in found:
        _say(row)
    if options.seconds is None:
        _write_tables(options.out, found)
        write_table_two(options.out, table_two(gather(scenario, options.out)))
        print(f"tables: {options.out / 'table1.md'} {options.out / 'table2.md'}")


def stereo_scenario(scenario: Scenario) -> Scenario:
    """The same drives seen by a stereo camera at the odometry's rate: the tracker needs frames that overlap.

    Town, tour, traffic and seed stay, and none of them knows the camera: the drive is the same to the last bit.
    """
    camera = scenario.camera.model_copy(update={**STEREO, "rate_hz": scenario.odometry_rate_hz})
    return scenario.model_copy(update={"camera": camera})


def _orbslam3_rows(scenario: Scenario, options: BaselineOptions) -> list[Row]:
    try:
        python = ensure_environment(options.out / "venv")
    except NotInstalled as error:
        return failed_rows(f"not run: {error}")
    stereo = stereo_scenario(scenario)
    with worker_pool(options.workers) as pool:
        drive = _stereo_drive(RecordingPlan(stereo, "mapping", options.out), options.seconds, pool)
        vocabulary = pool.run("words", train_vocabulary, [VocabularyTask(stereo.camera, scenario.seed, options.out)])[0]
    return rows([_run(number, python, vocabulary, drive, scenario, options) for number in range(options.runs)], drive)


def _run(number: int, python: Path, vocabulary: Path, drive: StereoDrive, scenario: Scenario, options: BaselineOptions) -> Run:
    key = drive.recording.folder.name.rpartition("-")[2]  # another recording, another run: nothing stale is read back
    how = f"{key}-{drive.frames}-frames{'-paced' if options.paced else ''}"
    folder = options.out / scenario.name / "orb-slam3" / how / f"run-{number}"
    print(f"ORB-SLAM3: run {number + 1} of {options.runs}, {drive.frames:,} stereo pairs", flush=True)
    return run_tracker(python, vocabulary, drive, folder, options.paced)


def _stereo_drive(plan: RecordingPlan, seconds: float | None, pool: Workers) -> StereoDrive:
    """The first ``seconds`` of the drive, all of it if None; only the chunks that are needed are drawn."""
    missing = pool.run("simulate", prepare, [plan])[0]
    samples = read_samples(plan.folder() / "samples.npz")
    every = len(samples.frame_steps)
    frames = every if seconds is None else min(every, ceil(seconds * plan.scenario.camera.rate_hz))
    if frames < 2:
        raise HippodromeError(f"--seconds {seconds:g}: fewer than two frames, give a longer time")
    needed = [(plan, chunk) for chunk in missing if chunk * CHUNK_FRAMES < frames]
    pool.run("render", _render_chunk, needed, weight=lambda _: CHUNK_FRAMES)
    return StereoDrive(Recording(plan.folder(), {}, samples), plan.scenario.camera, frames)


def _render_chunk(task: tuple[RecordingPlan, int]) -> int:
    return render_chunk(*task)


def _write_tables(out: Path, found: list[Row]) -> None:
    """``results.json`` and the tables of the evaluation once more, with these rows."""
    results = read_results(out / RESULTS)
    scenarios = tuple(ScenarioResult(**{**dict(one), "rows": (*one.rows, *found)}) for one in results.scenarios)
    completed = Results(scenarios=scenarios)
    write_results(out / RESULTS, completed)
    write_atomically(out / "table1.md", table_one_markdown(completed, quoted_rows()).encode())
    print_table_one(completed, quoted_rows(), Console())


def _say(row: Row) -> None:
    if row.failure is not None or row.ape is None or row.cpu_percent is None or row.map_bytes is None:
        print(f"{row.method}: {row.failure or 'incomplete'}")
        return
    lost = f", {extra['maps_started']} maps" if (extra := row.model_extra or {}).get("maps_started", 1) > 1 else ""
    print(f"{row.method}: APE {row.ape.mean_m:.2f} m, CPU {row.cpu_percent:.1f} %, map {row.map_bytes / 1e6:.1f} MB, "
          f"{row.keyframes} keyframes of {row.camera_frames} frames{lost}")  # fmt: skip
