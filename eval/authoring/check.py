"""``hippodrome scenario validate``: is each file a scenario that can be driven?"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from hippodrome.core.types import HippodromeError
from hippodrome.sim.scenario import Scenario, load_scenario
from hippodrome.sim.tour import tour_graph, toured_area
from hippodrome.sim.town import build_town


@dataclass(frozen=True, slots=True)
class Finding:
    """One file: an error, or what it describes and what is odd about its network."""

    path: Path
    error: str | None
    summary: str
    notes: tuple[str, ...]


def check_scenario(path: Path) -> Finding:
    """Reads the file, builds or reads its town, and plans its tours; nothing is left on disk."""
    try:
        scenario = load_scenario(path)
        with tempfile.TemporaryDirectory() as folder:
            town = build_town(scenario.town, scenario.seed, Path(folder))
        graph = tour_graph(town.network)
        planned = {role: _covered_share(scenario, role, float(graph.length_m.sum())) for role in ("mapping", "localization")}
        tours = ", ".join(f"{role} tour {getattr(scenario, role).tour.planned_length_m():.0f} m" for role in planned)
        toured_area(graph, scenario.mapping.tour.planned_length_m())
    except HippodromeError as error:
        return Finding(path, str(error), "", ())
    except ValueError as error:
        return Finding(path, f"{path}: {error}", "", ())
    summary = f"{scenario.name}: {town.name}, {len(graph.edges)} drivable edges, {graph.length_m.sum() / 1e3:.2f} km, {tours}"
    return Finding(path, None, summary, (*town.notes, *_tour_notes(planned["mapping"])))


def _covered_share(scenario: Scenario, role: str, drivable_m: float) -> float:
    """How much of the drivable roads a tour can see at most."""
    tour = getattr(scenario, role).tour
    return float((1.0 - tour.revisit_share) * tour.planned_length_m() / drivable_m)


def _tour_notes(share: float) -> tuple[str, ...]:
    if share >= 0.5:
        return ()
    return (f"the mapping tour sees about {share:.0%} of the drivable roads; raise mapping.tour.length_m to see more",)
