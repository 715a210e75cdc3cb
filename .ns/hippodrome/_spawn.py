"""Pools of spawned processes that nobody hears of and that leave nothing, whichever of their processes a signal ends. Not public.

The locks that ``multiprocessing`` makes for spawned processes have names in the system, in /dev/shm on Linux, and a process of
Python's own, the resource tracker, takes the names away. It ignores SIGINT and SIGTERM but no other signal. A SIGHUP to the
whole session, as of a terminal that is closed, ended it; the next one was then told to forget names that it had never heard, and
said so in a traceback for each; SIGKILL to all left the names for ever. The locks here are pipes, which go with their processes.
"""

from __future__ import annotations

import os
import signal
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import connection, resource_tracker
from multiprocessing.context import SpawnContext
from typing import Any, Final, TypeVar

from hippodrome._processes import ENDING

ResultT = TypeVar("ResultT")
ASKING: Final = frozenset((signal.SIGINT, *ENDING))  # signals that ask a process to end


class SpawnPool(ProcessPoolExecutor):
    """An executor of spawned processes.

    A process begins with the signals of ``ASKING`` blocked, as Python would answer them with a traceback until it can be told
    otherwise; ``initializer`` has to say what they do, and calls ``hear_signals``. Likewise the process that submits a task does
    not hear them in the middle of that, where a new process would be forgotten.

    Args:
        workers: How many processes.
        initializer: What each of them does first.
    """

    def __init__(self, workers: int, initializer: Callable[[], None]) -> None:
        super().__init__(workers, mp_context=_NamelessContext(), initializer=initializer)

    def submit(self, task: Callable[..., ResultT], /, *arguments: Any, **named: Any) -> Future[ResultT]:
        """Begin a task as soon as a process is free."""
        start_tracker()
        with signals_blocked(ASKING):
            return super().submit(task, *arguments, **named)


@contextmanager
def signals_blocked(numbers: Collection[int]) -> Iterator[None]:
    """Within the block this thread, and the processes that it starts, do not hear these signals; they come when it ends.

    Python answers a signal in its main thread, also one that another thread took, as those of libraries do. There the answer
    waits for the end of the block, too.
    """
    came: list[int] = []
    answers: dict[int, Any] = {}
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        with suppress(ValueError):  # not the main thread: nothing interrupts it
            for number in numbers:
                if callable(answer := signal.getsignal(number)):
                    signal.signal(number, lambda taken, _frame: came.append(taken))
                    answers[number] = answer
        yield
    finally:
        for number, answer in answers.items():
            signal.signal(number, answer)
        for number in came:
            signal.raise_signal(number)
        signal.pthread_sigmask(signal.SIG_SETMASK, kept)


def hear_signals() -> None:
    """Let a process of a ``SpawnPool`` hear the signals of ``ASKING``, also those that came meanwhile."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ASKING)


def start_tracker() -> None:
    """Start Python's resource tracker if it is not there, deaf to all signals that can be blocked; it ends with its last user.

    That the one before was killed need not be told, as nothing of ours depends on it.
    """
    with signals_blocked(signal.valid_signals()), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        resource_tracker.ensure_running()


class _Tokens:
    """A semaphore without a name: a pipe with a byte for each of those who may still enter. Spawned processes inherit it.

    It has of ``multiprocessing.synchronize.BoundedSemaphore`` what the queues of an executor ask for.
    """

    def __init__(self, count: int) -> None:
        self._reader, self._writer = connection.Pipe(duplex=False)
        os.set_blocking(self._reader.fileno(), False)  # of several who see the last byte, all but one go on waiting
        os.write(self._writer.fileno(), count * b"-")

    def acquire(self, block: bool = True, timeout: float | None = None) -> bool:
        """Take a byte; False if there is none, or none within ``timeout`` seconds."""
        end_s = None if timeout is None else time.monotonic() + timeout
        while True:
            try:
                return bool(os.read(self._reader.fileno(), 1))
            except BlockingIOError:
                left_s = None if end_s is None else end_s - time.monotonic()
                if not block or (left_s is not None and left_s <= 0.0):
                    return False
                self._reader.poll(left_s)

    def release(self) -> None:
        """Give a byte back."""
        os.write(self._writer.fileno(), b"-")

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    @property
    def _semlock(self) -> _Tokens:
        """Where ``Queue.full`` looks."""
        return self

    def _is_zero(self) -> bool:
        return not self._reader.poll()


class _NamelessContext(SpawnContext):
    """Spawned processes, as ``multiprocessing.get_context("spawn")`` has them, whose queues have locks without names."""

    def Lock(self) -> _Tokens:  # type: ignore[override]
        return _Tokens(1)

    def BoundedSemaphore(self, value: int = 1) -> _Tokens:  # type: ignore[override]
        return _Tokens(value)
