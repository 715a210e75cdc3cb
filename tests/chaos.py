"""Commands that are killed or meet a fault of the machine, and pairs of them in one folder: ``make chaos``.

Each kill has a number, which with the seed says what is hit, by which signal and when. The same command then runs once more: it
has to end well, with the same results as a run that nobody disturbed, and nothing may be left: no process after ``ORPHAN_S``, no
temporary folder, no unfinished file.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.same.folders import compare_folders
from tests.families import command_line, kill, session, started_with, with_default_signals

SCENARIO: Final = """\
name: tiny
town: {kind: grid, width_m: 150, height_m: 150, road_km: 0.8}
camera: {width: 32, height: 24, supersample: 1, rate_hz: 2}
odometry_rate_hz: 4
mapping: {tour: {length_m: 400}, traffic: {vehicles: 1}}
localization: {tour: {length_m: 120}, traffic: {vehicles: 0}}
"""
LONGEST_S: Final = 240  # of a command: one that takes longer hangs, unless an undisturbed one takes a sixth of its time, too
SLOWER: Final = 6  # times that a command may take of an undisturbed one, as others may use the machine
ORPHAN_S: Final = 5.0  # after this no process of a command that ended is there any more
ENDS: Final = {"main": (2, 129, 130, 143, -9), "worker": (0, 1, 2), "all": (2, 129, 130, 143, -9, -15, -1, -2)}
SIGNALS: Final = ("SIGTERM", "SIGHUP", "SIGINT", "SIGKILL")
COMMANDS: Final = {
    "baselines": ("baselines", "--seconds", "20", "--runs", "1"),
    "cell": ("sweep", "--set", "localizer.mode=coupled"),  # the cheapest, for the suite
    "drive": (
        "drive",
        "--missions",
        "1",
        "--rows",
        "truth",
        "--film",
        "--policy",
        "brief_driver:Brief",
    ),  # it ends with 1: a false arrival
    "eval": ("eval",),
    "sweep": ("sweep", "--set", "localizer.mode=coupled,kalman"),
}
POLICY: Final = """\
from hippodrome.core.navigation.types import Command, DrivingState
class Brief:  # it drives off, stops, and says that it has arrived: a false arrival
    steps = 0
    def step(self, observation, radar):
        self.steps += 1
        braking = self.steps > 20
        return Command(-3.0 if braking else 1.0, 0.0, state=DrivingState.ARRIVED if braking else DrivingState.DRIVING)
"""
USUAL: Final = ("eval", "sweep", "drive")  # of a campaign; a share of its kills hits ``baselines`` where ORB-SLAM3 is installed
# A cluster as docs/sweeps.md sets it up, in one process: its address, then the numbers of its workers.
CLUSTER: Final = """
import distributed, sys, time
if __name__ == "__main__":
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None,
                                  silence_logs="CRITICAL") as cluster:
        print(cluster.scheduler_address, *(worker.pid for worker in cluster.workers.values()), flush=True)
        sys.stdin.read()
