"""``hippodrome drive``: scenarios in, missions out, scored. Maps are made by the same run; finished missions are kept."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import PACKAGE, code_sha256, read_bounded, replacing, write_atomically
from hippodrome.core.navigation.config import PlanConfig
from hippodrome.core.navigation.routes import mapped_lanes
from hippodrome.core.types import HippodromeError
from hippodrome.eval.drive.flight import TRACE, Flight, fly
from hippodrome.eval.drive.maps import MapTask, make_map, read_map, surveyed
from hippodrome.eval.drive.missions import Mission, draw_missions
from hippodrome.eval.drive.page import PAGE, write_page
from hippodrome.eval.drive.reference import reference_time_s
from hippodrome.eval.drive.rows import RowSpec, row_named
from hippodrome.eval.drive.scoring import mission_result, row_result
from hippodrome.eval.drive.table import print_table
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.results.model import DECIMALS, Network, Results, Row, ScenarioResult, to_json, write_results
from hippodrome.eval.reuse import figure_code_sha256
from hippodrome.eval.run import RESULTS, load_scenarios, make_recordings
from hippodrome.sim.loop.world import World
from hippodrome.sim.record import RecordingPlan, close_renderer
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario

MAX_MISSION_BYTES: Final = 1 << 20  # of a mission's file
DRIVE_CODE: Final = ("eval/drive/*.py",)


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """What ``hippodrome drive`` was asked for."""

    scenarios: Sequence[Path]
    network: Path | None
    seed: int | None
    missions: int
    rows: Sequence[str]
    workers: int
    out: Path
    film: bool = False


@dataclass(frozen=True, slots=True)
class MissionTask:
    """One mission of one row, on the map in ``map_file``."""

    scenario: Scenario
    row: RowSpec
    mission: Mission
    map_file: Path
    out: Path
    film: bool

    def file(self) -> Path:
        """Where its figures are, or will be; the name holds all that they depend on."""
        what = json.dumps(
            [self.scenario.model_dump(mode="json", exclude={"description", "thresholds", "methods"}), self.row.key,
             self.mission.as_json(), self.map_file.name, figure_code_sha256(*DRIVE_CODE), code_sha256(PACKAGE, DRIVE_CODE)],
            sort_keys=True, default=str,
        )  # fmt: skip
        key = hashlib.sha256(what.encode()).hexdigest()[:12]
        return self.out / self.scenario.name / "missions" / f"{self.row.key}-{self.mission.number:03d}-{key}.json"

    def trace_file(self) -> Path:
        """Where what happened is written, step by step."""
        return self.file().with_suffix(".npz")

    def film_file(self) -> Path:
        """Where its film is, if one was asked for."""
        return self.file().with_suffix(".webp")


def drive(request: DriveRequest) -> bool:
    """Drive all missions, write ``results.json`` and the page, print the table. Returns whether no row had a serious infraction.

    Serious are a collision at fault, driving the wrong way, and a false arrival.

    Raises:
        HippodromeError: a scenario, its map or a row cannot be used.
    """
    rows = [row_named(key) for key in dict.fromkeys(request.rows)]
    scenarios = load_scenarios(request.scenarios, request.network, request.seed)
    require_gl()
    with worker_pool(request.workers) as pool:
        make_recordings([RecordingPlan(scenario, "mapping", request.out) for scenario in scenarios], pool)
        maps = pool.run("map", make_map, [MapTask(scenario, request.out) for scenario in scenarios])
        tasks = [
            MissionTask(scenario, row, mission, file, request.out, request.film)
            for scenario, file in zip(scenarios, maps, strict=True)
            for mission in missions_of(scenario, file, request.out, request.missions)
            for row in rows
        ]
        print(f"{len(tasks)} missions in {len(scenarios)} towns; those that are done are kept", file=sys.stderr, flush=True)
        figures = pool.run("drive", run_mission, tasks)
    results = Results(scenarios=tuple(_scenario_result(s, rows, tasks, figures, request.out) for s in scenarios))
    write_results(request.out / RESULTS, results)
    write_page(results, tasks, request.out)
    print_table(results)
    print(f"\nresults: {request.out / RESULTS}\npage:    {request.out / PAGE}")
    return not any(_is_serious(row.drive) for result in results.scenarios for row in result.rows)  # type: ignore[attr-defined]


def missions_of(scenario: Scenario, map_file: Path, out: Path, count: int) -> list[Mission]:
    """The missions of a scenario, drawn by its seed."""
    town = RecordingPlan(scenario, "mapping", out).town()
    mapped = mapped_lanes(surveyed(scenario, out), read_map(map_file), PlanConfig().mapped_within_m)
    closed = frozenset(
        town.network.edge_ids.index(name) for name in scenario.localization.closed if name in town.network.edge_ids
    )
    return draw_missions(town.network, mapped, scenario.seed, count, closed)


def run_mission(task: MissionTask) -> dict[str, Any]:
    """The figures of a mission, from its file where it is done. Prints a line when it ends."""
    file = task.file()
    if (kept := _kept(file)) is not None and (not task.film or task.film_file().exists()):
        return kept
    warm_up()
    close_renderer()  # that of the recordings: a process has one at a time
    file.parent.mkdir(parents=True, exist_ok=True)
    world = _world(task.scenario, task.out)
    try:
        reference_s = reference_time_s(world, task.mission)
        flight = _flight(task, world)
    finally:
        world.close()
    figures = mission_result(task.mission, flight, world.network, reference_s)
    with replacing(task.trace_file()) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, columns=np.array(TRACE), trace=flight.trace.astype(np.float32))
    timed = {"figures": json.loads(to_json(figures)), "cpu_s": round(flight.cpu_s, 3)}
    write_atomically(file, to_json(timed, str(file)).encode())
    print(_line(task, figures), file=sys.stderr, flush=True)
    return timed


def _flight(task: MissionTask, world: World) -> Flight:
    arguments = world, task.mission, task.row, read_map(task.map_file), surveyed(task.scenario, task.out)
    if not task.film:
        return fly(*arguments)
    from hippodrome.eval.drive.film import Film

    film = Film(world, task.mission)
    flight = fly(*arguments, look=film.look)
    film.write(task.film_file())
    return flight


@lru_cache(maxsize=1)
def _world(scenario: Scenario, out: Path) -> World:
    """The process's one world: missions of one town share it."""
    return World(scenario, out, closed=scenario.localization.closed)


