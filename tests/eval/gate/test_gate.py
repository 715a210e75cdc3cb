"""The gate: real regressions fail, noise does not, and what cannot be compared is refused."""

import io
import json
import xml.etree.ElementTree as ElementTree
from itertools import product

import numpy as np
import pytest
from rich.console import Console

from hippodrome.eval.cli import main
from hippodrome.eval.gate import run as gate_run
from hippodrome.eval.gate.baseline import (
    Baseline,
    BaselineRow,
    Figure,
    GateError,
    baseline_of,
    question_of,
    read_baseline,
    write_baseline,
)
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.power import power_of
from hippodrome.eval.gate.report import junit_xml, print_verdict, summary_markdown
from hippodrome.eval.results.model import (
    ErrorSummary,
    LocalizationSummary,
    Network,
    Results,
    Row,
    ScenarioResult,
    write_results,
)
from hippodrome.sim.scenario import Scenario, load_scenario

TOWNS, SEEDS, METHODS = ("rural", "grid", "radial", "random"), (1, 2, 3), ("semi-metric", "topometric (paper)", "topometric")
LEVEL_M = {"semi-metric": 60.0, "topometric (paper)": 1.0, "topometric": 0.4}


def cells(change=lambda scenario, seed, method, name, value: value, towns=TOWNS, seeds=SEEDS, **fields):
    """A run whose figures differ between towns and seeds by a factor of up to 3, as real ones do."""
    found = []
    for place, (scenario, seed, method) in enumerate(product(towns, seeds, METHODS)):
        figures = {}
        for name in ("APE mean (m)", "RPE mean (m)", "localization error mean (m)"):
            value = LEVEL_M[method] * (1.0 + 2.0 * ((7 * place + len(name)) % 12) / 12.0)
            figures[name] = Figure(value=change(scenario, seed, method, name, value), definition=name)
        whole = {"scenario": scenario, "seed": seed, "question": "q", "method": method, "failed": False, "localized": True,
                 "figures": figures, **fields}  # fmt: skip
        found.append(BaselineRow(**whole))
    return Baseline(cells=tuple(found))


def noisy(rng, sigma):
    return lambda *place: place[-1] * np.exp(sigma * rng.standard_normal())


def worse_ape(share, rng=None, sigma=0.0):
    def change(scenario, seed, method, name, value):
        factor = 1.0 + share if method == "topometric" and name.startswith("APE") else 1.0
        return value * factor * (np.exp(sigma * rng.standard_normal()) if rng is not None else 1.0)

    return change


def regressed(verdict):
    return {(change.method, change.figure) for change in verdict.changes if change.regressed}


def test_the_same_code_never_fails():
    """Twenty repeats: to the last digit, and with the rounding of another processor."""
    baseline = cells()
    assert compare(cells(), baseline).passed
    for repeat in range(20):
        assert compare(cells(noisy(np.random.default_rng(repeat), 0.01)), baseline).passed


def test_chance_fails_few_builds():
    """Changes of 5 % in every pair that cancel out: at most 5 % of the builds, here of 200, may fail; the bound is 3 sigma."""
    baseline = cells()
    failed = sum(compare(cells(noisy(np.random.default_rng(i), 0.05)), baseline).failed for i in range(200))
    assert failed <= 10 + 3 * 3.1


@pytest.mark.parametrize("towns", [TOWNS, ("rural",)])
def test_ten_per_cent_of_ape_are_caught(towns):
    """A planted regression, evenly over the pairs; also with one town and three seeds."""
    verdict = compare(cells(worse_ape(0.10), towns=towns), cells(towns=towns))
    assert regressed(verdict) == {("topometric", "APE mean (m)")}


def test_ten_per_cent_are_caught_among_noise():
    caught = 0
    for repeat in range(20):
        run = cells(worse_ape(0.10, np.random.default_rng(repeat), 0.02))
        caught += ("topometric", "APE mean (m)") in regressed(compare(run, cells()))
    assert caught == 20


def test_a_change_too_small_to_matter_passes():
    assert compare(cells(worse_ape(0.02)), cells()).passed


def test_improvements_pass_and_are_shown():
    verdict = compare(cells(worse_ape(-0.30)), cells())
    assert verdict.passed
    (change,) = [change for change in verdict.changes if change.moved]
    assert change.ratio == pytest.approx(0.7)


def test_losses_fail_whatever_the_means():
    failing = cells(failed=True, figures={})
    with_rows = Baseline(cells=(*failing.cells[:1], *cells().cells[1:]))
    assert compare(with_rows, cells()).lost == ("'rural', seed 1, 'semi-metric': fails now",)
    assert not compare(cells(localized=False), cells()).passed
    assert compare(cells(), cells(localized=False)).passed


