"""A command that is disturbed, its end, and its rerun: what was wrong with them, in words that begin with the kind of fault."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.families import command_line, kill, session, started_with, with_default_signals
from tests.same_files import differences, extra

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
ASKED_S: Final = 30.0  # a command that was asked to end, and went on for longer than this, did not hear it
COMMANDS: Final = {
    "baselines": ("baselines", "--seconds", "20", "--runs", "1"),
    "cell": ("sweep", "--set", "localizer.mode=coupled"),  # the cheapest, for the suite
    "drive": ("drive", "--missions", "1", "--rows", "truth", "--film", "--policy", "brief_driver:Brief"),  # it ends with 1
    "eval": ("eval",),
    "sweep": ("sweep", "--set", "localizer.mode=coupled,kalman"),
}
USUAL: Final = ("eval", "sweep", "drive")  # of a campaign; some of its kills hit ``baselines`` if ORB-SLAM3 is wanted
POLICY: Final = """\
from hippodrome.core.navigation.types import Command, DrivingState
class Brief:  # it drives off, stops, and says that it has arrived: a false arrival
    steps = 0
    def step(self, observation, radar):
        self.steps += 1
        braking = self.steps > 20
        return Command(-3.0 if braking else 1.0, 0.0, state=DrivingState.ARRIVED if braking else DrivingState.DRIVING)
"""
# A cluster as docs/sweeps.md sets it up, in one process: its address, then the numbers of its workers.
CLUSTER: Final = """
import distributed, sys, time
if __name__ == "__main__":
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None,
                                  silence_logs="CRITICAL") as cluster:
        print(cluster.scheduler_address, *(worker.pid for worker in cluster.workers.values()), flush=True)
        sys.stdin.read()
