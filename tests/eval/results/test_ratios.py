"""Ratios compare what both did, and are not quoted where ORB-SLAM3 did not do its work."""

import pytest

from hippodrome.eval.methods.method import ORBSLAM3, ORBSLAM3_FINAL, REFINED
from hippodrome.eval.results.model import ErrorSummary, LocalizationSummary, Row
from hippodrome.eval.results.ratios import ratio_lines, ratios
from hippodrome.eval.results.table_two import SequenceRow
from hippodrome.eval.results.tables import MAPPING_COLUMNS, row_cells

FINAL, METHOD = ORBSLAM3_FINAL.label, ORBSLAM3.label
OURS = [method.label for method in REFINED]


def theirs(mean_m=0.3, tracked_share=1.0, **fields):
    error = ErrorSummary(definition="d", mean_m=mean_m)
    return Row(method=FINAL, ape=error, cpu_percent=60.0, map_bytes=60_000_000, tracked_share=tracked_share, **fields)


def sequence(method, number, time_ms):
    found = LocalizationSummary(definition="d", success=time_ms is not None, initial_time_ms=time_ms)
    return SequenceRow(method=method, number=number, length_m=170.0, localization=found)


def test_theirs_over_ours_on_the_sequences_that_both_finished():
    rows = [theirs(), *(Row(method=method, cpu_percent=0.5, map_bytes=1_000_000) for method in OURS)]
    sequences = [
        sequence(METHOD, 1, 3000.0),
        sequence(METHOD, 2, 5000.0),
        sequence(OURS[0], 1, 10.0),
        sequence(OURS[0], 2, None),
        sequence(OURS[0], 3, 1.0),
    ]
    found = ratios(rows, sequences)
    assert found[OURS[0]] == pytest.approx({"mapping_cpu": 120.0, "map_bytes": 60.0, "initial_compute": 300.0})
    assert found[OURS[1]]["initial_compute"] is None


@pytest.mark.parametrize(
    ("row", "cause"),
    [
        (theirs(mean_m=1.4), "APE 1.40 m, not at most 1 m"),
        (theirs(tracked_share=0.7), "70 % of the frames tracked"),
        (Row(method=FINAL, failure="crashed"), "crashed"),
        (Row(method="semi-metric"), "no row"),
    ],
)
def test_no_ratio_to_a_tracker_that_did_not_do_its_work(row, cause):
    assert cause in ratios([row, Row(method=OURS[0], cpu_percent=0.5)], [])["not quoted"]


def test_a_method_of_ours_that_failed_has_no_ratio():
    found = ratios([theirs(), Row(method=OURS[0], failure="no route")], [])
    assert found == {OURS[0]: {"not quoted": "no route"}, OURS[1]: {"not quoted": "no row"}}
    assert ratio_lines(found)[0] == "ORB-SLAM3 over topometric (paper): not quoted, no route"


def test_ratios_in_words():
    found = {"topometric": {"mapping_cpu": 232.9379, "map_bytes": 4.4, "initial_compute": None}}
    assert ratio_lines(found) == ["ORB-SLAM3 over topometric: mapping CPU 233x, map file 4.4x, compute until the first fix -"]
    assert ratio_lines({"not quoted": "crashed"}) == ["ratios to ORB-SLAM3 not quoted: crashed"]


def test_the_spread_of_the_runs_is_in_the_table():
    columns = [column for column in MAPPING_COLUMNS if column.title == "APE of the runs"]
    assert row_cells(columns, theirs(ape_spread_m=[0.312, 0.5])) == ["0.31 to 0.50"]
    runs = [{"run": "run-0", "failure": "crashed"}, {"run": "run-0-again", "failure": None}]
    assert row_cells(columns, theirs(ape_spread_m=[0.3, 0.3], runs=runs)) == ["0.30 to 0.30 (1 of 2 failed)"]
    assert row_cells(columns, Row(method="semi-metric")) == ["-"]
