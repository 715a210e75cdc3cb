"""``hippodrome scenario validate``: is each file a scenario that can be driven?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hippodrome._folders import temporary_folder
from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.errors import file_errors
from hippodrome.eval.authoring.network_notes import network_notes
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.methods.method import ALWAYS
from hippodrome.sim.record import ROLES
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.tour import TourGraph, tour_graph, toured_area
from hippodrome.sim.town import build_town

ROWS = tuple(method.label for method in ALWAYS)  # rows of every evaluation, so that limits can be for them


@dataclass(frozen=True, slots=True)
class Finding:
    """One file: all its errors, or what it describes and what is odd about it."""

    path: Path
    errors: tuple[str, ...]
    summary: str
    notes: tuple[str, ...]


def check_scenario(path: Path) -> Finding:
    """Reads the file, builds or reads its town, and plans its tours; nothing is left on disk."""
    if errors := file_errors(path):
        return Finding(path, errors, "", ())
    try:
        scenario = read_scenario(path)
        with temporary_folder() as folder:
            town = build_town(scenario.town, scenario.seed, folder)
        graph = tour_graph(town.network)
        toured_area(graph, scenario.mapping.tour.planned_length_m())
    except HippodromeError as error:
        return Finding(path, (str(error),), "", ())
    except ValueError as error:
        return Finding(path, (f"{path}: {error}",), "", ())
    tours = ", ".join(f"{role} tour {getattr(scenario, role).tour.planned_length_m():.0f} m" for role in ROLES)
    summary = f"{scenario.name}: {town.name}, {len(graph.edges)} drivable edges, {graph.length_m.sum() / 1e3:.2f} km, {tours}"
    return Finding(path, (), summary, (*network_notes(scenario, town), *_tour_notes(scenario, graph), *_limit_notes(scenario)))


def _tour_notes(scenario: Scenario, graph: TourGraph) -> Iterator[str]:
    """How much of the drivable roads the mapping tour can see at most."""
    tour = scenario.mapping.tour
    share = (1.0 - tour.revisit_share) * tour.planned_length_m() / float(graph.length_m.sum())
    if share < 0.5:
        yield f"the mapping tour sees about {share:.0%} of the drivable roads; raise mapping.tour.length_m to see more"


def _limit_notes(scenario: Scenario) -> Iterator[str]:
    """Limits that speak of a row that `hippodrome eval` does not write always fail."""
    if scenario.thresholds.method not in ROWS:
        yield f"thresholds.method '{scenario.thresholds.method}' is none of the rows of every run: {', '.join(ROWS)}"
