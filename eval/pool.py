"""Independent tasks over processes, with a progress bar that names the stage. Results come in the order of the tasks."""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final, TypeVar

import cv2
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hippodrome._folders import sweep_temporary
from hippodrome._output import terminal
from hippodrome._processes import die_with_parent, end_children
from hippodrome._spawn import ASKING, SpawnPool, hear_signals, signals_blocked
from hippodrome.core.types import HippodromeError
from hippodrome.eval.files.progress import Teller

# In this time an executor's thread forgets the tasks that were cancelled. CPython 3.11 stumbles over them, with a traceback, if
# the processes are gone first.
SETTLE_S = 0.2
# Signals by which a process ends that has stumbled over its own work: a library gives up, or touches memory that is not there.
CRASHES: Final = frozenset(
    int(getattr(signal, name)) for name in ("SIGABRT", "SIGSEGV", "SIGBUS", "SIGILL", "SIGFPE") if hasattr(signal, name)
)
TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class Workers:
    """A pool of processes and the progress display that goes with it."""

    executor: ProcessPoolExecutor
    progress: Progress
    processes: int
    teller: Teller

    def run(
        self,
        stage: str,
        task: Callable[[TaskT], ResultT],
        tasks: Sequence[TaskT],
        weight: Callable[[TaskT], int] = lambda _: 1,
        follow: Callable[[ResultT], TaskT | None] = lambda _: None,
        place: Callable[[TaskT], str] = lambda _: "",
    ) -> list[ResultT]:
        """Run ``task`` on each of ``tasks``. The first error stops the stage; what is on disk by then stays there.

        Args:
            stage: Name of the stage for the progress display and for errors.
            task: What each process does with a task.
            tasks: The tasks.
            weight: How much a task counts in the progress display.
            follow: May answer a result with one more task, which is begun as soon as a process is free.
            place: What a task works on, for the error if its process dies over it: the file that SUMO crashes on, for one.

        Returns:
            The results in the order of the tasks, those of the tasks that followed at the end.

        Raises:
            HippodromeError: A process died, or what a task raised.
        """
        bar = self.progress.add_task(stage, total=sum(weight(item) for item in tasks))
        items, futures = dict[Future[ResultT], TaskT](), dict[Future[ResultT], int]()
        begun, processes = set[Future[ResultT]](), self._alive()
        try:
            for one in tasks:  # a process may have died between two stages, which the executor says here
                future = self.executor.submit(task, one)
                items[future], futures[future] = one, weight(one)
            self.teller.begin(stage, len(futures))
            pending, processes = set(futures), self._alive()
            while pending:
                # Waiting for a short time at once, so that an interrupt from the keyboard takes effect without delay.
                done, pending = wait(pending, timeout=0.2, return_when="FIRST_COMPLETED")
                for future in done:
                    self.progress.advance(bar, futures[future])
                    if (item := follow(future.result())) is not None:
                        another = self.executor.submit(task, item)
                        items[another], futures[another] = item, weight(item)
                        pending.add(another)
                begun = {future for future in pending if future.running()} or begun
                self.progress.update(bar, total=sum(futures.values()))
                self.teller.say(sum(future.done() for future in futures), len(futures))
            return [future.result() for future in futures]
        except BrokenProcessPool:
            places = sorted({place(items[future]) for future in begun or futures if not _ended_well(future)} - {""})
            raise HippodromeError(f"{stage}: {_how_it_died(processes, places)}") from None
        except Exception:  # what a task raised; not an interrupt, nor a death, at which the executor itself lets go of the tasks
            for future in futures:
                future.cancel()  # the executor's thread stumbles, with a traceback, if a process dies and one is cancelled here
            raise

    def _alive(self) -> list[BaseProcess]:
        """The processes that there are; no public way tells how one of them ended."""
        return list((getattr(self.executor, "_processes", None) or {}).values())


def _ended_well(future: Future[ResultT]) -> bool:
    return future.done() and not future.cancelled() and future.exception() is None


def _how_it_died(processes: Sequence[BaseProcess], places: Sequence[str]) -> str:
    """How the first of a broken pool's processes ended, at what, and what to do; the pool itself ends the others."""
    end_s = time.monotonic() + SETTLE_S
    while any(process.exitcode is None for process in processes) and time.monotonic() < end_s:
        time.sleep(0.01)
    signals = {-process.exitcode for process in processes if process.exitcode is not None}
    at = f" over {' or '.join(places[:3])}{' or others' if len(places) > 3 else ''}" if places else ""
    if crashes := sorted(signals & CRASHES):
        cure = "SUMO or another library cannot take it: mend it or leave it out; the same command resumes"
        return f"a worker process crashed ({signal.Signals(crashes[0]).name}){at}; {cure}"
    return f"a worker process died{at} (out of memory?); run the same command again to resume, with fewer --workers"


@contextmanager
def worker_pool(workers: int, plan: Sequence[str] = (), folder: Path | None = None) -> Iterator[Workers]:
    """``workers`` processes with a progress display; they end with the context.

    Args:
        workers: How many.
        plan: Names of the stages that will be run, in their order, so that each can say what is next.
        folder: Where the run writes; how far it is stands there in a file while it goes on. None: nowhere.
    """
    with process_pool(workers) as executor, progress_bar() as progress:
        teller = Teller(progress.disable, tuple(plan), folder)
        yield Workers(executor, progress, workers, teller)
        teller.end()


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """``workers`` processes. They are spawned, not forked, as SUMO and GL keep state that must not be inherited.

    After them their temporary folders are taken away, if they ended in the middle of something.
    """
    executor = SpawnPool(workers, _quiet_worker)
    try:
        yield executor
    except BaseException as error:
        if not isinstance(error, Exception):  # an interrupt or a signal: nobody waits for what the processes are at
            _abandon(executor)
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
        sweep_temporary()


def _abandon(executor: ProcessPoolExecutor) -> None:
    """End the processes in the middle of their tasks. A second signal comes after that, so that they can clear away."""
    with signals_blocked(ASKING):
        executor.shutdown(wait=False, cancel_futures=True)
        time.sleep(SETTLE_S)
        end_children()


def progress_bar() -> Progress:
    """A progress display for a terminal; without a terminal it shows nothing."""
    columns = (
        TextColumn("{task.description:<10}"),
        BarColumn(bar_width=40),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(file=terminal(sys.stderr))
    return Progress(*columns, console=console, disable=not console.is_terminal)


def one_opencv_thread() -> None:
    """Let OpenCV use one thread in this process.

    On images as small as ours its threads mostly wait for one another, which took a third of the CPU time of a query frame.
    """
    cv2.setNumThreads(1)


def _quiet_worker() -> None:
    """Set up a worker: it uses one core, as the pool is the parallelism, and what libraries print goes to standard error.

    It ends when the process that started it ends, however that does, and at once when it is asked to. An exception for that would
    come up in the middle of libraries, which forget it, make an error of their own of it, or crash on it; what the process has
    begun and not finished is taken away by the one that started it.
    """
    if (parent := multiprocessing.parent_process()) is not None and parent.pid is not None:
        die_with_parent(parent.pid)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    one_opencv_thread()
    for number in ASKING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # a shell lets commands in the background ignore interrupts
            signal.signal(number, signal.SIG_DFL)
    sys.stdout = sys.stderr
    hear_signals()
    atexit.register(_end)


def _end() -> None:
    """The end of a worker that has nothing left to do: Python would go through all of its objects, which takes half a second."""
    sys.stderr.flush()
    os._exit(0)
