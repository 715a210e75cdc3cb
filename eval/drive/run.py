"""``hippodrome drive``: scenarios in, missions out, scored. Maps are made by the same run; finished missions are kept."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hippodrome.core.types import HippodromeError
from hippodrome.eval.drive.foreign import GIVEN, Policy, check_policy
from hippodrome.eval.drive.maps import MapTask, make_map
from hippodrome.eval.drive.page import write_page
from hippodrome.eval.drive.rows import RowSpec, policy_row, row_named
from hippodrome.eval.drive.scoring import row_result
from hippodrome.eval.drive.table import print_table
from hippodrome.eval.drive.task import MissionTask, missions_of, run_mission
from hippodrome.eval.files.scenarios import effective_configuration
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.programs.containment import can_contain
from hippodrome.eval.report.drives import DRIVE_PAGE
from hippodrome.eval.report.report import REPORT, write_report
from hippodrome.eval.results.model import (
    DECIMALS,
    Declaration,
    Network,
    Results,
    Row,
    ScenarioResult,
    drive_of,
    read_results,
    write_results,
)
from hippodrome.eval.results.thresholds import failed_mission_limits
from hippodrome.eval.run import RESULTS, load_scenarios, make_recordings
from hippodrome.sim.loop.barriers import closed_roads
from hippodrome.sim.record import RecordingPlan
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario

MISSIONS: Final = 10  # in each town, unless the scenario or the command says otherwise


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """What ``hippodrome drive`` was asked for."""

    scenarios: Sequence[Path]
    network: Path | None
    seed: int | None
    missions: int | None  # None: as many as the scenario says, or ten
    rows: Sequence[str] | None  # None: those that the scenario says
    workers: int
    out: Path
    film: str = ""  # webp or mp4: one of each mission
    policies: Sequence[Policy] = ()  # that drive beside the rows


def drive(request: DriveRequest) -> bool:
    """Drive all missions, write ``results.json`` and the page, print the table. Returns whether no row had a serious infraction.

    Serious are a collision at fault, driving the wrong way, and a false arrival; a limit of a scenario that does not hold counts
    as one.

    Raises:
        HippodromeError: a scenario, its map or a row cannot be used.
    """
    scenarios = [asked(one, request) for one in load_scenarios(request.scenarios, request.network, request.seed)]
    results, tasks = drive_scenarios(scenarios, request.workers, request.out, request.film)
    write_results(request.out / RESULTS, with_earlier(results, request.out / RESULTS))
    write_page(results, tasks, request.out)
    if (request.out / REPORT).exists():  # of an evaluation in the same folder
        write_report(request.out)
    print_table(results)
    failures = [
        f"{result.name}: {line}"
        for scenario, result in zip(scenarios, results.scenarios, strict=True)
        for line in failed_mission_limits(scenario.thresholds.drive, result)
    ]
    for failure in failures:
        print(f"threshold failed: {failure}", file=sys.stderr)
    print(f"\nresults: {request.out / RESULTS}\npage:    {request.out / DRIVE_PAGE}")
    drives = [drive_of(row) or {} for result in results.scenarios for row in result.rows]
    return not failures and not any(_is_serious(one) for one in drives)


def asked(scenario: Scenario, request: DriveRequest) -> Scenario:
    """The scenario with the missions that the command asks for."""
    missions, names = scenario.missions, [one.name for one in request.policies]
    for name in names:
        if names.count(name) > 1 or name in missions.policies:
            raise HippodromeError(f"--policy {name}: there is another one of this name; give it its own, NAME=POLICY")
    if request.rows == [] and not (names or missions.policies):
        raise HippodromeError("--rows: nobody drives; name a row, or a --policy")
    changed = missions.model_copy(
        update={
            "count": request.missions or missions.count or MISSIONS,
            "rows": missions.rows if request.rows is None else tuple(request.rows),
            "policies": {**missions.policies, **{one.name: one.source for one in request.policies}},
        }
    )
    return scenario.model_copy(update={"missions": changed})


def drive_scenarios(scenarios: Sequence[Scenario], workers: int, out: Path, film: str = "") -> tuple[Results, list[MissionTask]]:
    """Record, map and drive the missions of scenarios; files go below ``out``. Raises HippodromeError."""
    for policy in dict.fromkeys(row.policy for scenario in scenarios for row in rows_of(scenario) if row.policy is not None):
        check_policy(policy)  # what cannot be loaded is said before anything is simulated
    require_gl()
    for scenario in scenarios:
        if scenario.localization.closed:  # a road that is not there is told of before anything is drawn
            closed_roads(scenario, RecordingPlan(scenario, "mapping", out).town().network)
    with worker_pool(workers) as pool:
        make_recordings([RecordingPlan(scenario, "mapping", out) for scenario in scenarios], pool)
        maps = pool.run("map", make_map, [MapTask(scenario, out) for scenario in scenarios])
        tasks = [task for scenario, file in zip(scenarios, maps, strict=True) for task in tasks_of(scenario, file, out, film)]
        print(f"{len(tasks)} missions in {len(scenarios)} towns; those that are done are kept", file=sys.stderr, flush=True)
        figures = pool.run("drive", run_mission, tasks)
    return Results(scenarios=tuple(scenario_result(one, tasks, figures, out) for one in scenarios)), tasks


def drive_here(scenario: Scenario, out: Path) -> ScenarioResult:
    """The missions of one scenario in this process, on a drive that is recorded below ``out``. Raises HippodromeError."""
    tasks = tasks_of(scenario, make_map(MapTask(scenario, out)), out)
    return scenario_result(scenario, tasks, [run_mission(task) for task in tasks], out)


def tasks_of(scenario: Scenario, map_file: Path, out: Path, film: str = "") -> list[MissionTask]:
    """The missions of a scenario that says how many, for each of its rows."""
    assert scenario.missions.count is not None
    missions = missions_of(scenario, map_file, out, scenario.missions.count)
    return [MissionTask(scenario, row, mission, map_file, out, film) for mission in missions for row in rows_of(scenario)]


def rows_of(scenario: Scenario) -> list[RowSpec]:
    """Who drives a scenario's missions. Raises HippodromeError."""
    ours = [row_named(key) for key in dict.fromkeys(scenario.missions.rows)]
    return [*ours, *(policy_row(Policy(name, source)) for name, source in scenario.missions.policies.items())]


