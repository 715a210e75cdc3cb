"""The gate on figures of real runs, not on made ones.

``gate_samples.json`` holds, of short and long drives in generated and real towns, the figures of the same code
* on two drives a dozen times, self-motion shaken in its ninth digit as by another processor, after once unshaken (``repeats``),
* on other towns and seeds (``drives``).
"""

import json
from pathlib import Path

import numpy as np
import pytest

from hippodrome.eval.commands.gate import SEEDS
from hippodrome.eval.gate.baseline import Baseline, BaselineRow, Figure, read_baseline
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.statistics import ALPHA, REPEATABILITY

SAMPLES = json.loads((Path(__file__).parent / "gate_samples.json").read_text(encoding="utf-8"))
REPEATS, DRIVES = SAMPLES["repeats"], SAMPLES["drives"]
APE, BUILDS = "APE mean (m)", 20


def cell(scenario, seed, method, figures):
    named = {name: Figure(value=value, definition=name) for name, value in figures.items()}
    return BaselineRow(scenario=scenario, seed=seed, question="q", method=method, failed=False, localized=None, figures=named)


def repeated(numbers, ape_factor=1.0):
    """Two scenarios with as many seeds as ``numbers``; each seed shows another repeat."""
    cells = []
    for seed, number in enumerate(numbers, start=1):
        for name, figures in REPEATS[number].items():
            scenario, method = name.split(": ")
            changed = {
                key: value * (ape_factor if (method, key) == ("topometric", APE) else 1.0) for key, value in figures.items()
            }
            cells.append(cell(scenario, seed, method, changed))
    return Baseline(cells=tuple(cells))


def drawn(names):
    return Baseline(cells=tuple(
        cell("town", seed, method, figures)
        for seed, name in enumerate(names, start=1) for method, figures in sorted(DRIVES[name].items())
    ))  # fmt: skip


def regressed(verdict):
    return {(change.method, change.figure) for change in verdict.changes if change.regressed}


def shaken_repeats(build):
    return np.random.default_rng(build).choice(np.arange(1, len(REPEATS)), 3, replace=False)


@pytest.mark.parametrize("build", range(BUILDS))
def test_repeats_of_the_same_code_pass(build):
    assert compare(repeated(shaken_repeats(build)), repeated([0, 0, 0])).passed


@pytest.mark.parametrize("build", range(BUILDS))
def test_ten_per_cent_more_ape_are_caught(build):
    verdict = compare(repeated(shaken_repeats(build), ape_factor=1.1), repeated([0, 0, 0]))
    assert regressed(verdict) == {("topometric", APE)}


def test_rounding_moves_figures_less_than_the_test_allows_for():
    ratios = [
        np.log(figure / REPEATS[0][name][key])
        for repeat in REPEATS[1:]
        for name, of in repeat.items()
        for key, figure in of.items()
    ]
    assert 0.0 < np.std(ratios) < REPEATABILITY


def test_other_drives_of_the_same_code_fail_as_rarely_as_promised():
    """Six drives against six others of the same code, paired at random: nothing is worse, though everything differs."""
    failed = 0
    for build in range(200):
        names = np.random.default_rng(build).permutation(sorted(DRIVES))
        failed += bool(regressed(compare(drawn(names[:6]), drawn(names[6:12]))))
    assert failed <= 200 * ALPHA + 3.0 * np.sqrt(200 * ALPHA)


def test_the_committed_baseline_is_what_make_gate_runs():
    root = Path(__file__).parents[3] / "scenarios"
    cells = read_baseline(root / "baseline.json").cells
    assert {cell.scenario for cell in cells} == {path.stem for path in (root / "gate").glob("*.yaml")}
    assert {cell.seed for cell in cells} == set(SEEDS)
    assert not any(cell.failed for cell in cells)