"""
# Progress without a terminal, and what Python says when it cleans up after a killed main process.
EXPECTED_LINE = re.compile(
    r"^[\w -]+: (\d+ of \d+ done, \d+ s|nothing to do)(; next: \w+)?$|resource_tracker|"
    r"^tiny .* mission \d+: |^\d+ missions in \d+ towns; those that are done are kept$"
)


@dataclass(frozen=True)
class Attempt:
    """What is done to a command, and when."""

    command: str
    target: str  # main, worker, all, or dask: one of the cluster's workers
    number: str  # name of the signal
    share: float  # of the time of an undisturbed run, after which it comes


def attempt_of(seed: int, number: int, dask: bool, baselines: bool = False) -> Attempt:
    """The attempt of this number; the same for the same seed. Each sixth one is of ``baselines``, if that is wanted."""
    rng = np.random.default_rng([seed, number])
    targets, shares = (("main", "worker", "all", "dask"), (0.4, 0.3, 0.2, 0.1)) if dask else (("main", "worker", "all"), None)
    target = str(rng.choice(targets, p=shares))
    command = "sweep" if target == "dask" else str(rng.choice(USUAL))
    if baselines and number % 6 == 5 and target != "dask":
        command = "baselines"
    kinds = ("SIGTERM", "SIGKILL") if target == "dask" else SIGNALS
    return Attempt(command, target, str(rng.choice(kinds)), float(rng.uniform(0.05, 1.0)))


class Chaos:
    """A folder with the undisturbed results, to which those of disturbed runs are compared."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scenario = folder / "tiny.yaml"
        self.scenario.write_text(SCENARIO)
        (folder / "brief_driver.py").write_text(POLICY)
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        self.took_s: dict[str, float] = {}
        self.status: dict[str, int | None] = {}  # of undisturbed commands

    def start(self, command: str, out: Path, *more: str, within: Sequence[str] = ()) -> subprocess.Popen[str]:
        """A command in a session of its own, with a folder of its own for temporary files; ``within``: words that run it."""
        usual = ("--workers", "1" if command == "cell" else "2")
        words = [*COMMANDS[command], str(self.scenario), *(more or usual), "--out", str(out)]
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "TMPDIR": str(self.temporary), "PYTHONPATH": path}
        words = [*within, sys.executable, "-m", "hippodrome.eval.cli", *words]
        return subprocess.Popen(words, env=environment, start_new_session=True, stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True, preexec_fn=with_default_signals)  # fmt: skip

    def undisturbed(self, command: str) -> Path:
        """The results of a run that nobody disturbs; made once."""
        out = self.folder / f"whole-{command}"
        if command not in self.took_s:
            began = time.monotonic()
            status, said = self.ended(self.start(command, out), SLOWER * LONGEST_S)
            assert status == 0 or (status == 1 and command == "drive"), said
            self.status[command] = status
            self.took_s[command] = time.monotonic() - began
        return out

    def ended(self, process: subprocess.Popen[str], longest_s: float = LONGEST_S) -> tuple[int | None, str]:
        """Exit status and complaints; None for one that hangs, which is killed with all its session."""
        try:
            said = process.communicate(timeout=max(longest_s, SLOWER * max(self.took_s.values(), default=0.0)))[1]
            return process.returncode, said
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, ""

    def killed(self, name: str, attempt: Attempt) -> list[str]:
        """Kill a command and run it again; what was wrong, in words that begin with its kind."""
        whole, out = self.undisturbed(attempt.command), self.folder / name
        began = time.monotonic()
        if attempt.target == "dask":
            faults = self._without_a_dask_worker(attempt, out)
        else:
            process = self.start(attempt.command, out)
            while time.monotonic() - began < attempt.share * self.took_s[attempt.command] and process.poll() is None:
                time.sleep(0.02)
            _hit(process, attempt)
            faults = self.faults_of_end(process, (*ENDS[attempt.target], self.status[attempt.command]))
        status, said = self.ended(self.start(attempt.command, out))
        return faults + self.faults_of_rerun(status, said, whole, out, self.status[attempt.command])

    def pair(self, name: str, command: str, delay_s: float) -> list[str]:
        """Two runs of a command in one folder, and a third when both have ended; what was wrong."""
        whole, out = self.undisturbed(command), self.folder / name
        first = self.start(command, out)
        time.sleep(delay_s)
        ends = [self.ended(process) for process in (first, self.start(command, out))]
        faults = [f"traceback: {said[-300:]}" for status, said in ends if "Traceback" in said or status == 70]
        faults += ["hang: one of a pair" for status, _ in ends if status is None]
        refused = [said for status, said in ends if status == 2 and "another hippodrome command is writing there" in said]
        if len(refused) + sum(status == self.status[command] for status, _ in ends) != 2 or len(refused) == 2:
            faults.append(f"ended: a pair with {[status for status, _ in ends]}: {' / '.join(said[-200:] for _, said in ends)}")
        status, said = self.ended(self.start(command, out))
        return faults + self.faults_of_rerun(status, said, whole, out, self.status[command])

    def _without_a_dask_worker(self, attempt: Attempt, out: Path) -> list[str]:
        """Kill one of two workers of a cluster; it starts another one, and the sweep goes on."""
        script = self.folder / "cluster.py"
        script.write_text(CLUSTER)
        with subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                              stderr=subprocess.DEVNULL, start_new_session=True) as cluster:  # fmt: skip
            assert cluster.stdout is not None
            address, *pids = cluster.stdout.readline().split()
            process = self.start(attempt.command, out, "--scheduler", address)
            time.sleep(attempt.share * self.took_s[attempt.command])
            kill(int(pids[0]), attempt.number)
            status, said = self.ended(process)
            cluster.communicate("")
        return [] if status == 0 else [f"ended: a sweep that lost a worker with {status}: {said[-300:]}"]

    def faults_of_end(self, process: subprocess.Popen[str], ends: tuple[int | None, ...]) -> list[str]:
        """What is wrong with the end of a command that was disturbed; ``ends``: statuses that it may have beside 0."""
        status, said = self.ended(process)
        how = "hang: the command that was hit" if status is None else f"ended: status {status}: {said[-300:]}"
        faults = [] if status in (0, *ends) else [how]
        lines = [line for line in said.strip().splitlines() if not EXPECTED_LINE.search(line)]
        if "Traceback" in said or (status not in (0, 1) and len(lines) > 1):
            faults.append(f"traceback: {said[-400:]}")
        end_s = time.monotonic() + ORPHAN_S
        while (left := session(process.pid) + started_with(f"TMPDIR={self.temporary}")) and time.monotonic() < end_s:
            time.sleep(0.05)
        for pid in left:
            kill(pid, "SIGKILL")
        return faults + ([f"orphan: {len(left)} processes after {ORPHAN_S:g} s"] if left else [])

    def faults_of_rerun(self, status: int | None, said: str, whole: Path, out: Path, expected: int | None = 0) -> list[str]:
        """What is wrong with a rerun in ``out``, of which ``whole`` has the undisturbed results."""
        if status != expected:
            return [f"{'hang' if status is None else 'ended'}: the rerun with {status}: {said[-400:]}"]
        tallies = compare_folders(whole, out)
        differing = {kind: tally for kind, tally in tallies.items() if tally.differing}
        faults = [f"changed: {tally.differing} values of {kind}: {tally.differences[:1]}" for kind, tally in differing.items()]
        there = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
        lost = {path.relative_to(whole).as_posix() for path in whole.rglob("*") if path.is_file()} - there
        left = sorted(name for name in there if name.endswith(".part")) + sorted(path.name for path in self.temporary.iterdir())
        return faults + [f"changed: {name} is lost" for name in sorted(lost)[:3]] + [f"leftover: {name}" for name in left[:3]]