@pytest.mark.parametrize(("run", "reason"), [
    (cells(question="another"), "'grid', seed 1, 'semi-metric': the scenario has changed|the scenario has changed"),
    (cells(seeds=(1, 2)), "the run lacks 'grid', seed 3"),
    (cells(towns=(*TOWNS, "more")), "the baseline lacks 'more', seed 1"),
])  # fmt: skip
def test_different_questions_are_not_compared(run, reason):
    with pytest.raises(GateError, match=reason):
        compare(run, cells())


def test_different_definitions_are_not_compared():
    data = cells().model_dump()
    data["cells"][0]["figures"]["APE mean (m)"]["definition"] = "APE, aligned"
    with pytest.raises(GateError, match="is defined as 'APE mean \\(m\\)' now and was 'APE, aligned'"):
        compare(cells(), Baseline.model_validate(data))


def test_too_few_pairs_are_refused():
    with pytest.raises(GateError, match=r"2 pair\(s\) of a scenario and a seed, the test needs 3"):
        compare(cells(towns=("rural",), seeds=(1, 2)), cells(towns=("rural",), seeds=(1, 2)))


def test_one_lost_street_among_many_fails_though_the_mean_forgives_it():
    """A pair ten times as bad widens the t-test's own error bar, so that the test alone would pass it."""

    def change(scenario, seed, method, name, value):
        return value * 10.0 if (scenario, seed, method, name) == ("grid", 2, "topometric", "APE mean (m)") else value

    verdict = compare(cells(change), cells())
    assert regressed(verdict) == set()
    assert verdict.failed
    (line,) = verdict.lost
    assert line.startswith("'grid', seed 2, 'topometric': APE mean (m) was ")


def test_a_doubled_error_inside_the_lane_is_left_to_the_mean():
    def change(scenario, seed, method, name, value):
        return 0.4 if (scenario, seed, method, name) == ("grid", 2, "topometric", "APE mean (m)") else value

    then = cells(lambda *place: 0.15 if place[:4] == ("grid", 2, "topometric", "APE mean (m)") else place[-1])
    assert compare(cells(change), then).lost == ()


def test_the_table_of_what_moved_fits_80_columns():
    screen = io.StringIO()
    print_verdict(compare(cells(lambda *place: place[-1] * 123.4), cells()), (), Console(file=screen, width=80))
    rows = [line.strip() for line in screen.getvalue().splitlines() if line.startswith(" topometric (paper)")]
    assert [line.split()[2] for line in rows] == ["APE", "RPE", "localization"]
    assert all(line.endswith("x 123   WORSE") for line in rows)
    assert len(screen.getvalue().splitlines()) < 30


@pytest.mark.parametrize("method", METHODS)
def test_power_is_told_from_the_baseline_alone(method):
    trials = {(trial.shaken, trial.planted): trial.failed for trial in power_of(cells(seeds=(1, 2), towns=TOWNS[:3]), method, 10)}
    assert trials[0.0, 0.0] == 0.0
    assert trials[0.0, 0.1] == trials[0.01, 0.1] == trials[0.01, 0.5] == 1.0
    assert trials[0.01, 0.0] == 0.0


def test_power_as_a_command(tmp_path, capsys):
    write_baseline(tmp_path / "b.json", cells(seeds=(1,), towns=TOWNS[:3]))
    assert main(["gate", "--power", "--baseline", str(tmp_path / "b.json")]) == 0
    said = capsys.readouterr().out
    assert "topometric, 3 pairs" in said and "APE +10%" in said
    assert main(["gate", "--baseline", str(tmp_path / "b.json")]) == 2


def test_the_question_is_the_scenario_without_the_answers_and_what_was_driven():
    def question(frames=100, km=1.0, **changed):
        configuration = {**json.loads(Scenario(name="a").model_dump_json()), **changed}
        fields = {"name": "a", "seed": 1, "noise": "paper", "duration_s": 1.0, "rows": (), "configuration": configuration}
        return question_of(ScenarioResult(network=Network(generator="grid", edges=1, km=km), frames=frames, **fields))

    assert question(mapper={"other": 1}, thresholds={}) == question()
    assert len({question(), question(seed=2), question(frames=101), question(km=1.1)}) == 4