def with_earlier(results: Results, file: Path) -> Results:
    """The results with the rows of maps and localization that an evaluation of the same scenarios left in a file."""
    try:
        earlier = {(one.name, one.seed): one for one in read_results(file).scenarios} if file.exists() else {}
    except HippodromeError:  # of another version, or broken: it is written anew
        return results
    return Results(scenarios=tuple(_joined(earlier.get((one.name, one.seed)), one) for one in results.scenarios))


def _joined(earlier: ScenarioResult | None, now: ScenarioResult) -> ScenarioResult:
    kept = () if earlier is None else tuple(row for row in earlier.rows if drive_of(row) is None)
    if earlier is None or not kept:
        return now
    return earlier.model_copy(update={"rows": (*kept, *now.rows), "configuration": now.model_dump()["configuration"]})


def scenario_result(
    scenario: Scenario, tasks: Sequence[MissionTask], figures: Sequence[dict[str, Any]], out: Path
) -> ScenarioResult:
    """The result of a scenario from all missions and their figures."""
    mine = [(task, one) for task, one in zip(tasks, figures, strict=True) if task.scenario.name == scenario.name]
    made = []
    for row in rows_of(scenario):
        own = [one for task, one in mine if task.row == row]
        simulated_s, cpu_s = sum(one["figures"]["time_s"] for one in own), sum(one["cpu_s"] for one in own)
        factor = round(simulated_s / cpu_s, DECIMALS) if cpu_s > 0.0 else None
        drive = {"row": row.key, **row_result([one["figures"] for one in own], factor)}
        made.append(Row(method=row.label, failure=_failure(own), declaration=_declaration(row), drive=drive))
    town = RecordingPlan(scenario, "mapping", out).town()
    edges = len(town.network.edge_ids)
    lengths = town.network.lane_lengths_m()[~town.network.is_internal]
    place = Network(path=None if scenario.town.network is None else scenario.town.network.name,
                    generator=scenario.town.kind if scenario.town.network is None else None,
                    edges=edges, km=float(lengths.sum()) / 1e3)  # fmt: skip
    return ScenarioResult(
        name=scenario.name,
        seed=scenario.seed,
        network=place,
        noise=scenario.noise_name,
        frames=0,
        duration_s=0.0,
        rows=tuple(made),
        configuration=effective_configuration(scenario),
    )


def _failure(figures: Sequence[dict[str, Any]]) -> str | None:
    """How many missions of a policy failed by its own fault, and how the first of them; None if none did."""
    causes = [cause for one in figures if (cause := one["figures"].get("failure"))]
    return f"{len(causes)} of {len(figures)} missions: {causes[0]}" if causes else None


def _declaration(row: RowSpec) -> Declaration | None:
    """What a policy was given, and whether the truth was within its reach; none for a row of ours."""
    if row.policy is None:
        return None
    return Declaration(frame="network", given=GIVEN, source=row.policy.source, isolated=can_contain())


def _is_serious(drive: dict[str, Any]) -> bool:
    return any(drive[key] > 0 for key in ("collisions_at_fault", "wrong_way", "false_arrivals"))