def _hit(process: subprocess.Popen[str], attempt: Attempt) -> None:
    """Send the signal to the main process, one worker, or all processes of the command."""
    pids = {"main": [process.pid], "all": session(process.pid)}.get(attempt.target)
    if pids is None:
        workers = [pid for pid in session(process.pid) if pid != process.pid and b"spawn_main" in command_line(pid)]
        pids = workers[:1]
    for pid in pids:
        kill(pid, attempt.number)


def campaign(
    folder: Path, kills: int, pairs: int, seed: int, most_s: float, dask: bool, baselines: bool, faults: int = 0
) -> list[tuple[str, list[str]]]:
    """What was done, and what was wrong each time; less where ``most_s`` are over before."""
    from tests.machine_faults import fault_of, suffered

    chaos, found, end_s = Chaos(folder), list[tuple[str, list[str]]](), time.monotonic() + most_s
    rng = np.random.default_rng([seed, 1])
    plans = [(f"kill-{number}", attempt_of(seed, number, dask, baselines)) for number in range(kills)]
    for name, attempt in plans:
        if time.monotonic() > end_s:
            return found
        what = f"{name}: {attempt.command}, {attempt.number} to {attempt.target} at {attempt.share:.0%}"
        found.append((what, chaos.killed(name, attempt)))
        print(what, *found[-1][1] or ["ok"], sep="\n  ", flush=True)
    for number in range(faults):
        if time.monotonic() > end_s:
            return found
        fault = fault_of(seed, number)
        what = f"fault-{number}: {fault.command}, {fault.kind} at {fault.share:.0%}"
        found.append((what, suffered(chaos, f"fault-{number}", fault)))
        print(what, *found[-1][1] or ["ok"], sep="\n  ", flush=True)
    for number in range(pairs):
        if time.monotonic() > end_s:
            return found
        command, delay_s = USUAL[number % 2], float(rng.uniform(0.0, 6.0))
        what = f"pair-{number}: two of {command}, {delay_s:.1f} s apart"
        found.append((what, chaos.pair(f"pair-{number}", command, delay_s)))
        print(what, *found[-1][1] or ["ok"], sep="\n  ", flush=True)
    return found


def _main() -> int:
    from tests.machine_faults import can_mount

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20, help="how many commands are killed (default: 20)")
    parser.add_argument("--pairs", type=int, default=4, help="how many pairs run in one folder (default: 4)")
    parser.add_argument("--faults", type=int, default=5, help="how many runs meet a fault of the machine (default: 5)")
    parser.add_argument("--seed", type=int, default=0, help="of what is hit, by what, and when (default: 0)")
    parser.add_argument(
        "--baselines", action="store_true", help="hit the command that runs ORB-SLAM3, too; installs it if need be"
    )
    parser.add_argument("--seconds", type=float, default=3600.0, help="after these nothing new is begun (default: 3600)")
    options = parser.parse_args()
    try:
        import distributed  # noqa: F401

        dask = True
    except ImportError:
        dask = False
        print("no kill of a Dask worker: pip install 'hippodrome[dask]'")
    if not (mounts := can_mount()) and options.faults:
        print("no fault of the machine: this system lets nobody but root mount a file system")
    print(f"{options.kills} kills, {options.faults} faults of the machine and {options.pairs} pairs, seed {options.seed}; "
          f"limits: {LONGEST_S} s a command, {options.seconds:g} s in all", flush=True)  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        found = campaign(Path(folder), options.kills, options.pairs, options.seed, options.seconds, dask,
                         options.baselines, options.faults if mounts else 0)  # fmt: skip
    counts = Counter(fault.partition(":")[0] for _, faults in found for fault in faults)
    kinds = {"traceback": "tracebacks", "hang": "hangs", "orphan": "with orphans", "leftover": "leftovers",
             "changed": "lost or changed", "ended": "ended otherwise"}  # fmt: skip
    print(f"{len(found)} disturbed runs, seed {options.seed}: {sum(bool(faults) for _, faults in found)} fell; "
          + ", ".join(f"{counts[kind]} {words}" for kind, words in kinds.items()))  # fmt: skip
    return 1 if counts else 0


if __name__ == "__main__":
    sys.exit(_main())
