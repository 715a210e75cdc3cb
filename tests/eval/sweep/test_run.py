"""A failed cell is listed with its cause and alone run again; an edited scenario or other code is not answered from old cells."""

import json
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.results.model import Network, ScenarioResult
from hippodrome.eval.sweep import run
from hippodrome.eval.sweep.cell import CellResult
from hippodrome.eval.sweep.grid import parse_parameter

GRID = [parse_parameter("noise=paper,harsh")]


@pytest.fixture
def ran(monkeypatch):
    """Cells that were run, in threads and without driving; seed 2 under harsh noise fails as long as ``broken`` is set."""
    cells, broken, lock = [], threading.Event(), threading.Lock()
    broken.set()

    def run_cell(task):
        scenario = task.cell.scenario
        with lock:
            cells.append((scenario.seed, scenario.noise))
        if broken.is_set() and (scenario.seed, scenario.noise) == (2, "harsh"):
            raise HippodromeError("town.net.xml: no road")
        network = Network(generator="grid", edges=1, km=1.0)
        result = ScenarioResult(
            name=scenario.name, seed=scenario.seed, network=network, noise=scenario.noise_name, frames=1, duration_s=1.0, rows=()
        )
        return CellResult(parameters=dict(task.cell.parameters), result=result, samples={})

    monkeypatch.setattr(run, "run_cell", run_cell)
    monkeypatch.setattr(run, "make_recording", lambda task: "")
    monkeypatch.setattr(run, "require_gl", lambda: None)
    monkeypatch.setattr(run, "local_processes", lambda workers: lambda width: ThreadPoolExecutor(width or workers))
    return cells, broken


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text("name: tiny\n")
    return path


def test_failed_cells_alone_are_run_again(ran, scenario, tmp_path, capsys):
    cells, broken = ran
    out = tmp_path / "out"
    assert not run.sweep([scenario], [1, 2], GRID, 1, None, out)
    assert cells == [(1, "paper"), (1, "harsh"), (2, "paper"), (2, "harsh")]
    assert "failed: tiny, seed 2, noise=harsh: town.net.xml: no road" in capsys.readouterr().out
    assert json.loads((out / "results.json").read_text())["failures"] == [
        {"cell": "tiny, seed 2, noise=harsh", "cause": "town.net.xml: no road"}
    ]
    assert "- tiny, seed 2, noise=harsh: town.net.xml: no road" in (out / "table.md").read_text()
    broken.clear()
    cells.clear()
    assert run.sweep([scenario], [1, 2], GRID, 1, None, out)
    assert cells == [(2, "harsh")]
    found = json.loads((out / "results.json").read_text())
    assert [one["name"] for one in found["scenarios"]] == ["tiny (noise=paper)", "tiny (noise=harsh)"] * 2
    assert found["failures"] == []


def test_an_edited_scenario_and_other_code_are_run_anew(ran, scenario, tmp_path, monkeypatch):
    cells, broken = ran
    broken.clear()
    assert run.sweep([scenario], [1], [], 1, None, tmp_path / "out")
    assert run.sweep([scenario], [1], [], 1, None, tmp_path / "out")
    assert len(cells) == 1
    scenario.write_text("name: tiny\ncamera: {rate_hz: 5}\n")
    assert run.sweep([scenario], [1], [], 1, None, tmp_path / "out")
    monkeypatch.setattr("hippodrome.eval.sweep.grid.cell_code_sha256", lambda: "other")
    assert run.sweep([scenario], [1], [], 1, None, tmp_path / "out")
    assert len(cells) == 3
