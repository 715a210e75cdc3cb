"""The files that every figure of the tables can be computed from again, with evo for one."""

from __future__ import annotations

import json
from collections.abc import Mapping

from hippodrome._files import write_atomically
from hippodrome.eval.files.scenarios import effective_configuration
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import Materials, ScoredTrajectory, TopometricResult
from hippodrome.eval.methods.method import Method


def write_trajectories(
    materials: Materials, scored: Mapping[Method, ScoredTrajectory], topometric: Mapping[Method, TopometricResult]
) -> None:
    """Write the true trajectories, those of all methods, the declared poses of the localizer, and the scenario as it was run.

    They go to the scenario's folder: ``ground-truth.tum``, ``localization-ground-truth.tum``, ``STEM.tum`` and
    ``STEM-localization.tum`` of each method, ``scenario.json``.
    """
    folder = materials.folder
    write_tum(folder / "ground-truth.tum", materials.mapping.ground_truth())
    write_tum(folder / "localization-ground-truth.tum", materials.drive.ground_truth())
    for method, one in scored.items():
        write_tum(folder / f"{method.stem}.tum", one.trajectory)
    for method, result in topometric.items():
        declared = result.localization.declared()
        if declared is not None:
            write_tum(folder / f"{method.stem}-localization.tum", declared)
    text = json.dumps(effective_configuration(materials.scenario), indent=1, sort_keys=True) + "\n"
    write_atomically(folder / "scenario.json", text.encode())
