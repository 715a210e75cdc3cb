"""A tiny town's mission: its figures, what is kept, and the same bytes made anew, beside others, or after a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.eval.drive.foreign import Policy
from hippodrome.eval.drive.run import asked, drive, drive_here
from hippodrome.eval.drive.table import print_table
from hippodrome.eval.gate.baseline import baseline_of
from hippodrome.eval.results.model import Results, read_results, to_json, without_timings

FALLS = """
class Falls:
    def step(self, observation, radar):
        raise ValueError("at the first step")
"""


def mission_file(out, row="truth"):
    (file,) = (out / "hamlet" / "missions").glob(f"{row}-*.json")
    return file


def figures(out):
    return to_json(without_timings(read_results(out / "results.json"))), json.loads(mission_file(out).read_text())["figures"]


def trace(out):
    return np.load(mission_file(out).with_suffix(".npz"))["trace"]


@pytest.fixture(scope="module")
def driven(hamlet, tmp_path_factory):
    """A mission that was driven undisturbed."""
    request = hamlet.request(tmp_path_factory.mktemp("driven") / "out")
    assert drive(request)
    return request


def test_a_mission_is_driven_and_kept(driven, capsys):
    out = driven.out
    results = json.loads((out / "results.json").read_text())
    row = results["scenarios"][0]["rows"][0]["drive"]
    assert row["missions"] == 1 and row["realtime_factor"] > 0.0 and row["row"] == "truth"
    assert {"seed", "start", "goal", "end", "cause"} <= set(row["missions_detail"][0])
    assert row["missions_detail"][0]["cause"] == "arrived", row["missions_detail"][0]
    assert row["false_arrivals"] == 0 and row["wrong_way"] == 0
    assert "<svg" in (out / "drive.html").read_text()
    assert baseline_of([read_results(out / "results.json")]).cells[0].figures["missed (share)"].value == 0.0
    written = mission_file(out).stat().st_mtime_ns
    drive(driven)
    assert mission_file(out).stat().st_mtime_ns == written and "hamlet" in capsys.readouterr().out


def test_a_mission_that_was_killed_is_made_anew_beside_others_and_filmed_with_the_same_bytes(hamlet, driven, tmp_path):
    killed = hamlet.request(tmp_path / "killed")
    command = [sys.executable, "-m", "hippodrome.eval.cli", "drive", str(hamlet.file), "--missions", "1", "--rows", "truth",
               "--workers", "1", "--out", str(killed.out)]  # fmt: skip
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if line.startswith("1 missions"):  # the map is there, and the mission begins
            break
    time.sleep(4.0)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        drive(replace(killed, film="webp"))
    finally:
        busy.kill()
        busy.wait()
    assert mission_file(killed.out).with_suffix(".webp").stat().st_size > 10_000
    assert figures(killed.out) == figures(driven.out)
    assert np.array_equal(trace(killed.out), trace(driven.out), equal_nan=True)


def test_a_policy_that_falls_has_a_row_with_its_cause(hamlet, tmp_path, monkeypatch, capsys):
    (tmp_path / "falling.py").write_text(FALLS)
    monkeypatch.chdir(tmp_path)
    request = hamlet.request(tmp_path / "out", rows=[], policies=[Policy("mine", "falling:Falls")])
    result = drive_here(asked(hamlet.scenario, request), request.out)  # as a cell of a sweep does, in this process
    print_table(Results(scenarios=(result,)))
    (row,) = result.rows
    assert row.method == "mine" and "ValueError: at the first step" in row.failure and row.failure.startswith("1 of 1 missions")
    assert row.declaration.source == "falling:Falls" and row.drive["success_rate"] == 0.0
    assert "the policy failed" in row.drive["missions_detail"][0]["cause"] and "ValueError" in capsys.readouterr().out
    assert not list((request.out / "hamlet/missions").glob("*.json"))  # it is driven anew by the next command
