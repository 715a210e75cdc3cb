"""A foreign program in a process of its own: limits of time and memory, and what it took of both."""

from __future__ import annotations

import contextlib
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, BinaryIO, Final

from hippodrome._processes import dying_with_me
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.containment import DEPTH, can_contain, contained
from hippodrome.eval.programs.disk import Disk
from hippodrome.eval.programs.family import descendant, family, holds_pipe, peak_bytes, processes
from hippodrome.eval.programs.limits import Limits, limit
from hippodrome.eval.programs.references import printable

POLL_S: Final = 0.05  # between two looks at a process: its memory is looked at as well
FIRST_POLL_S: Final = 0.001  # between the first ones: what ends at once has its memory looked at, too
TEMPORARY: Final = "temporary"  # folder in its own one for files that it makes where TMPDIR says
LAST_WORDS: Final = 300  # characters of what a program printed last that an error quotes
LEAST_WORK: Final = 0.02  # share of a core: a program that uses less of one for longer than its limit has stalled
# Signals by which a program ends through a fault of its own. Not SIGKILL, by which the system ends it for want of memory.
OWN_FAULTS: Final = {signal.SIGABRT, signal.SIGSEGV, signal.SIGFPE, signal.SIGBUS, signal.SIGILL}
SHELL_SIGNAL: Final = 128  # a shell's status for a command that a signal ended is this and the signal's number
# What a shell says by these statuses.
NOT_RUN: Final = {
    126: " (something that it runs may not be run: chmod +x it)",
    127: " (something that it runs is not there: a program, or the interpreter that its first line names)",
}
# Words that mean something to a shell alone.
OF_SHELLS: Final = frozenset({"|", "||", "&&", "&", ";", ">", ">>", "<", "2>", "2>&1", "1>", "&>"})
CPU_CLOCK: Final = 2  # Linux: the low bits of the number of a process's clock of CPU time, all its threads together


class ProgramEnded(MethodError):
    """A program that did not end well. ``own_fault``: it crashed or stalled, which another run of it need not."""

    own_fault = False