"""
# Progress without a terminal: all that a command may say beside the sentence with which it ends.
EXPECTED_LINE: Final = re.compile(
    r"^[\w -]+: (\d+ of \d+ done, \d+ s|nothing to do)(; next: \w+)?$|"
    r"^tiny .* mission \d+: |^\d+ missions in \d+ towns; those that are done are kept$"
)
ASKED: Final = re.compile(r"hippodrome: (interrupted|ended by SIG[A-Z]+); what was finished is kept, the same command resumes")


@dataclass(frozen=True)
class Attempt:
    """What is done to a command, and when."""

    command: str
    target: str  # main, worker, all, or dask: one of the cluster's workers
    number: str  # name of the signal
    share: float  # of the time of an undisturbed run, after which it comes


@dataclass(frozen=True)
class Started:
    """A command that runs, and the file to which it complains: a pipe would be held open by those who outlive it."""

    process: subprocess.Popen[bytes]
    complaints: Path

    def said(self) -> str:
        """What it has said so far."""
        return self.complaints.read_text(encoding="utf-8", errors="replace")

    def told(self) -> list[str]:
        """The lines that are no progress."""
        return [line for line in self.said().splitlines() if line.strip() and not EXPECTED_LINE.search(line)]


class Chaos:
    """A folder with the undisturbed results, to which those of disturbed runs are compared."""

    def __init__(self, folder: Path, twice: bool = True) -> None:
        self.folder = folder
        self.mark = f"CHAOS_FOLDER={folder}"  # a variable by which all that a command starts is known, in other sessions, too
        self.twice = twice  # whether two undisturbed runs are compared: what differs there, no disturbed one can be blamed for
        self.scenario = folder / "tiny.yaml"
        self.scenario.write_text(SCENARIO)
        (folder / "brief_driver.py").write_text(POLICY)
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        self.took_s: dict[str, float] = {}
        self.status: dict[str, int | None] = {}  # of undisturbed commands
        self.compared = 0  # files, in all comparisons
        self._count = 0

    def start(self, command: str, out: Path, *more: str, within: Sequence[str] = ()) -> Started:
        """A command in a session of its own, with a folder of its own for temporary files; ``within``: words that run it."""
        usual = ("--workers", "1" if command == "cell" else "2")
        words = [*COMMANDS[command], str(self.scenario), *(more or usual), "--out", str(out)]
        self._count += 1
        complaints = self.folder / f"said-{self._count}.txt"
        with complaints.open("wb") as stream:
            process = subprocess.Popen(
                [*within, sys.executable, "-m", "hippodrome", *words], env=self.environment(), start_new_session=True,
                stdout=subprocess.DEVNULL, stderr=stream, preexec_fn=with_default_signals,
            )  # fmt: skip
        return Started(process, complaints)

    def environment(self) -> dict[str, str]:
        """Variables of a command; compiled modules are kept, as a user's are."""
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        return {**kept, "TMPDIR": str(self.temporary), "PYTHONPATH": path, **dict([self.mark.split("=", 1)])}

    def undisturbed(self, command: str) -> Path:
        """The results of a run that nobody disturbs; made once, after another one, which may have to compile code."""
        first, out = self.folder / f"first-{command}", self.folder / f"whole-{command}"
        if command not in self.took_s:
            for folder in (first, out) if self.twice else (out,):
                began = time.monotonic()
                started = self.start(command, folder)
                status = self.ended(started, SLOWER * LONGEST_S)
                assert status == 0 or (status == 1 and command == "drive"), started.said()
                self.took_s[command], self.status[command] = time.monotonic() - began, status
            if self.twice:
                found = differences(first, out) + extra(first, out)
                assert not found, f"two undisturbed runs of {command} differ: {found}"
        return out

    def ended(self, started: Started, longest_s: float = LONGEST_S) -> int | None:
        """Exit status of the command's own process; None for one that hangs, which is killed with all its session."""
        try:
            return started.process.wait(max(longest_s, SLOWER * max(self.took_s.values(), default=0.0)))
        except subprocess.TimeoutExpired:
            os.killpg(started.process.pid, signal.SIGKILL)
            started.process.wait()
            return None

    def killed(self, name: str, attempt: Attempt) -> list[str] | None:
        """Kill a command and run it again; what was wrong, or None where the signal met nobody, as all was over before."""
        whole, out = self.undisturbed(attempt.command), self.folder / name
        if attempt.target == "dask":
            faults = self._without_a_dask_worker(attempt, out)
        else:
            faults = self._hit(attempt, self.start(attempt.command, out))
        return None if faults is None else faults + self.rerun(attempt.command, whole, out)

    def pair(self, name: str, command: str, delay_s: float) -> list[str]:
        """Two runs of a command in one folder, and a third when both have ended; what was wrong."""
        whole, out = self.undisturbed(command), self.folder / name
        first = self.start(command, out)
        time.sleep(delay_s)
        both = (first, self.start(command, out))
        ends = [(self.ended(one), one) for one in both]
        told = [" / ".join(one.told())[-300:] for one in both]
        faults = [f"traceback: {said}" for (status, one), said in zip(ends, told, strict=True)
                  if "Traceback" in one.said() or status == 70]  # fmt: skip
        faults += ["hang: one of a pair" for status, _ in ends if status is None]
        refused = sum(status == 2 and "another hippodrome command is writing there" in one.said() for status, one in ends)
        good = sum(status == self.status[command] for status, _ in ends)
        if refused + good != 2 or good == 0 or any(len(one.told()) > (status == 2) for status, one in ends):
            faults.append(f"ended: a pair with {[status for status, _ in ends]}: {told}")
        return faults + self.orphans(*(one.process.pid for one in both)) + self.rerun(command, whole, out)

    def rerun(self, command: str, whole: Path, out: Path) -> list[str]:
        """Run a command again in ``out``, of which ``whole`` has the undisturbed results; what was wrong."""
        started = self.start(command, out)
        status = self.ended(started)
        faults = self.orphans(started.process.pid)
        if "Traceback" in started.said() or (status == self.status[command] and started.told()):
            faults.append(f"traceback: the rerun said {' / '.join(started.told())[-300:]}")
        return faults + self.faults_of_rerun(status, started.said(), whole, out, self.status[command])

    def _hit(self, attempt: Attempt, started: Started) -> list[str] | None:
        """Send the signal to the main process, one worker, or all of the command, and wait for its end."""
        process, expected, began = started.process, self.status[attempt.command], time.monotonic()
        moment = began + attempt.share * self.took_s[attempt.command]
        while process.poll() is None and (time.monotonic() < moment or not _targets(process.pid, attempt.target)):
            time.sleep(0.02)
        pids = _targets(process.pid, attempt.target) if process.returncode is None else []
        names = {name for pid in pids for name in _shared_names(pid)}
        for pid in pids:
            kill(pid, attempt.number)
        hit_s, number = time.monotonic(), int(getattr(signal, attempt.number))
        asked = -number if attempt.number == "SIGKILL" else 128 + number
        survives = (expected,) if attempt.command in ("sweep", "cell") else (expected, 2)  # a sweep tries its cell again
        faults = self.faults_of_end(started, survives if attempt.target == "worker" else (expected, asked))
        if attempt.target != "worker" and process.returncode == expected and pids and time.monotonic() - hit_s > ASKED_S:
            faults.append(f"ended: it did not hear the signal and went on for {time.monotonic() - hit_s:.0f} s")
        faults += [f"leftover: {name}" for name in sorted(names) if Path(name).exists()]
        return faults if pids or faults else None

    def _without_a_dask_worker(self, attempt: Attempt, out: Path) -> list[str] | None:
        """Kill one of two workers of a cluster; it starts another one, and the sweep goes on."""
        script = self.folder / "cluster.py"
        script.write_text(CLUSTER)
        own = self.folder / "cluster-tmp"  # what Dask leaves there is its own affair
        own.mkdir(exist_ok=True)
        environment = {**self.environment(), "TMPDIR": str(own)}
        with subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                              stderr=subprocess.DEVNULL, start_new_session=True, env=environment) as cluster:  # fmt: skip
            assert cluster.stdout is not None
            address, *pids = cluster.stdout.readline().split()
            started = self.start(attempt.command, out, "--scheduler", address)
            time.sleep(attempt.share * self.took_s[attempt.command])
            met = started.process.poll() is None and int(pids[0]) in session(cluster.pid)
            kill(int(pids[0]), attempt.number)
            status = self.ended(started)
            cluster.communicate("")
        faults = [] if status == 0 else [f"ended: a sweep that lost a worker with {status}: {started.said()[-300:]}"]
        faults += self.orphans(started.process.pid, cluster.pid)
        return faults if met or faults else None

    def faults_of_end(self, started: Started, ends: tuple[int | None, ...], strict: bool = True) -> list[str]:
        """What is wrong with the end of a command that was disturbed.

        Args:
            started: The command.
            ends: Statuses that it may have.
            strict: It says nothing but the one sentence that goes with its status; otherwise it may name several things.
        """
        status = self.ended(started)
        faults, said, told = self.orphans(started.process.pid), started.said(), started.told()
        if status not in ends:
            how = "hang: the command that was hit" if status is None else f"ended: status {status}, not one of {ends}"
            faults.append(f"{how}: {said[-300:]}")
        if "Traceback" in said or not (_right_words(status, told) if strict else status in (0, 1) or len(told) <= 1):
            faults.append(f"traceback: status {status} with {len(told)} lines: {' / '.join(told)[-400:]}")
        return faults

    def orphans(self, *leaders: int) -> list[str]:
        """The processes that are there ``ORPHAN_S`` after the leaders of their sessions have ended; they are killed."""
        end_s = time.monotonic() + ORPHAN_S
        while (left := self._living(leaders)) and time.monotonic() < end_s:
            time.sleep(0.05)
        words = [command_line(pid).replace(b"\0", b" ").decode(errors="replace")[-80:] for pid in left]
        for pid in left:
            kill(pid, "SIGKILL")
        return [f"orphan: {len(left)} processes after {ORPHAN_S:g} s: {words[:3]}"] if left else []

    def _living(self, leaders: Sequence[int]) -> list[int]:
        """Those of the sessions, also those that have given up their variables on their way out, and all that bear the mark."""
        own = [pid for leader in leaders for pid in session(leader)]
        return sorted({*own, *started_with(self.mark)})

    def faults_of_rerun(self, status: int | None, said: str, whole: Path, out: Path, expected: int | None = 0) -> list[str]:
        """What is wrong with a rerun in ``out``, of which ``whole`` has the undisturbed results."""
        if status != expected:
            return [f"{'hang' if status is None else 'ended'}: the rerun with {status}: {said[-400:]}"]
        self.compared += sum(path.is_file() for path in whole.rglob("*"))
        left = extra(whole, out) + sorted(path.name for path in self.temporary.iterdir())
        return [f"changed: {what}" for what in differences(whole, out)[:3]] + [f"leftover: {name}" for name in left[:3]]


def _targets(leader: int, target: str) -> list[int]:
    """The living processes of a command that a signal is for."""
    pids = session(leader)
    if target == "worker":
        return [pid for pid in pids if pid != leader and b"spawn_main" in command_line(pid)][:1]
    return pids if target == "all" else [pid for pid in pids if pid == leader]


def _shared_names(pid: int) -> set[str]:
    """Files of shared memory, semaphores among them, that a process has in its memory."""
    try:
        return set(re.findall(r"/dev/shm/\S+", Path(f"/proc/{pid}/maps").read_text(encoding="utf-8", errors="replace")))
    except OSError:
        return set()


def _right_words(status: int | None, told: Sequence[str]) -> bool:
    """Whether a command said what goes with its status: a sentence, or nothing where all was well or it was killed."""
    if status is not None and status > 128:
        return len(told) == 1 and ASKED.fullmatch(told[0]) is not None
    if status == 2:
        return len(told) == 1 and told[0].startswith("hippodrome: ")
    return not told
