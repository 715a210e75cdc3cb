"""The report holds Table II, the ratios and what each method is given; broken files are named."""

import json

import pytest

from hippodrome.eval.methods.method import ORBSLAM3_FINAL, ORBSLAM3_LIVE
from hippodrome.eval.report.report import report_html
from hippodrome.eval.results.fairness import GIVEN, fairness_rows
from hippodrome.eval.results.model import (
    Declaration,
    Network,
    Results,
    ResultsError,
    Row,
    ScenarioResult,
)
from hippodrome.eval.results.table_two import SequenceRow, write_table_two

TRACKED = (Row(method=method.label, failure="hung") for method in (ORBSLAM3_LIVE, ORBSLAM3_FINAL))
ROWS = (Row(method="topometric", cpu_percent=0.5), *TRACKED)


@pytest.fixture
def results(tmp_path):
    (tmp_path / "town").mkdir()
    network = Network(generator="grid", edges=8, km=0.9)
    return Results(
        scenarios=(ScenarioResult(name="town", seed=1, network=network, noise="p", frames=9, duration_s=9.0, rows=ROWS),)
    )


def test_table_two_and_ratios_are_on_the_page(results, tmp_path):
    write_table_two(tmp_path, "town", [SequenceRow(method="ORB-SLAM3", number=4, length_m=732.6, failure="lost: 3 of 40 frames")])
    (tmp_path / "town" / "ratios.json").write_text(json.dumps({"topometric": {"mapping_cpu": 123.4, "map_bytes": 5.26}}))
    page = report_html(results, tmp_path)
    assert "ORB-SLAM3, sequence 4: lost: 3 of 40 frames" in page
    assert "1077" in page  # the published table beneath
    assert "123x" in page
    assert "5.3x" in page


def test_ratios_that_are_not_quoted_say_why(results, tmp_path):
    (tmp_path / "town" / "ratios.json").write_text(json.dumps({"not quoted": "APE 3.20 m"}))
    assert "Not quoted: APE 3.20 m" in report_html(results, tmp_path)


def test_a_broken_table_is_named(results, tmp_path):
    (tmp_path / "town" / "table2.json").write_text('[{"number": "four"}]')
    with pytest.raises(ResultsError, match=r"table2\.json"):
        report_html(results, tmp_path)


def test_what_each_method_is_given_is_said_once(results, tmp_path):
    assert [line[0] for line in fairness_rows(ROWS)] == ["topometric", "ORB-SLAM3"]
    assert report_html(results, tmp_path).count(GIVEN["ORB-SLAM3"][0]) == 1


def test_a_method_that_is_not_ours_says_itself_what_it_is_given():
    said = Declaration(frame="metric", given="self-motion, the road network", source="exec:./run", isolated=True)
    (line,) = fairness_rows([Row(method="theirs", failure="crashed", declaration=said)])
    assert line[:3] == ["theirs", "self-motion, the road network", "best rigid fit, SE(2)"]
    assert line[3].startswith("a process of its own, with nothing of the truth")
