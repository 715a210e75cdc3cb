"""Missions in the gate: what is compared, what fails outright, what cannot be told, and the limits of a scenario."""

import pytest

from hippodrome.eval.gate import run as gate_run
from hippodrome.eval.gate.baseline import MISSIONS, baseline_of, question_of
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.report import junit_xml, outcome_of, summary_markdown
from hippodrome.eval.gate.run import broken_limits
from hippodrome.eval.results.model import Network, Results, Row, ScenarioResult, read_results
from hippodrome.eval.results.thresholds import failed_limits
from hippodrome.sim.mission_spec import MissionLimits
from hippodrome.sim.scenario import Scenario, Thresholds
from tests.eval.drive.samples import drive_figures

NETWORK = Network(path=None, generator="grid", edges=40, km=2.2)


def run(*, limits=None, count=10, seeds=(1, 2, 3), **figures):
    """Results of a town's missions; a figure may be one value, or one for each seed."""
    scenarios = []
    for place, seed in enumerate(seeds):
        drive = drive_figures(**{name: value[place] if isinstance(value, tuple) else value for name, value in figures.items()})
        configuration = {"missions": {"count": count}, "thresholds": {"drive": limits or {}}}
        rows = (Row(method="ours", drive={**drive, "row": "ours"}),)
        scenarios.append(ScenarioResult(name="town", seed=seed, network=NETWORK, noise="paper", frames=0, duration_s=0.0,
                                        rows=rows, configuration=configuration))  # fmt: skip
    return [Results(scenarios=tuple(scenarios))]


def verdict(before, after):
    return compare(baseline_of(after), baseline_of(before))


def test_the_same_missions_pass_and_all_figures_are_compared():
    found = verdict(run(), run())
    assert found.passed and {change.figure for change in found.changes} == set(MISSIONS)


def test_a_collision_where_there_was_none_fails_outright():
    found = verdict(run(), run(collisions_at_fault=(0, 1, 0)))
    assert found.lost == ("'town', seed 2, 'ours': collisions at fault (times) was 0 and is 1",)


def test_one_mission_more_that_is_missed_cannot_be_told_from_chance_and_many_fail():
    once = verdict(run(), run(success_rate=(1.0, 0.9, 1.0)))
    assert not once.failed and once.undecided and outcome_of(once, ()) == "cannot tell"
    assert "cannot tell" in summary_markdown(once, ()) and b"<error" in junit_xml(once, ())
    assert verdict(run(), run(success_rate=0.6)).failed
    assert verdict(run(), run(success_rate=(1.0, 0.4, 1.0))).lost


def test_fewer_missed_missions_pass():
    assert verdict(run(success_rate=0.7), run()).passed


def test_how_many_missions_are_asked_for_is_part_of_the_question():
    few, many = (run(count=count)[0].scenarios[0] for count in (3, 10))
    assert question_of(few) != question_of(many)


def test_a_figure_without_a_value_is_left_out():
    assert "time (ratio)" not in baseline_of(run(time_ratio=None)).cells[0].figures


def test_limits_of_missions_fail_and_say_which():
    limits = {"success_rate": 0.95, "collisions_at_fault": 0, "outside_lane_share": 0.02}
    assert broken_limits(run(limits=limits)) == []
    broken = broken_limits(run(limits=limits, success_rate=0.9, collisions_at_fault=2, outside_lane_share=0.3))
    assert broken[0] == "town, seed 1: ours: success_rate is 0.9, the limit is at least 0.95"
    assert broken[1] == "town, seed 1: ours: collisions_at_fault is 2, the limit is 0" and len(broken) == 9


def test_limits_speak_of_a_row_by_key_or_name():
    result = run()[0].scenarios[0]
    assert failed_limits(Thresholds(drive=MissionLimits(row="truth", spl=0.5)), result) == ["no row 'truth' of missions"]
    assert failed_limits(Thresholds(), result) == []
    with pytest.raises(ValueError, match="success_rate"):
        MissionLimits(success_rate=1.5)


def test_a_scenario_without_missions_has_none():
    assert Scenario(name="town").missions.count is None


def test_scenarios_with_missions_are_driven_and_the_others_evaluated(tmp_path, monkeypatch):
    for name, missions in (("driven", "missions: {count: 2, rows: [truth]}\n"), ("mapped", "")):
        (tmp_path / f"{name}.yaml").write_text(f"name: {name}\n{missions}")
    asked = {}

    def drives(scenarios, workers, out):
        asked["driven"] = [one.name for one in scenarios]
        return run()[0], []

    def evaluates(scenarios, workers, out):
        asked["mapped"] = [one.name for one in scenarios]
        return Results(scenarios=())

    monkeypatch.setattr(gate_run, "drive_scenarios", drives)
    monkeypatch.setattr(gate_run, "run_scenarios", evaluates)
    monkeypatch.setattr(gate_run, "write_page", lambda *_: None)
    paths, baseline = [tmp_path / "driven.yaml", tmp_path / "mapped.yaml"], tmp_path / "baseline.json"
    request = gate_run.GateRequest(paths, (1, 2), baseline, True, 1, tmp_path / "out", None)
    (tmp_path / "out/seed-1").mkdir(parents=True)
    (tmp_path / "out/seed-2").mkdir()
    assert gate_run.gate(request) == "passed"
    assert asked == {"driven": ["driven"], "mapped": ["mapped"]}
    assert "collisions at fault (times)" in baseline.read_text()
    assert len(read_results(tmp_path / "out/seed-2/results.json").scenarios) == 3
