"""Independent tasks over processes, with a progress bar that names the stage. Results come in the order of the tasks."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn, TypeVar

import cv2
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hippodrome.core.types import HippodromeError

INTERRUPTED = 130  # the shell's status for an interrupt
TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class Workers:
    """A pool of processes and the progress display that goes with it."""

    executor: ProcessPoolExecutor
    progress: Progress
    processes: int

    def run(
        self,
        stage: str,
        task: Callable[[TaskT], ResultT],
        tasks: Sequence[TaskT],
        weight: Callable[[TaskT], int] = lambda _: 1,
        follow: Callable[[ResultT], TaskT | None] = lambda _: None,
    ) -> list[ResultT]:
        """``task`` of each of ``tasks``; the first error stops the stage, and what is already on disk stays there.

        ``follow`` may answer a result with one task more, which is begun as soon as a process is free.
        """
        bar = self.progress.add_task(stage, total=sum(weight(item) for item in tasks))
        futures = {self.executor.submit(perform, task, item): weight(item) for item in tasks}
        pending = set(futures)
        try:
            while pending:
                # In turns, for an interrupt from the keyboard to be heard at once.
                done, pending = wait(pending, timeout=0.2, return_when="FIRST_COMPLETED")
                for future in done:
                    self.progress.advance(bar, futures[future])
                    if (item := follow(future.result())) is not None:
                        another = self.executor.submit(perform, task, item)
                        futures[another] = weight(item)
                        pending.add(another)
                self.progress.update(bar, total=sum(futures.values()))
            return [future.result() for future in futures]
        except BrokenProcessPool:
            raise HippodromeError(
                f"{stage}: a worker process died (out of memory?); run the same command again to resume, with fewer --workers"
            ) from None
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def worker_pool(workers: int) -> Iterator[Workers]:
    """``workers`` processes with a progress display."""
    with process_pool(workers) as executor, progress_bar() as progress:
        yield Workers(executor, progress, workers)


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """``workers`` fresh processes: SUMO and GL keep state that must not be inherited, so they are spawned, not forked."""
    executor = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"), initializer=_quiet_worker)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def progress_bar() -> Progress:
    """A display for a terminal; nothing where there is none."""
    columns = (
        TextColumn("{task.description:<10}"),
        BarColumn(bar_width=40),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    return Progress(*columns, console=console, disable=not console.is_terminal)


def one_opencv_thread() -> None:
    """For this process: on images as small as ours its threads wait busily for one another, a third of a look's CPU time."""
    cv2.setNumThreads(1)


def _quiet_worker() -> None:
    """One process, one core: the pool is the parallelism. Libraries' banners on standard output do not belong to ours."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    one_opencv_thread()
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as a shell has it for what runs in the background
        signal.signal(signal.SIGINT, _leave)
    sys.stdout = sys.stderr


def perform(task: Callable[[TaskT], ResultT], item: TaskT) -> ResultT:
    """``task`` of ``item`` in a worker. Interrupted, the task clears away what it has begun, and its process ends.

    The executor would take the exit for the task's own failure and begin the next one.
    """
    try:
        return task(item)
    except SystemExit:
        os._exit(INTERRUPTED)


def _leave(_signal: int, _frame: FrameType | None) -> NoReturn:
    """An interrupt from the keyboard reaches every process; one of them says so, the others end without a traceback.

    A worker between two tasks may find a message in the queue that another one has left half read: hence no more words.
    """
    sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115  # until the process ends
    raise SystemExit(INTERRUPTED)
