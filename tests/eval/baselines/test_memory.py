"""Peak memory is that of a process that runs the method and nothing else; a method that failed has none."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.baselines import memory
from hippodrome.eval.baselines.memory import MemoryTask, peak_rss_bytes
from hippodrome.sim.scenario import Scenario

RUN = {
    "dead reckoning": ["dead_reckoning"],
    "RatSLAM": ["run_ratslam"],
    "semi-metric": ["map_recording"],
    "semi-metric, no attractor": ["map_without_attractor"],
    "topometric (paper)": ["map_recording", "refine_map"],
    "topometric": ["map_recording", "refine_map"],
}


def task(method):
    return MemoryTask(method, Scenario(name="town"), Path("nowhere"))


@pytest.mark.parametrize("method", RUN)
def test_the_method_is_run_and_nothing_else(method, monkeypatch):
    ran = []

    def noting(name):
        return lambda *arguments: (ran.append(name), 0.0)

    for name in {name for names in RUN.values() for name in names}:
        monkeypatch.setattr(memory, name, noting(name))
    truth = Trajectory([0.0], [[1.0, 2.0, 3.0]])
    mapping = SimpleNamespace(self_motion=lambda: [], observations=lambda: [], ground_truth=lambda: truth)
    materials = SimpleNamespace(mapping=mapping, roads=None, scenario=Scenario(name="town"))
    monkeypatch.setattr(memory, "gather", lambda scenario, out: materials)
    peak = peak_rss_bytes(task(method))
    assert ran == RUN[method]
    resident_pages = int(Path("/proc/self/statm").read_text().split()[1])
    assert peak >= 4096 * resident_pages * 0.9


def test_a_method_that_failed_has_no_figure(monkeypatch):
    def gather(scenario, out):
        raise HippodromeError("no map")

    monkeypatch.setattr(memory, "gather", gather)
    assert peak_rss_bytes(task("semi-metric")) is None
