"""Killed at any moment, nothing finished is lost, nothing half-written is taken for whole, and the same command resumes."""

import os
import signal
import subprocess
import sys
import time

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import DONE


def recorded_bytes(out):
    return {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file() and "recordings" in path.parts}


def test_a_killed_run_resumes_to_the_same_bytes(run, tmp_path):
    command = [sys.executable, "-m", "hippodrome.eval.cli", "render", str(run.scenario), "--workers", "1", "--out", str(tmp_path)]
    process = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while not list(tmp_path.rglob("frames-0000.zip")) and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not list(tmp_path.rglob("manifest.json"))
    finished = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("frames-*.zip")}
    assert finished

    assert main(["render", str(run.scenario), "--workers", "1", "--out", str(tmp_path)]) == DONE
    for path, modified_ns in finished.items():
        assert path.stat().st_mtime_ns == modified_ns
    assert recorded_bytes(tmp_path) == recorded_bytes(run.out)
