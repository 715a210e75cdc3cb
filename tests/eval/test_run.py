"""The rounds of ``hippodrome eval``: what is made in which processes."""

import os
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from hippodrome.eval import run
from hippodrome.eval.results.model import Results
from hippodrome.sim import town_file


@pytest.mark.parametrize(("large_bytes", "pools"), [(10, 2), (10_000, 1)], ids=["large", "small"])
def test_a_large_town_is_evaluated_in_processes_that_did_not_draw_it(tmp_path, monkeypatch, large_bytes, pools):
    """Recording and evaluating take some 800 and 750 MiB for 1,000 km of road, in one process the sum of both."""
    net_file = tmp_path / "town.net.xml"
    net_file.write_text(" " * 100)
    scenario, opened = SimpleNamespace(town=SimpleNamespace(network=net_file)), []
    compiled = []

    @contextmanager
    def worker_pool(workers, plan, out):
        opened.append(plan)
        yield SimpleNamespace(run=lambda stage, task, tasks: [])

    monkeypatch.setattr(town_file, "LARGE_BYTES", large_bytes)
    for name, does in {
        "worker_pool": worker_pool,
        "require_gl": lambda: None,
        "entries_of": lambda scenario: (),
        "make_recordings": lambda plans, pool: None,
        "EvaluationTask": lambda scenario, out: None,
        "RecordingPlan": lambda scenario, role, out: None,
        "write_report": lambda out: None,
        "_compile_apart": lambda: compiled.append(len(opened)),
    }.items():
        monkeypatch.setattr(run, name, does)
    assert isinstance(run.run_scenarios([scenario], 2, tmp_path), Results)
    assert len(opened) == pools and opened[-1][-1] == "evaluate"
    assert compiled == ([1] if pools == 2 else [])  # between the two pools


def test_what_compiles_is_no_process_that_evaluates(monkeypatch):
    monkeypatch.setattr(run, "warm_up", os.getpid)
    monkeypatch.setattr(run, "is_compiled", lambda: False)
    asked = []

    @contextmanager
    def process_pool(workers):
        asked.append(workers)
        yield SimpleNamespace(submit=lambda task: SimpleNamespace(result=lambda: asked.append(task)))

    monkeypatch.setattr(run, "process_pool", process_pool)
    run._compile_apart()
    assert asked == [1, os.getpid]
    monkeypatch.setattr(run, "is_compiled", lambda: True)
    run._compile_apart()
    assert asked == [1, os.getpid]


def test_who_dies_over_compiling_leaves_it_to_the_evaluation(monkeypatch):
    monkeypatch.setattr(run, "warm_up", os.abort)
    monkeypatch.setattr(run, "is_compiled", lambda: False)
    run._compile_apart()