@dataclass(slots=True)
class Process:
    """A running program. ``wait`` ends it; how it ended and what it took is known from then on."""

    popen: subprocess.Popen[bytes]
    limits: Limits
    log: Path  # what it prints, on standard error at least
    disk: Disk  # what it keeps
    began_s: float = field(default_factory=time.monotonic)
    cpu_s: float = 0.0  # user and system time of it and of the processes that it waited for
    peak_rss_bytes: int | None = None  # None: it ended before it was seen
    status: int | None = None
    stopped: str | None = None  # why it was stopped, if it was
    stalled: bool = False  # whether it was stopped because it did no work
    contained: bool = False  # whether it runs in namespaces, as a grandchild of the process that was started
    program: int | None = None  # number of its process, once that is known
    marked: tuple[float, float] | None = None  # when its work was looked at last, and the CPU time that it had taken by then

    @property
    def left_s(self) -> float:
        """Time that it has left."""
        return self.began_s + self.limits.time_s - time.monotonic()

    def poll(self) -> bool:
        """Whether it has ended; it is stopped here if it is past a limit."""
        if self.status is not None:
            return True
        pid, status, usage = os.wait4(self.popen.pid, os.WNOHANG)
        if pid == 0:
            if self.left_s <= 0.0:
                self.stop(f"hung: no end after {self.limits.time_s:g} s, its limit")
            elif (held := self.look()) > self.limits.memory_bytes:
                self.stop(f"took {held / 1e6:.0f} MB of memory, more than its limit of {self.limits.memory_bytes / 1e6:.0f} MB")
            elif self.disk.is_due() and (cause := self._keeps_too_much(family(self.popen.pid, processes()))) is not None:
                self.stop(cause)
            elif self.limits.stall_s is not None and self._stalls(self.limits.stall_s):
                self.stalled = True
                self.stop(f"hung: no work for {self.limits.stall_s:g} s")
            return self.status is not None
        self._ended(status, usage)
        self.stopped = self._keeps_too_much()
        return True

    def cpu_now_s(self) -> float:
        """CPU time that it has taken so far, all its threads; the processes that it started are not counted until they end."""
        if self.program is None:
            self.program = descendant(self.popen.pid, DEPTH) if self.contained else self.popen.pid
        try:
            return 0.0 if self.program is None else time.clock_gettime((~self.program << 3) | CPU_CLOCK)
        except OSError:  # it has just ended
            return self.cpu_s

    def _stalls(self, limit_s: float) -> bool:
        """Whether it has done no work for longer than ``limit_s``."""
        now_s, cpu_s = time.monotonic(), self.cpu_now_s()
        if self.marked is None or cpu_s - self.marked[1] > LEAST_WORK * limit_s:
            self.marked = now_s, cpu_s
        return now_s - self.marked[0] > limit_s

    def look(self) -> int:
        """Memory [bytes] that it and its family hold together now; the most that one of them held is remembered.

        The kernel's figure for a process that has ended (``ru_maxrss``) begins with the memory of the one that started it.
        """
        held, running = 0, processes()
        for pid in family(self.popen.pid, running):
            held += running[pid].held_bytes
            if self.contained and self.popen.pid in (pid, running[pid].parent):
                continue  # the process that was started and its shell lead to the program and are not part of it
            if (peak := peak_bytes(pid)) > 0:
                self.peak_rss_bytes = max(peak, self.peak_rss_bytes or 0)
        return held

    def has_let_go(self, end: int) -> bool:
        """Whether the program closed its side of the pipe ``end`` and runs on. Without namespaces the pipe itself says so."""
        return self.contained and not self.poll() and not holds_pipe(self.popen.pid, end)

    def _keeps_too_much(self, pids: Iterable[int] = ()) -> str | None:
        """What is to be said where it, or what it left, takes more of the disk than it may; None where it does not."""
        limit, kept = self.disk.limit_bytes, self.disk.kept_bytes(pids)
        if kept <= limit:
            return None
        return f"kept {kept / 1e6:.0f} MB on disk, more than its limit of {limit / 1e6:.0f} MB, disk_limit_mb"

    def stop(self, cause: str) -> None:
        """End it and its family, and remember why."""
        if self.status is None:
            self.stopped = cause
            for pid in family(self.popen.pid, processes()):
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.popen.pid, signal.SIGKILL)
            _, status, usage = os.wait4(self.popen.pid, 0)
            self._ended(status, usage)

    def wait(self) -> None:
        """Until it ends by itself or is past a limit. Raises ProgramEnded unless it ended well."""
        pause_s = FIRST_POLL_S
        while not self.poll():
            time.sleep(pause_s)
            pause_s = min(2.0 * pause_s, POLL_S)
        if (cause := self.failure()) is not None:
            raise self.error(cause)

    def error(self, cause: str) -> ProgramEnded:
        """What is raised of a program that did not end well."""
        error = ProgramEnded(cause)
        error.own_fault = self.stalled or (self.stopped is None and self.status is not None and -self.status in OWN_FAULTS)
        return error

    def failure(self) -> str | None:
        """Why it did not end well; None if it did, or still runs."""
        if self.stopped is not None:
            return self.stopped
        if self.status in (None, 0):
            return None
        assert self.status is not None
        how = f"exit status {self.status}"
        if -self.status == signal.SIGXFSZ:
            how = f"wrote a file of more than {self.limits.file_bytes / 1e6:.0f} MB, the limit"
        elif self.status < 0:
            how = f"crashed: signal {-self.status} ({_signal_name(-self.status)})"
        return f"{how}{NOT_RUN.get(self.status, '')}; its last words: {last_words(self.log)}"

    def _ended(self, status: int, usage: resource.struct_rusage) -> None:
        self.popen.returncode = self.status = os.waitstatus_to_exitcode(status)
        if self.contained and SHELL_SIGNAL < self.status <= SHELL_SIGNAL + signal.SIGRTMAX:
            self.status = SHELL_SIGNAL - self.status  # its shell says so where a signal ended it
        self.cpu_s = usage.ru_utime + usage.ru_stime
        with contextlib.suppress(ProcessLookupError, PermissionError):  # what it left behind
            os.killpg(self.popen.pid, signal.SIGKILL)


