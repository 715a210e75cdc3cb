"""A tiny town's mission: its figures, what is kept, and the same bytes made anew, beside others, or after a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from hippodrome.eval.drive.foreign import Policy
from hippodrome.eval.drive.run import drive
from hippodrome.eval.gate.baseline import baseline_of
from hippodrome.eval.results.model import read_results, to_json, without_timings

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


def test_a_mission_is_driven_kept_and_made_anew_with_the_same_bytes(hamlet, tmp_path, capsys):
    request = hamlet.request(tmp_path / "out")
    assert drive(request)
    assert "hamlet" in capsys.readouterr().out
    out = request.out
    results = json.loads((out / "results.json").read_text())
    row = results["scenarios"][0]["rows"][0]["drive"]
    assert row["missions"] == 1 and row["realtime_factor"] > 0.0 and row["row"] == "truth"
    assert {"seed", "start", "goal", "end", "cause"} <= set(row["missions_detail"][0])
    assert row["missions_detail"][0]["cause"] == "arrived", row["missions_detail"][0]
    assert row["false_arrivals"] == 0 and row["wrong_way"] == 0
    assert "<svg" in (out / "drive.html").read_text()
    assert baseline_of([read_results(out / "results.json")]).cells[0].figures["missed (share)"].value == 0.0
    first, driven, written = figures(out), trace(out), mission_file(out).stat().st_mtime_ns
    drive(request)
    assert mission_file(out).stat().st_mtime_ns == written
    mission_file(out).unlink()
    drive(replace(request, film="webp"))
    assert mission_file(out).with_suffix(".webp").stat().st_size > 10_000
    assert figures(out) == first and np.array_equal(trace(out), driven, equal_nan=True)


def test_a_mission_that_was_killed_and_one_beside_others_have_the_same_bytes(hamlet, tmp_path):
    alone = hamlet.request(tmp_path / "alone")
    drive(alone)
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
        drive(replace(killed, workers=2))
    finally:
        busy.kill()
        busy.wait()
    assert (
        without_timings(read_results(alone.out / "results.json"))["scenarios"][0]["rows"][0]
        == json.loads(to_json(without_timings(read_results(killed.out / "results.json"))))["scenarios"][0]["rows"][0]
    )
    assert np.array_equal(trace(alone.out), trace(killed.out), equal_nan=True)


def test_a_policy_that_falls_has_a_row_with_its_cause(hamlet, tmp_path, monkeypatch, capsys):
    (tmp_path / "falling.py").write_text(FALLS)
    monkeypatch.chdir(tmp_path)
    request = hamlet.request(tmp_path / "out", rows=[], policies=[Policy("mine", "falling:Falls")])
    drive(request)
    (row,) = read_results(request.out / "results.json").scenarios[0].rows
    assert row.method == "mine" and "ValueError: at the first step" in row.failure and row.failure.startswith("1 of 1 missions")
    assert row.declaration.source == "falling:Falls" and row.drive["success_rate"] == 0.0
    assert "the policy failed" in row.drive["missions_detail"][0]["cause"] and "ValueError" in capsys.readouterr().out
    assert not list((request.out / "hamlet/missions").glob("*.json"))  # it is driven anew by the next command
