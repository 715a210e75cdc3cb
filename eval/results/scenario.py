"""The result of one scenario: its rows, and what they were measured on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hippodrome.eval.files.scenarios import effective_configuration, portable
from hippodrome.eval.methods.materials import Materials, Outcome
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.results.model import Network, Row, ScenarioResult


def scenario_result(
    materials: Materials, rows: Sequence[Row], outcomes: Sequence[Outcome], as_printed: Row | None = None
) -> ScenarioResult:
    """One entry of ``results.json``.

    Args:
        materials: What was evaluated.
        rows: The rows, in the order of the tables.
        outcomes: What the methods came to, for the times of their stages.
        as_printed: How the networks as the paper prints them localized the second drive, if they were tried.
    """
    scenario = materials.scenario
    recordings = {"mapping": materials.mapping, "localization": materials.drive}
    return ScenarioResult(
        name=scenario.name,
        seed=scenario.seed,
        network=_network(materials),
        noise=scenario.noise_name,
        frames=materials.mapping.frame_count,
        duration_s=materials.duration_s,
        rows=tuple(rows),
        as_printed=as_printed,
        tours={role: recording.manifest.get("tour") for role, recording in recordings.items()},
        town_notes=list(materials.town.notes),
        configuration=effective_configuration(scenario),
        timings=_timings(outcomes),
    )


def _timings(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """CPU time of the stages: ``mapping_cpu_s`` is that of the semi-metric map, on which the refined ones build."""
    semi_metric = [outcome.own_cpu_s for outcome in outcomes if outcome.method == SEMI_METRIC]
    found = {"mapping_cpu_s": semi_metric[0]} if semi_metric else {}
    refined = [outcome for outcome in outcomes if outcome.refined is not None]
    found |= {f"{outcome.method.label}: refinement_cpu_s": outcome.own_cpu_s for outcome in refined}
    for outcome in outcomes:
        if outcome.localization is not None:
            found[f"{outcome.method.label}: localization_step_ms"] = 1e3 * float(outcome.localization.step_s.mean())
    return found


def _network(materials: Materials) -> Network:
    """Size of the road network: the number of directed edges, and their length along the rightmost lane."""
    roads, spec = materials.town.network, materials.scenario.town
    is_road = ~roads.is_internal
    first_lane = np.unique(roads.lane_edge[is_road], return_index=True)[1]
    km = float(roads.lane_lengths_m()[is_road][first_lane].sum()) / 1e3
    return Network(
        path=portable(spec.network) if spec.network else None,
        generator=None if spec.network else spec.kind,
        edges=len(first_lane),
        km=km,
    )
