"""One mission of one row: where its files lie, how it is run, and how it is kept."""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import PACKAGE, code_sha256, read_bounded, replacing, sha256_of, write_atomically
from hippodrome._json import parse_json
from hippodrome.core.navigation.config import PlanConfig
from hippodrome.core.navigation.routes import mapped_lanes
from hippodrome.core.navigation.types import Goal
from hippodrome.core.types import HippodromeError
from hippodrome.eval.drive.drivers import Cockpit
from hippodrome.eval.drive.flight import TRACE, Flight, fly
from hippodrome.eval.drive.maps import read_map, surveyed
from hippodrome.eval.drive.missions import Mission, draw_missions, pose_of
from hippodrome.eval.drive.reference import reference_time_s
from hippodrome.eval.drive.rows import RowSpec
from hippodrome.eval.drive.scoring import mission_result
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.results.model import to_json
from hippodrome.eval.reuse import figure_code_sha256
from hippodrome.sim.loop.barriers import closed_roads
from hippodrome.sim.loop.world import World
from hippodrome.sim.record import RecordingPlan, close_renderer
from hippodrome.sim.scenario import Scenario

MAX_MISSION_BYTES: Final = 1 << 20  # of a mission's file
SEAL: Final = "sha256"  # key of a mission's file
DRIVE_CODE: Final = ("eval/drive/*.py",)


@dataclass(frozen=True, slots=True)
class MissionTask:
    """One mission of one row, on the map in ``map_file``."""

    scenario: Scenario
    row: RowSpec
    mission: Mission
    map_file: Path
    out: Path
    film: str  # webp or mp4; empty: none

    def file(self) -> Path:
        """Where its figures are, or will be; the name holds all that they depend on."""
        left_out = {"description", "thresholds", "methods", "missions"}  # nobody drives otherwise for them
        scenario = self.scenario.model_dump(mode="json", exclude=left_out)
        code = figure_code_sha256(*DRIVE_CODE), code_sha256(PACKAGE, DRIVE_CODE)
        who = self.row.key, *self.row.made_of()
        what = json.dumps([scenario, who, self.mission.as_json(), self.map_file.name, code], sort_keys=True, default=str)
        key = hashlib.sha256(what.encode()).hexdigest()[:12]
        return self.out / self.scenario.name / "missions" / f"{self.row.stem}-{self.mission.number:03d}-{key}.json"

    def trace_file(self) -> Path:
        """Where what happened is written, step by step."""
        return self.file().with_suffix(".npz")

    def film_file(self) -> Path:
        """Where its film is, if one was asked for."""
        return self.file().with_suffix(f".{self.film}")


def missions_of(scenario: Scenario, map_file: Path, out: Path, count: int) -> list[Mission]:
    """The missions of a scenario, drawn by its seed."""
    town = RecordingPlan(scenario, "mapping", out).town()
    mapped = mapped_lanes(surveyed(scenario, out), read_map(map_file), PlanConfig().mapped_within_m)
    closed = frozenset(town.network.edge_ids.index(name) for name in closed_roads(scenario, town.network))
    return draw_missions(town.network, mapped, scenario.seed, count, closed)


def run_mission(task: MissionTask) -> dict[str, Any]:
    """The figures of a mission, from its file where it is done. Prints a line when it ends."""
    file = task.file()
    if (kept := _kept(file, task.trace_file())) is not None and (not task.film or task.film_file().exists()):
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
    if flight.failure:
        figures["failure"] = flight.failure
    with replacing(task.trace_file()) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, columns=np.array(TRACE), trace=flight.trace.astype(np.float32))
    timed = {"figures": json.loads(to_json(figures)), "cpu_s": round(flight.cpu_s, 3)}
    if not flight.failure:  # one that failed is driven anew by the next command
        write_atomically(file, to_json(timed | {SEAL: _seal(timed, task.trace_file())}, str(file)).encode())
    print(_line(task, figures), file=sys.stderr, flush=True)
    return timed


def _flight(task: MissionTask, world: World) -> Flight:
    roads = surveyed(task.scenario, task.out)
    goal = Goal(*pose_of(roads, task.mission.goal_lane, task.mission.goal_m))
    hidden = tuple(task.out / name for name in ("recordings", "towns", task.scenario.name))
    cockpit = Cockpit(task.scenario, task.row, task.map_file, roads, goal, task.mission.number, hidden)
    if not task.film:
        return fly(world, task.mission, cockpit)
    from hippodrome.eval.drive.film import Film

    film = Film(world, task.mission)
    flight = fly(world, task.mission, cockpit, film.look)
    film.write(task.film_file())
    return flight


@lru_cache(maxsize=1)
def _world(scenario: Scenario, out: Path) -> World:
    """The process's one world: missions of one town share it."""
    town = RecordingPlan(scenario, "mapping", out).town()
    return World(scenario, out, closed=closed_roads(scenario, town.network))


def _kept(file: Path, trace_file: Path) -> dict[str, Any] | None:
    """What a finished mission left, if it and its trace are as they were written; what is broken or lost is made anew."""
    try:
        kept = parse_json(read_bounded(file, MAX_MISSION_BYTES))
        timed = {"figures": kept["figures"], "cpu_s": kept["cpu_s"]}
        return timed if kept[SEAL] == _seal(timed, trace_file) else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError, HippodromeError):
        return None


def _seal(timed: dict[str, Any], trace_file: Path) -> str:
    """A hash of a mission's figures and of its trace's file: what was cut, changed or swapped has another one."""
    what = json.dumps([timed, sha256_of(trace_file)], sort_keys=True)
    return hashlib.sha256(what.encode()).hexdigest()


def _line(task: MissionTask, figures: dict[str, Any]) -> str:
    outcome = "reached" if figures["success"] else f"FAILED ({figures['cause']})"
    events = ", ".join(f"{count} x {kind}" for kind, count in figures["events"].items())
    return (
        f"{task.scenario.name} {task.row.key} mission {task.mission.number}: {outcome} after {figures['driven_m']:.0f} m, "
        f"{figures['time_s']:.0f} s{'; ' + events if events else ''}"
    )
