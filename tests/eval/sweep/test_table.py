"""The merged table is of samples: a long drive weighs more than a short one, and the worst run is named."""

import numpy as np
import pytest

from hippodrome.eval.results.model import (
    ErrorSummary,
    LocalizationSummary,
    Network,
    Row,
    ScenarioResult,
)
from hippodrome.eval.sweep.cell import CellResult, Samples
from hippodrome.eval.sweep.grid import SweepCell
from hippodrome.eval.sweep.table import pooled_rows, sweep_markdown
from hippodrome.sim.scenario import Scenario
from tests.eval.drive.samples import MISSION, drive_figures


def finished(seed, errors_m, failure=None, noise="paper"):
    cell = SweepCell(Scenario(name="town", seed=seed, noise=noise), (("noise", f'"{noise}"'),))
    mean_m = None if failure else ErrorSummary(definition="APE", mean_m=float(np.mean(errors_m)))
    located = LocalizationSummary(definition="localization", success=failure is None, false_fixes=seed)
    rows = (Row(method="ours", failure=failure, ape=mean_m, localization=located),)
    network = Network(generator="grid", edges=1, km=1.0)
    result = ScenarioResult(name="town", seed=seed, network=network, noise=noise, frames=1, duration_s=1.0, rows=rows)
    samples = {"ape": Samples(definition="APE", errors_m=tuple(errors_m), matched=len(errors_m), total=len(errors_m))}
    return cell, CellResult(parameters={"noise": noise}, result=result, samples={} if failure else {"ours": samples})


def test_samples_are_pooled_not_means():
    (row,) = pooled_rows(dict([finished(1, [1.0] * 9), finished(2, [11.0])]))
    assert row["ape"]["mean_m"] == pytest.approx(2.0)  # the mean of means is 6
    assert (row["ape"]["max_m"], row["ape"]["count"], row["runs"]) == (11.0, 10, 2)
    assert row["worst"] == {"cell": "town, seed 2, noise=paper", "scenario": "town", "seed": 2, "ape_mean_m": 11.0}
    assert row["localized"] == {"successes": 2, "of": 2, "false_fixes": 3}


def test_a_method_that_failed_is_counted_and_its_cause_kept():
    (row,) = pooled_rows(dict([finished(1, [1.0]), finished(2, [], failure="no route")]))
    assert row["failed"] == [{"cell": "town, seed 2, noise=paper", "cause": "no route"}]
    assert (row["runs"], row["localized"]["successes"], row["ape"]["count"]) == (2, 1, 1)


def test_a_row_for_each_setting_and_a_list_of_what_has_no_result():
    rows = pooled_rows(dict([finished(1, [1.0]), finished(1, [], failure="no route", noise="harsh")]))
    text = sweep_markdown(rows, [("town, seed 3, noise=paper", "KeyError: 'x'")])
    assert "| noise=paper | ours | 1 | 0 | 1.00 | 1.00 | 1.00 | 1.00 | 1.00 (town, seed 1) |" in text
    assert "| noise=harsh | ours | 1 | 1 | - | - | - | - | - |" in text
    assert "- town, seed 3, noise=paper: KeyError: 'x'" in text


def test_missions_of_a_setting_are_pooled_in_a_table_of_their_own():
    rows = {}
    for seed, success in ((1, True), (2, False)):
        cell = SweepCell(Scenario(name="town", seed=seed), ())
        drive = drive_figures(missions_detail=[{**MISSION, "success": success, "events": {"wrong way": 2}}])
        result = ScenarioResult(name="town", seed=seed, network=Network(edges=1, km=1.0), noise="paper", frames=0, duration_s=0.0,
                                rows=(Row(method="ours", drive=drive),))  # fmt: skip
        rows[cell] = CellResult(parameters={}, result=result, samples={})
    (pooled,) = pooled_rows(rows)
    assert pooled["drive"]["missions"] == 2 and pooled["drive"]["success_rate"] == 0.5 and pooled["drive"]["wrong_way"] == 4
    text = sweep_markdown([pooled], [])
    assert "| as written | ours | 2 | 2 | 50 |" in text and "APE" not in text