def test_baseline_round_trip_and_broken_files(tmp_path):
    path = tmp_path / "baseline.json"
    whole = cells(lambda *place: round(place[-1], 6))
    write_baseline(path, whole)
    assert read_baseline(path) == whole
    for content, reason in (("{", "not a readable baseline"), ("[]", "top level"), ('{"format": 9}', "baseline format 9"),
                            ('{"format": 1, "cells": [{}]}', "cells.0.scenario")):  # fmt: skip
        path.write_text(content)
        with pytest.raises(GateError, match=reason):
            read_baseline(path)
    with pytest.raises(GateError, match="no baseline there"):
        read_baseline(tmp_path / "none.json")


def test_junit_and_summary_tell_what_failed():
    verdict = compare(cells(worse_ape(0.5)), cells())
    limit = "rural, seed 1: APE <limit> | broken \x00"
    suite = ElementTree.fromstring(junit_xml(verdict, [limit]))
    assert (suite.get("tests"), suite.get("failures")) == ("10", "2")
    assert len(suite.findall("testcase/failure")) == 2
    text = summary_markdown(verdict, [limit])
    assert "### Gate: failed" in text and "| WORSE |" in text and "APE &lt;limit> \\| broken" in text


def fake_run(ape_m):
    def run_scenarios(scenarios, workers, out):
        found = []
        for scenario in scenarios:
            seed = scenario.seed
            error = ErrorSummary(definition="APE", mean_m=ape_m + 0.01 * seed)
            row = Row(method="topometric", ape=error, localization=LocalizationSummary(definition="L", success=True))
            found.append(ScenarioResult(name=scenario.name, seed=seed, network=Network(generator="grid", edges=1, km=1.0),
                                          noise="paper", frames=1, duration_s=1.0, rows=(row,),
                                          configuration=json.loads(scenario.model_dump_json())))  # fmt: skip
        out.mkdir(parents=True, exist_ok=True)
        results = Results(scenarios=tuple(found))
        write_results(out / "results.json", results)
        return results

    return run_scenarios


def test_command_from_baseline_to_exit_status(tmp_path, monkeypatch, capsys):
    scenario, baseline, summary = tmp_path / "a.yaml", tmp_path / "b.json", tmp_path / "summary.md"
    scenario.write_text("name: a\nthresholds: {method: topometric, ape_mean_m: 1.0}\n")
    command = [
        "gate",
        str(scenario),
        "--baseline",
        str(baseline),
        "--out",
        str(tmp_path / "o"),
        "--junit",
        str(tmp_path / "j.xml"),
    ]
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    monkeypatch.setattr(gate_run, "run_scenarios", fake_run(0.5))
    assert main(command) == 2
    assert main([*command, "--update"]) == 0
    assert main(command) == 0
    assert "gate passed: 0 figure(s) moved" in capsys.readouterr().out
    monkeypatch.setattr(gate_run, "run_scenarios", fake_run(0.56))
    assert main(command) == 1
    monkeypatch.setattr(gate_run, "run_scenarios", fake_run(1.5))
    assert main([*command, "--update"]) == 0
    assert main(command) == 1  # no worse than the baseline, and beyond the scenario's own limit
    assert "a, seed 1: topometric: APE mean, m is 1.51, the limit is 1" in capsys.readouterr().out
    assert summary.read_text().count("### Gate") == 3
    assert ElementTree.parse(tmp_path / "j.xml").getroot().get("failures") == "3"


def test_cells_come_from_measured_rows_only():
    rows = (Row(method="quoted", quoted=True), Row(method="broken", failure="no route"))
    result = ScenarioResult(name="a", seed=1, network=Network(generator="grid", edges=1, km=1.0), noise="paper", frames=1,
                            duration_s=1.0, rows=rows)  # fmt: skip
    (cell,) = baseline_of([Results(scenarios=(result,))]).cells
    assert (cell.method, cell.failed, cell.figures) == ("broken", True, {})


def test_compare_shows_what_moved_between_two_folders(tmp_path, capsys):
    scenario = tmp_path / "a.yaml"
    scenario.write_text("name: a\n")
    for name, ape_m in (("one", 0.5), ("two", 0.6), ("same", 0.5)):
        fake_run(ape_m)([load_scenario(scenario)], 1, tmp_path / name)
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "two")]) == 0
    said = capsys.readouterr().out
    assert "+19.6 %" in said and "1 figure(s) moved, 0 stand still" in said
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "same")]) == 0
    assert "0 figure(s) moved, 1 stand still" in capsys.readouterr().out
    scenario.write_text("name: a\nnoise: harsh\n")
    fake_run(0.5)([load_scenario(scenario)], 1, tmp_path / "other")
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "other")]) == 2
    assert "the scenario has changed" in capsys.readouterr().err
