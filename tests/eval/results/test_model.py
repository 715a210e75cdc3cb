import json

import numpy as np
import pytest

from hippodrome.core.types import Trajectory
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.results.model import (
    LocalizationSummary,
    Network,
    Results,
    ResultsError,
    Row,
    ScenarioResult,
    read_results,
    summarize,
    to_json,
    without_timings,
    write_results,
)
from hippodrome.eval.results.paper_rows import quoted_rows

CONTRACT = {"name", "seed", "network", "noise", "frames", "duration_s", "rows"}
ROW_CONTRACT = {"method", "ape", "rpe", "cpu_percent", "map_bytes", "vertices", "edges", "localization"}
ERROR_CONTRACT = {"mean_m", "median_m", "p95_m", "max_m", "count", "definition"}
LOCALIZATION_CONTRACT = {"success", "error_mean_m", "initial_time_ms", "initial_distance_m", "false_fixes"}


def results(cpu_percent=0.5, **extra):
    t_s = np.arange(5.0) / 10.0
    reference = Trajectory(t_s, np.zeros((5, 3)))
    score = summarize(ape(Trajectory(t_s, np.full((5, 3), 1.0 / 3.0)), reference))
    localization = LocalizationSummary(definition="x", success=True, initial_time_ms=3.0 * cpu_percent, false_fixes=0)
    row = Row(method="topometric", ape=score, rpe=score, cpu_percent=cpu_percent, localization=localization, **extra)
    failed = Row(method="ORB-SLAM3 (live)", failure="not installed")
    scenario = ScenarioResult(
        name="rural", seed=1, network=Network(generator="rural", edges=3, km=7.2), noise="paper", frames=9, duration_s=1.5,
        rows=(row, failed, *quoted_rows()), timings={"mapping_s": cpu_percent},
    )  # fmt: skip
    return Results(scenarios=(scenario,))


def test_the_file_keeps_the_contract(tmp_path):
    write_results(tmp_path / "results.json", results())
    (scenario,) = json.loads((tmp_path / "results.json").read_text())["scenarios"]
    assert scenario.keys() >= CONTRACT
    assert scenario["network"].keys() >= {"path", "generator", "edges", "km"}
    assert all(row.keys() >= ROW_CONTRACT for row in scenario["rows"])
    assert scenario["rows"][0]["ape"].keys() >= ERROR_CONTRACT
    assert scenario["rows"][0]["localization"].keys() >= LOCALIZATION_CONTRACT
    assert [row["quoted"] for row in scenario["rows"]] == [False, False, True, True, True]
    assert scenario["rows"][0]["ape"]["mean_m"] == 0.471405
    assert scenario["rows"][1]["failure"] == "not installed"


def test_reading_gives_back_what_was_written_extra_fields_included(tmp_path):
    path = tmp_path / "results.json"
    write_results(path, results(closures={"precision": 0.5}))
    again = read_results(path)
    write_results(tmp_path / "again.json", again)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert again.scenarios[0].rows[0].model_extra["closures"] == {"precision": 0.5}


def test_without_timings_only_the_seed_counts():
    slow, fast = results(cpu_percent=9.0), results(cpu_percent=0.1)
    assert to_json(without_timings(slow)) == to_json(without_timings(fast))
    assert to_json(slow.model_dump()) != to_json(fast.model_dump())
    text = to_json(without_timings(slow))
    assert not any(name in text for name in ("cpu_percent", "initial_time_ms", "timings"))
    assert "false_fixes" in text


def test_keys_are_sorted_and_minus_zero_is_zero():
    assert to_json({"b": -0.0, "a": -1e-9}) == '{\n  "a": 0.0,\n  "b": 0.0\n}\n'


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_no_nan_is_written(tmp_path, value):
    path = tmp_path / "results.json"
    path.write_text("before")
    with pytest.raises(ResultsError, match=r"results\.json: cannot be written as JSON"):
        write_results(path, results(closures={"precision": value}))
    assert path.read_text() == "before"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "not a readable results file"),
        ("[" * 100_000, "not a readable results file"),
        ("[]", "top level: takes keys of its own"),
        ("{}", "scenarios: must be given"),
        ('{"scenarios": [{"name": "a"}]}', r"scenarios\.0\.seed: must be given"),
        ('{"scenarios": 3}', "scenarios: "),
    ],
)
def test_bad_files_are_named_with_field_and_reason(tmp_path, text, complaint):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(ResultsError, match=rf"bad\.json: {complaint}"):
        read_results(path)


@pytest.mark.parametrize("below", ["results.json", "file/results.json"])
def test_where_no_results_are_the_answer_says_so_in_words(tmp_path, below):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match=r"results\.json: no results there; name the folder that a command had") as told:
        read_results(tmp_path / below)
    assert "Errno" not in str(told.value)


def test_a_nan_in_a_file_is_refused(tmp_path):
    path = tmp_path / "results.json"
    write_results(path, results())
    path.write_text(path.read_text().replace('"duration_s": 1.5', '"duration_s": NaN'))
    with pytest.raises(ResultsError, match=r"scenarios\.0\.duration_s: must be a finite number"):
        read_results(path)


def test_quoted_rows_are_the_papers_cells_and_their_means():
    semi_metric, orb_slam, topometric = quoted_rows()
    assert (semi_metric.ape.mean_m, semi_metric.rpe.mean_m, semi_metric.map_bytes) == (121.2, 9.4, 56_100_000)
    assert (orb_slam.cpu_percent, orb_slam.keyframes, orb_slam.ape.mean_m) == (40.57, 715, 3.86)
    assert (topometric.vertices, topometric.edges, topometric.ape.mean_m) == (1417, 1567, 3.6)
    assert topometric.localization.error_mean_m == pytest.approx(4.341)
    assert topometric.localization.initial_time_ms == pytest.approx(0.553)
    assert orb_slam.localization.error_mean_m == pytest.approx(4.632)
    assert orb_slam.localization.initial_time_ms == pytest.approx(1030.9)
