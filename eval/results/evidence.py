"""The files that every figure of the tables can be computed from again, with evo for one."""

from __future__ import annotations

import json
from collections.abc import Iterable

from hippodrome._files import write_atomically
from hippodrome.eval.files.scenarios import effective_configuration
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import Materials, Outcome, Unscored, truth_of


def write_trajectories(materials: Materials, outcomes: Iterable[Outcome | Unscored]) -> None:
    """Write the true trajectories, as far as they are known, those of all methods, the localizers' poses, and the scenario.

    They go to the scenario's folder: ``ground-truth.tum``, ``localization-ground-truth.tum``, ``STEM.tum`` and
    ``STEM-localization.tum`` of each method (``semi-metric.tum`` for one), ``scenario.json``.
    """
    folder = materials.folder
    for name, drive in (("ground-truth.tum", materials.mapping), ("localization-ground-truth.tum", materials.drive)):
        if (truth := truth_of(drive)) is not None:
            write_tum(folder / name, truth)
    for outcome in outcomes:
        write_tum(folder / f"{outcome.method.stem}.tum", outcome.trajectory)
        declared = outcome.localization.declared() if outcome.localization is not None else None
        if declared is not None:
            write_tum(folder / f"{outcome.method.stem}-localization.tum", declared)
    text = json.dumps(effective_configuration(materials.scenario), indent=1, sort_keys=True) + "\n"
    write_atomically(folder / "scenario.json", text.encode())
