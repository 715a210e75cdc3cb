"""The gate's three answers: worse, not worse, cannot tell; held to how often it may err."""

import numpy as np
import pytest
from scipy.stats import t as student_t

from hippodrome.eval.cli import main
from hippodrome.eval.gate import run as gate_run
from hippodrome.eval.gate.baseline import Baseline, Figure, GateError, read_baseline, write_baseline
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.plants import OUTCOMES, even, nothing, outcomes, shuffled, single_town, uneven
from hippodrome.eval.gate.report import junit_xml, outcome_of, summary_markdown
from hippodrome.eval.gate.statistics import ALPHA, REPEATABILITY, corrected, effect_of, pairs_needed
from hippodrome.eval.gate.study import METHOD, study_baseline, study_markdown

HUNDRED = range(100)
APE = "APE mean (m)"


def answers(plant, seeds_a_town, figures=(), repeats=HUNDRED):
    found = outcomes(study_baseline(seeds_a_town), METHOD, plant, repeats, figures)
    return [found[outcome] for outcome in OUTCOMES]


def with_ratios(*ratios, figure=APE, town=lambda place: f"town {place}"):
    """A baseline of one pair per ratio, and a run with one figure of each pair multiplied by it."""
    then = study_baseline(1).cells[0]
    cells = [then.model_copy(update={"scenario": town(place), "seed": place}) for place in range(len(ratios))]
    moved = [cell.model_copy(update={"figures": {**cell.figures, figure: Figure(value=cell.figures[figure].value * ratio,
                                                                               definition=figure)}})
             for cell, ratio in zip(cells, ratios, strict=True)]  # fmt: skip
    return Baseline(cells=tuple(moved)), Baseline(cells=tuple(cells))


@pytest.mark.parametrize("figures", [(), (APE,)])
@pytest.mark.parametrize("jitter", [0.0, 0.01])
def test_ten_per_cent_in_every_pair_are_caught_with_three_pairs(figures, jitter):
    assert answers(even(0.10, jitter), 1, figures)[0] >= 95


@pytest.mark.parametrize("figures", [(), (APE,)])
@pytest.mark.parametrize("seeds_a_town", [1, 2, 4])
def test_a_quarter_more_in_one_town_of_three_is_never_passed(figures, seeds_a_town):
    assert answers(single_town(0.25), seeds_a_town, figures)[2] == 0


@pytest.mark.parametrize("improvement", [0.8, 0.9, 0.95])
def test_a_quarter_more_in_one_town_is_not_outweighed_by_the_others(improvement):
    assert outcome_of(compare(*with_ratios(1.25, improvement, improvement)), ()) == "cannot tell"


@pytest.mark.parametrize("figures", [(), (APE,)])
@pytest.mark.parametrize("seeds_a_town", [1, 2, 4])
def test_changes_that_only_shuffle_fail_at_most_five_times_in_a_hundred(figures, seeds_a_town):
    """Over a thousand changes; one figure, or each figure of the method by itself."""
    assert answers(shuffled(), seeds_a_town, figures, range(1000))[0] <= 50


def test_the_same_code_passes():
    assert answers(nothing(), 1) == [0, 0, 100]


def test_large_uneven_harm_is_caught_and_small_is_not_passed():
    assert answers(uneven(0.25), 1)[0] >= 75
    assert answers(uneven(0.10), 1)[2] == 0


def test_errors_that_grow_by_a_length_fail_though_each_pair_grows_by_another_share():
    """A fixed offset added to three small errors of different size; the ratios are those of real drives."""
    verdict = compare(*with_ratios(0.332 / 0.202, 0.337 / 0.289, 0.407 / 0.278))
    (change,) = [change for change in verdict.changes if change.moved]
    assert verdict.failed and change.regressed
    assert 1.0 < change.low < change.ratio < change.high


def test_the_probability_is_students_where_the_pairs_agree():
    rng = np.random.default_rng(3)
    ratios = 0.05 + 0.02 * rng.standard_normal(6)
    statistic = ratios.mean() / (ratios.std(ddof=1) / np.sqrt(6))
    assert effect_of(ratios).p_worse == pytest.approx(2.0 * student_t.sf(statistic, 5))
    assert effect_of(ratios).low < ratios.mean() < effect_of(ratios).high


def test_the_interval_holds_the_true_change_as_often_as_it_says():
    rng = np.random.default_rng(7)
    effects = [effect_of(0.1 + 0.12 * rng.standard_normal(6)) for _ in range(2000)]
    assert sum(effect.low < 0.1 < effect.high for effect in effects) / 2000 > 0.90


def test_hochbergs_correction():
    """The example of Hochberg and Benjamini 1990: figures that agree support one another, a lone one pays for all."""
    assert corrected([0.01, 0.02, 0.03]) == pytest.approx([0.03, 0.03, 0.03])
    assert corrected([0.01, 0.5, 0.5]) == pytest.approx([0.03, 0.5, 0.5])
    assert corrected([]) == []


@pytest.mark.parametrize(("mean", "spread"), [(0.05, 0.08), (0.1, 0.2), (0.08, 0.0)])
def test_the_pairs_that_it_asks_for_are_enough(mean, spread):
    """As many pairs with the same mean and spread prove the change, one pair less does not."""

    def pairs(count):
        shape = np.resize([1.0, -1.0], count) - np.mean(np.resize([1.0, -1.0], count))
        return mean + spread * shape / max(np.std(shape, ddof=1), 1e-9)

    needed = pairs_needed(pairs(3), 1) if spread else pairs_needed(np.array([mean]), 1)
    assert needed is not None
    if spread:
        assert effect_of(pairs(needed)).p_worse < ALPHA <= effect_of(pairs(needed - 1)).p_worse