@contextlib.contextmanager
def started(
    command: Sequence[str], folder: Path, limits: Limits, concealed: Sequence[Path] = (), fed: bool = False
) -> Iterator[Process]:
    """A program while it runs; it does not outlive the context.

    Args:
        command: Its words. It is started in the working directory, so that it can be named by a relative path.
        folder: Where ``log.txt`` with all that it prints goes, and its temporary files. What it keeps there is watched.
        limits: What it may take.
        concealed: Folders that it shall not see, where the system allows that.
        fed: Whether its standard input and output are pipes; then only what it prints on standard error goes to the log.

    Raises:
        MethodError: There is no such program, or it cannot be run; or what it left in its folder before is in the way.
    """
    log = folder / "log.txt"
    pipe = subprocess.PIPE if fed else subprocess.DEVNULL
    disk = Disk(limits.disk_bytes)
    disk.watch(folder)
    temporary = folder / TEMPORARY
    with _appended(log, temporary) as stream:
        if shutil.which(command[0]) is None:
            cure = "name it by a path, and chmod +x it"
            if re.fullmatch(r"\w+=.*", command[0]):
                cure = f"variables are set by env: env {command[0]} ..."
            elif command[0].startswith(("~", "$")):
                cure = "no shell reads the command: write the path out"
            raise MethodError(f"there is no program '{command[0]}', or it may not be run; {cure}")
        words, within = [str(word) for word in command], can_contain()
        if within:
            words = contained(words, concealed, limits.address_bytes, limits.file_bytes)
        try:
            popen = subprocess.Popen(
                words, stdin=pipe, stdout=subprocess.PIPE if fed else stream, stderr=stream, start_new_session=True,
                preexec_fn=dying_with_me(), env={**os.environ, "TMPDIR": str(temporary)},
            )  # fmt: skip
        except OSError as error:
            cure = "does it begin with #! and its interpreter?"
            raise MethodError(f"'{command[0]}' cannot be started: {error.strerror}; {cure}") from None
    if not within:
        limit(popen.pid, limits)
    process = Process(popen, limits, log, disk, contained=within)
    process.look()
    try:
        yield process
    finally:
        process.stop("ended with the evaluation")
        for end in (popen.stdin, popen.stdout):
            _close(end)


def _appended(log: Path, temporary: Path) -> BinaryIO:
    """The log of a program, open for more, and beside it a folder for temporary files. Raises MethodError."""
    try:
        temporary.mkdir(exist_ok=True)
        return os.fdopen(_unblocked(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT), "ab")
    except OSError as error:
        words = "its folder cannot be used for another call"
        raise MethodError(f"{words}: {error.strerror}; has it removed or replaced it?") from None


def command_words(text: str, **places: Path) -> list[str]:
    """The words of a command, with folders in place of ``{sequence}``, ``{out}`` and ``{map}``. Raises MethodError."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise MethodError(f"'{text}' is not a command: {error}") from None
    if not words:
        raise MethodError("its command is empty")
    if operators := [word for word in words if word in OF_SHELLS]:
        raise MethodError(f"its command has '{operators[0]}', and no shell reads it; write it into a script, or use sh -c '...'")
    for name, path in places.items():
        words = [word.replace(f"{{{name}}}", str(path)) for word in words]
    return words


def last_words(log: Path) -> str:
    """The last line that a program printed, shortened."""
    lines = []
    with contextlib.suppress(OSError), os.fdopen(_unblocked(log), "rb") as stream:  # it may have taken the file away
        stream.seek(0, os.SEEK_END)
        stream.seek(max(stream.tell() - 4096, 0))
        lines = stream.read().decode(errors="replace").splitlines()
    found = next((line.strip() for line in reversed(lines) if line.strip()), "none")
    return printable(found)[:LAST_WORDS]


def _unblocked(path: Path, flags: int = os.O_RDONLY) -> int:
    """Open a file without following a link or waiting for its other end: a program may have put anything there."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return "unknown"


def _close(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with contextlib.suppress(BrokenPipeError, OSError):
            stream.close()
