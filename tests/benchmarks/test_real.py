"""The benchmark of real drives, on a drive that is made here: the real ones may not be at hand."""

import numpy as np
import pytest

from benchmarks.real import main, rpe_m, told_scale
from benchmarks.real_drives import RealDrive
from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.types import Observation


@pytest.fixture(scope="module")
def wandering():
    """A drive east along a straight road, whose odometry sees steps that are up to 10 % too long or too short."""
    mapper, seen = MotionMapper(), 8.0 * np.exp(0.1 * np.sin(np.arange(1200) / 60.0))
    for i in range(1200):
        mapper.step(Observation(0.1 * i + 0.1, 0.1, float(seen[i]), 0.0, None))
    made = mapper.finish()
    true = np.column_stack([8.0 * made.t_s, np.zeros((len(made.t_s), 2))])
    return RealDrive("made", "00", made, true)


def test_without_the_drives_it_says_so_and_that_is_no_fault(tmp_path, capsys):
    assert main([str(tmp_path)]) == 0
    assert "nothing is measured" in capsys.readouterr().out


def test_the_true_motion_has_no_error(wandering):
    assert rpe_m(wandering.true_poses, wandering) == 0.0
    stretched = wandering.true_poses * [1.05, 1.0, 1.0]
    assert rpe_m(stretched, wandering) == pytest.approx(0.05 * 20.0, rel=0.25)  # 20 m or a keyframe more


def test_a_told_scale_is_the_finer_the_better(wandering):
    def spread(drive):
        return np.std(np.log(drive.true_steps_m / np.hypot(drive.visits.motion[1:, 0], drive.visits.motion[1:, 1])))

    finely, coarsely = spread(told_scale(wandering, 5.0)), spread(told_scale(wandering, 160.0))
    assert finely < 1e-9 < coarsely < spread(wandering)
    assert spread(told_scale(wandering, 5.0, np.random.default_rng(0))) > spread(wandering)  # marks of a map that is off