def _kept(file: Path) -> dict[str, Any] | None:
    """What a finished mission left, if it is readable; a broken file is made anew."""
    try:
        kept = json.loads(read_bounded(file, MAX_MISSION_BYTES).decode())
    except (OSError, ValueError, HippodromeError):
        return None
    return kept if isinstance(kept, dict) and isinstance(kept.get("figures"), dict) and "cpu_s" in kept else None


def _line(task: MissionTask, figures: dict[str, Any]) -> str:
    outcome = "reached" if figures["success"] else f"FAILED ({figures['cause']})"
    events = ", ".join(f"{count} x {kind}" for kind, count in figures["events"].items())
    return (
        f"{task.scenario.name} {task.row.key} mission {task.mission.number}: {outcome} after {figures['driven_m']:.0f} m, "
        f"{figures['time_s']:.0f} s{'; ' + events if events else ''}"
    )


def _scenario_result(
    scenario: Scenario, rows: Sequence[RowSpec], tasks: Sequence[MissionTask], figures: Sequence[dict[str, Any]], out: Path
) -> ScenarioResult:
    mine = [(task, one) for task, one in zip(tasks, figures, strict=True) if task.scenario.name == scenario.name]
    made = []
    for row in rows:
        own = [one for task, one in mine if task.row == row]
        simulated_s, cpu_s = sum(one["figures"]["time_s"] for one in own), sum(one["cpu_s"] for one in own)
        factor = round(simulated_s / cpu_s, DECIMALS) if cpu_s > 0.0 else None
        made.append(Row(method=row.label, drive=row_result([one["figures"] for one in own], factor)))
    town = RecordingPlan(scenario, "mapping", out).town()
    edges = len(town.network.edge_ids)
    lengths = town.network.lane_lengths_m()[~town.network.is_internal]
    place = Network(path=None if scenario.town.network is None else scenario.town.network.name,
                    generator=scenario.town.kind if scenario.town.network is None else None,
                    edges=edges, km=float(lengths.sum()) / 1e3)  # fmt: skip
    return ScenarioResult(name=scenario.name, seed=scenario.seed, network=place, noise=scenario.noise_name, frames=0,
                          duration_s=0.0, rows=tuple(made))  # fmt: skip


def _is_serious(drive: dict[str, Any]) -> bool:
    return any(drive[key] > 0 for key in ("collisions_at_fault", "wrong_way", "false_arrivals"))