def test_a_change_of_nearly_nothing_needs_more_pairs_than_anybody_runs():
    assert pairs_needed(np.array([0.9, -0.89, 0.0]), 1) is None


def test_what_cannot_be_told_is_told_everywhere(tmp_path, capsys):
    run, baseline = with_ratios(1.25, 1.0, 1.0)
    verdict = compare(run, baseline)
    said = gate_run.say(verdict, (), tmp_path / "j.xml"), capsys.readouterr().out
    assert said[0] == "cannot tell"
    assert "cannot tell: " in said[1] and "pairs needed, there are 3" in said[1]
    assert "gate CANNOT TELL (exit status 3)" in said[1]
    assert b'errors="1"' in (tmp_path / "j.xml").read_bytes() and b"<error " in junit_xml(verdict, ())
    assert "### Gate: cannot tell" in summary_markdown(verdict, ())
    assert not verdict.passed and not verdict.failed


def test_a_limit_for_each_town():
    run, baseline = with_ratios(1.25, 0.9, 0.9, 0.9, 0.9, 0.9, town=lambda place: f"town {place // 2}")
    assert not compare(run, baseline).failed
    (line,) = compare(run, baseline, 0.05).lost
    assert line.startswith("'town 0', 'topometric': APE mean (m) +6.1% over its seeds, the limit for a town is +5.0%")
    assert not compare(run, baseline, 0.10).failed


def test_a_figure_that_vanishes_fails():
    run, baseline = with_ratios(1.0, 1.0, 1.0)
    first = run.cells[0].model_copy(update={"figures": {k: v for k, v in run.cells[0].figures.items() if k != APE}})
    verdict = compare(Baseline(cells=(first, *run.cells[1:])), baseline)
    assert verdict.lost == (f"'town 0', seed 0, 'topometric': {APE} is missing",)
    none_left = Baseline(cells=tuple(cell.model_copy(update={"figures": {}}) for cell in run.cells))
    assert compare(none_left, baseline).failed
    assert compare(baseline, none_left).passed and compare(baseline, none_left).fresh == 9


def test_a_figure_of_two_pairs_is_no_reason_to_refuse_the_rest():
    """A drive that was never localized has no localization error; what the other two pairs say is too little, and is said."""
    run, baseline = with_ratios(1.3, 1.3, 1.3)
    thin = [Baseline(cells=(cells[0].model_copy(update={"figures": {}}), *cells[1:])) for cells in (run.cells, baseline.cells)]
    verdict = compare(*thin)
    assert outcome_of(verdict, ()) == "cannot tell"
    assert any("pairs needed, there are 2" in change.undecided for change in verdict.changes)


def test_power_of_an_unknown_method_is_refused(tmp_path, capsys):
    write_baseline(tmp_path / "b.json", study_baseline(1))
    assert main(["gate", "--power", "nomethod", "--baseline", str(tmp_path / "b.json")]) == 2
    assert "has no method 'nomethod'; it has: topometric" in capsys.readouterr().err
    assert main(["gate", "--power", "--baseline", str(tmp_path / "b.json")]) == 0
    said = capsys.readouterr().out
    assert "uneven: 0 to +20%" in said and "single town: +25% in one alone" in said


def test_the_table_of_the_documents_is_what_the_study_prints():
    """A tenth of the changes, for time; the numbers of the full study are pinned by the tests above."""
    page = (gate_run.Path(__file__).parents[3] / "docs" / "authoring.md").read_text(encoding="utf-8")
    for line in study_markdown(2).splitlines()[2:]:
        assert "| ".join(line.split("| ")[:2]).strip() in page, line


@pytest.mark.parametrize("place", ["/proc/none/j.xml", "{folder}"])
def test_a_verdict_that_cannot_be_written_is_found_before_the_run(place, tmp_path, monkeypatch, capsys):
    write_baseline(tmp_path / "b.json", study_baseline(1))
    scenario = tmp_path / "a.yaml"
    scenario.write_text("name: a\n")
    monkeypatch.setattr(gate_run, "run_scenarios", lambda *_: pytest.fail("the run began"))
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    command = ["gate", str(scenario), "--baseline", str(tmp_path / "b.json"), "--out", str(tmp_path / "o")]
    place = place.format(folder=tmp_path)
    assert main([*command, "--junit", place]) == 2
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", place)
    assert main(command) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_numbers_of_thousands_of_digits_are_a_sentence(tmp_path, capsys):
    path = tmp_path / "b.json"
    path.write_text('{"format": 1, "cells": ' + "9" * 5000 + "}")
    with pytest.raises(GateError, match="not a readable baseline"):
        read_baseline(path)
    (tmp_path / "results.json").write_text('{"scenarios": ' + "9" * 5000 + "}")
    assert main(["compare", str(tmp_path), str(tmp_path)]) == 2
    assert main(["report", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("not a readable results file") == 2


def test_rounding_is_no_change():
    run, baseline = with_ratios(1.0 + 2e-3, 1.0 - 2e-3, 1.0 + 3e-3)
    assert not any(change.moved for change in compare(run, baseline).changes)
    assert REPEATABILITY > 2e-3
