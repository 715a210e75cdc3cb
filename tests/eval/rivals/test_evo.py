"""evo, given the exported files as its command line reads them, finds the figures of the tables."""

import numpy as np
import pytest
from evo.core import sync
from evo.core.metrics import PoseRelation, Unit
from evo.main_ape import ape as evo_ape
from evo.main_rpe import rpe as evo_rpe
from evo.tools.file_interface import read_tum_trajectory_file

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import RPE_DELTA_M, score_trajectory
from hippodrome.eval.metrics.trajectory import ape


@pytest.fixture
def files(tmp_path):
    """A winding drive at 10 Hz, and an estimate of every seventh pose in a frame of its own; both also on disk."""
    rng = np.random.default_rng(3)
    steps = np.column_stack([rng.uniform(0.3, 0.9, 900), np.zeros(900), 0.03 * np.sin(np.arange(900) / 40.0)])
    true = Trajectory(0.1 * np.arange(1, 901), se2.integrate(np.array([120.0, -40.0, 0.7]), steps))
    noise = rng.normal(0.0, 1.0, (len(true.t_s[::7]), 3)) * np.array([0.4, 0.4, 0.02])
    found = Trajectory(true.t_s[::7], se2.compose(np.array([-9.0, 5.0, -2.0]), true.poses[::7]) + noise)
    for name, one in (("ground-truth", true), ("method", found)):
        write_tum(tmp_path / f"{name}.tum", one)
    return found, true, tmp_path


def both(folder):
    trajectories = (read_tum_trajectory_file(str(folder / f"{name}.tum")) for name in ("ground-truth", "method"))
    return sync.associate_trajectories(*trajectories, max_diff=0.01)


@pytest.mark.parametrize(
    ("fit", "options"),
    [("none", {}), ("start", {"align_origin": True}), ("se2", {"align": True}), ("sim2", {"align": True, "correct_scale": True})],
)
def test_evo_ape_agrees(files, fit, options):
    found, true, folder = files
    stats = evo_ape(*both(folder), PoseRelation.translation_part, **options).stats
    ours = ape(found, true, fit)
    assert (stats["mean"], stats["max"], stats["rmse"]) == pytest.approx((ours.mean_m, ours.max_m, ours.rmse_m), abs=1e-6)


@pytest.mark.parametrize(("delta", "unit", "column"), [(1, Unit.frames, "rpe"), (RPE_DELTA_M, Unit.meters, "rpe_20m")])
def test_evo_rpe_agrees(files, delta, unit, column):
    found, true, folder = files
    result = evo_rpe(*both(folder), PoseRelation.translation_part, delta=delta, delta_unit=unit,
                     all_pairs=unit == Unit.meters, pairs_from_reference=True)  # fmt: skip
    assert result.stats["mean"] == pytest.approx(getattr(score_trajectory(found, true, "none"), column).mean_m, abs=1e-6)
