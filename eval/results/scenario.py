"""The result of one scenario: its rows, and what they were measured on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hippodrome.eval.files.scenarios import effective_configuration, portable
from hippodrome.eval.methods.materials import Materials, TopometricResult
from hippodrome.eval.methods.method import Method
from hippodrome.eval.results.model import Network, Row, ScenarioResult


def scenario_result(
    materials: Materials, rows: Sequence[Row], mapping_s: float, topometric: Mapping[Method, TopometricResult]
) -> ScenarioResult:
    """One entry of ``results.json``.

    Args:
        materials: What was evaluated.
        rows: The rows, in the order of the tables.
        mapping_s: CPU seconds that the semi-metric map took.
        topometric: The refined maps, for the times of their stages.
    """
    scenario = materials.scenario
    recordings = {"mapping": materials.mapping, "localization": materials.drive}
    step_ms = {method: 1e3 * float(result.localization.step_s.mean()) for method, result in topometric.items()}
    return ScenarioResult(
        name=scenario.name,
        seed=scenario.seed,
        network=_network(materials),
        noise=scenario.noise_name,
        frames=materials.mapping.frame_count,
        duration_s=materials.duration_s,
        rows=tuple(rows),
        tours={role: recording.manifest["tour"] for role, recording in recordings.items()},
        town_notes=list(materials.town.notes),
        configuration=effective_configuration(scenario),
        timings={
            "mapping_cpu_s": mapping_s,
            **{f"{method.label}: refinement_cpu_s": result.cpu_s for method, result in topometric.items()},
            **{f"{method.label}: localization_step_ms": value for method, value in step_ms.items()},
        },
    )


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
