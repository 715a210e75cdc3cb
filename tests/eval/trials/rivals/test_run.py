"""``hippodrome baselines`` completes the evaluation's results and tables, also where the tracker cannot be installed."""

import json

import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.programs.environments import NotInstalled
from hippodrome.eval.results.model import (
    Network,
    Results,
    Row,
    ScenarioResult,
    read_results,
    write_results,
)
from hippodrome.eval.trials.rivals import run, stage

SCENARIO = "name: hamlet\ntown: {kind: grid, width_m: 150, height_m: 150, road_km: 0.9}\nmapping: {tour: {length_m: 120}}\n"


@pytest.fixture
def scenario(tmp_path, monkeypatch):
    """A scenario file; its evaluation is stood in for, and nothing can be installed."""

    def evaluate(paths, network, seed, workers, out, methods=()):
        row = Row(method="semi-metric", cpu_percent=0.3)
        network = Network(generator="grid", edges=8, km=0.9)
        result = ScenarioResult(name="hamlet", seed=1, network=network, noise="paper", frames=9, duration_s=9.0, rows=(row,))
        write_results(out / "results.json", Results(scenarios=(result,)))
        return True

    def install():
        raise NotInstalled("installing pyorbslam3 failed: no wheel for this machine")

    monkeypatch.setattr(run, "evaluate", evaluate)
    monkeypatch.setattr(stage.RIVAL, "install", install)
    monkeypatch.setattr(run, "gather", lambda scenario, out: None)
    monkeypatch.setattr(run, "with_peak_rss", lambda results, scenario, out, pool: results)
    monkeypatch.setattr(run, "localize_sequences", lambda materials: [])
    monkeypatch.setattr(run, "localize_added", lambda materials, length_m: [])
    path = tmp_path / "hamlet.yaml"
    path.write_text(SCENARIO)
    return path


def test_rows_join_the_evaluation_s_and_a_missing_tracker_says_why(scenario, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    assert main(["baselines", str(scenario), "--out", str(out), "--workers", "1"]) == DONE
    (result,) = read_results(out / "results.json").scenarios
    assert [row.method for row in result.rows] == ["semi-metric", "ORB-SLAM3 (live)", "ORB-SLAM3 (final)"]
    assert result.rows[1].failure == "not run: installing pyorbslam3 failed: no wheel for this machine"
    table = (out / "table1.md").read_text()
    assert "ORB-SLAM3 (live) (FAILED)" in table
    assert "no wheel for this machine" in table
    assert [row["method"] for row in json.loads((out / "orb-slam3.json").read_text())] == [
        "ORB-SLAM3 (live)",
        "ORB-SLAM3 (final)",
    ]
    sequences = json.loads((out / "hamlet" / "table2.json").read_text())
    assert len(sequences) == 10
    assert all("no wheel" in row["failure"] for row in sequences)
    assert "no wheel" in json.loads((out / "hamlet" / "ratios.json").read_text())["not quoted"]
    assert "ORB-SLAM3 (live)" in (out / "report.html").read_text()


def test_a_quick_look_leaves_the_evaluation_alone(scenario, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    assert main(["baselines", str(scenario), "--out", str(out), "--workers", "1", "--seconds", "60"]) == DONE
    assert not (out / "results.json").exists()
    assert "ORB-SLAM3 (final): not run" in capsys.readouterr().out


def test_no_frames_is_bad_input(scenario, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(stage.RIVAL, "install", lambda: None)
    status = main(["baselines", str(scenario), "--out", str(tmp_path / "out"), "--workers", "1", "--seconds", "0.01"])
    assert status == BAD_INPUT
    assert "--seconds 0.01" in capsys.readouterr().err
