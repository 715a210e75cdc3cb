"""The files that every figure of the tables can be computed from again, with evo for one."""

from __future__ import annotations

import json
from collections.abc import Iterable

from hippodrome._files import write_atomically
from hippodrome.eval.files.scenarios import effective_configuration
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import Materials, Outcome


def write_trajectories(materials: Materials, outcomes: Iterable[Outcome]) -> None:
    """Write the true trajectories, those of all methods, the declared poses of the localizer, and the scenario as it was run.

    They go to the scenario's folder: ``ground-truth.tum``, ``localization-ground-truth.tum``, ``STEM.tum`` and
    ``STEM-localization.tum`` of each method (``semi-metric.tum`` for one), ``scenario.json``.
    """
    folder = materials.folder
    write_tum(folder / "ground-truth.tum", materials.mapping.ground_truth())
    write_tum(folder / "localization-ground-truth.tum", materials.drive.ground_truth())
    for outcome in outcomes:
        write_tum(folder / f"{outcome.method.stem}.tum", outcome.scored.trajectory)
        declared = outcome.localization.declared() if outcome.localization is not None else None
        if declared is not None:
            write_tum(folder / f"{outcome.method.stem}-localization.tum", declared)
    text = json.dumps(effective_configuration(materials.scenario), indent=1, sort_keys=True) + "\n"
    write_atomically(folder / "scenario.json", text.encode())
