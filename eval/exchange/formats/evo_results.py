"""Result archives as ``evo_ape`` and ``evo_rpe`` write them: for ``evo_res``, and for whoever wants evo's own statistics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from evo import main_ape, main_rpe
from evo.core.metrics import PoseRelation, Unit
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.exported import Estimate, ExportedDrive
from hippodrome.eval.exchange.drives.poses import quaternions
from hippodrome.eval.methods.materials import RPE_DELTA_M
from hippodrome.eval.metrics.association import associate

CONVENTIONS = (
    "made by evo itself, of the reference interpolated to the estimate's times; position errors in metres",
    "METHOD-ape.zip: topometric* not aligned, others laid on the first pose without scaling",
    f"METHOD-rpe.zip: translation over {RPE_DELTA_M:g} m of reference path, all pairs",
)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write two archives for each drive and method. Raises ExchangeError if no drive has a truth."""
    if not any(drive.truth is not None for drive in drives):
        raise ExchangeError("no drive has a truth: evo has nothing to compare with")
    for drive in drives:
        (folder / drive.name).mkdir(parents=True)
        for method, estimate in drive.estimates.items():
            _write_results(drive, method, estimate, folder / drive.name)


def _write_results(drive: ExportedDrive, method: str, estimate: Estimate, here: Path) -> None:
    if drive.truth is None:
        return
    pairs = associate(estimate.trajectory, drive.truth)
    relation, own = PoseRelation.translation_part, estimate.frame == "own"
    absolute = main_ape.ape(
        _evo(pairs.t_s, pairs.reference, "ground-truth"), _evo(pairs.t_s, pairs.estimate, method), relation, align_origin=own
    )
    file_interface.save_res_file(str(here / f"{method}-ape.zip"), absolute)
    relative = main_rpe.rpe(
        _evo(pairs.t_s, pairs.reference, "ground-truth"),
        _evo(pairs.t_s, pairs.estimate, method),
        relation,
        delta=RPE_DELTA_M,
        delta_unit=Unit.meters,
        all_pairs=True,
        pairs_from_reference=True,
    )
    file_interface.save_res_file(str(here / f"{method}-rpe.zip"), relative)


def _evo(t_s: FloatArray, poses: FloatArray, name: str) -> PoseTrajectory3D:
    positions = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return PoseTrajectory3D(positions, np.roll(quaternions(poses), 1, axis=1), t_s, name=name)
