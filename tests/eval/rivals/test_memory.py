"""Peak memory is that of a process that runs the method and no simulator; a method that failed has none."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.types import Observation, Trajectory
from hippodrome.eval.methods.method import NO_ATTRACTOR, RATSLAM, SEMI_METRIC, TOPOMETRIC, TOPOMETRIC_PAPER
from hippodrome.eval.rivals import memory
from hippodrome.eval.rivals.memory import MemoryTask, peak_rss_bytes
from hippodrome.sim.scenario import Scenario

STEPS = 60


@pytest.fixture(autouse=True)
def drive(monkeypatch):
    """Half a minute through frames of noise, without a road network."""
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 256, (STEPS, 120, 160, 3), dtype=np.uint8)
    seen = [Observation(0.5 * (i + 1), 0.5, 5.0, 0.0, frame) for i, frame in enumerate(frames)]
    truth = Trajectory(np.zeros(1), np.array([[1.0, 2.0, 3.0]]))
    mapping = SimpleNamespace(observations=lambda: seen, ground_truth=lambda: truth)
    materials = SimpleNamespace(mapping=mapping, roads=None, scenario=Scenario(name="town"))
    monkeypatch.setattr(memory, "gather", lambda scenario, out: materials)


def peak(method):
    return peak_rss_bytes(MemoryTask(method, Scenario(name="town"), Path("nowhere")))


def test_a_method_s_process_holds_the_method_and_not_us():
    own = 1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
    assert 50 << 20 < peak(NO_ATTRACTOR) < own


def test_a_method_that_failed_has_no_figure():
    assert peak(TOPOMETRIC_PAPER) is None


def test_each_method_has_a_job_of_its_own():
    materials = memory.gather(None, None)
    jobs = {method: memory._job(method, materials) for method in (SEMI_METRIC, RATSLAM, TOPOMETRIC_PAPER, TOPOMETRIC)}
    assert [job.kind for job in jobs.values()] == ["mapper", "RatSLAM", "mapper", "mapper"]
    assert jobs[SEMI_METRIC].refine is None
    assert jobs[TOPOMETRIC_PAPER].refine[1].mode == "paper"
    assert jobs[TOPOMETRIC_PAPER].refine[2].x_m == 1.0
    assert (jobs[TOPOMETRIC].refine[1].mode, jobs[TOPOMETRIC].refine[2]) == ("route", None)
