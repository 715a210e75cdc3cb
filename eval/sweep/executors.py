"""Where cells run: processes of this machine, or a Dask cluster. A cell that fails, or kills its process, fails alone."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from rich.progress import Progress

from hippodrome.core.types import HippodromeError
from hippodrome.eval.pool import process_pool

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
DIED = "its process died, also when it ran alone (out of memory, or a network that SUMO crashes on?)"
CONNECT_S = 10.0  # a scheduler that does not answer in this time is not there


class SweepError(HippodromeError):
    """A grid that cannot be made, or cells that cannot be run."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a task has no result."""

    cause: str


@dataclass(frozen=True, slots=True)
class Runner:
    """Runs tasks and says of each how it ended, as soon as it has."""

    # Makes an executor of so many processes at once; None: as many as there are.
    executors: Callable[[int | None], AbstractContextManager[Executor]]
    progress: Progress

    def run(
        self,
        stage: str,
        task: Callable[[TaskT], ResultT],
        items: Sequence[TaskT],
        ended: Callable[[TaskT, ResultT | Failure], None],
    ) -> None:
        """Run ``task`` on each item. Items whose process died are tried again alone, so that the one to blame is known.

        Args:
            stage: Name beside the progress bar.
            task: What to do with an item, in another process.
            items: What there is to do.
            ended: Called with each item, in this process, and with its result or why there is none.
        """
        bar = self.progress.add_task(stage, total=len(items))

        def tell(item: TaskT, result: ResultT | Failure) -> None:
            ended(item, result)
            self.progress.advance(bar)

        suspects: list[TaskT] = []
        waiting = list(items)
        while waiting:
            died, waiting = self._pass(task, waiting, None, tell)
            suspects += died
        for item in suspects:
            died, _ = self._pass(task, [item], 1, tell)
            for one in died:
                tell(one, Failure(DIED))

    def _pass(
        self,
        task: Callable[[TaskT], ResultT],
        items: Sequence[TaskT],
        width: int | None,
        tell: Callable[[TaskT, ResultT | Failure], None],
    ) -> tuple[list[TaskT], list[TaskT]]:
        """Run items in one executor of ``width`` processes.

        The answer: the items that ran when a process died and took the executor along, and those that had not begun. Both are
        empty if none died.
        """
        with self.executors(width) as executor:
            futures, left = dict[Future[ResultT | Failure], TaskT](), list(items)
            try:
                with suppress(BrokenProcessPool):  # a process died already: who is not begun waits for the next pass
                    while left:
                        futures[executor.submit(partial(_guarded, task), left[0])] = left[0]
                        del left[0]
                died, waiting = _watch(futures, tell)
                return died, waiting + left
            finally:
                for future in futures:
                    future.cancel()


def _watch(
    futures: dict[Future[ResultT | Failure], TaskT], tell: Callable[[TaskT, ResultT | Failure], None]
) -> tuple[list[TaskT], list[TaskT]]:
    """Tell of each future as it ends; the answer is that of ``_pass``. Waits in turns, so that the keyboard is heard."""
    pending, begun = set(futures), set[Future[ResultT | Failure]]()
    lost: set[Future[ResultT | Failure]] = set()
    while pending:
        done, pending = wait(pending, timeout=0.2, return_when="FIRST_COMPLETED")
        for future in done:
            try:
                tell(futures[future], future.result())
            except BrokenProcessPool:
                lost.add(future)
            except CancelledError:
                raise SweepError("the scheduler is gone; what was finished is kept, the same command resumes") from None
            except HippodromeError:
                raise
            except Exception as error:  # Dask's KilledWorker: it has tried the task on several workers already
                tell(futures[future], Failure(_said(error)))
        if not lost:
            begun = {future for future in pending if future.running()}
    suspects = [item for future, item in futures.items() if future in lost and (future in begun or not begun)]
    return suspects, [item for future, item in futures.items() if future in lost and begun and future not in begun]


def local_processes(workers: int) -> Callable[[int | None], AbstractContextManager[Executor]]:
    """Fresh processes of this machine."""
    return lambda width: process_pool(width or workers)


def dask_cluster(address: str) -> Callable[[int | None], AbstractContextManager[Executor]]:
    """The workers of a running cluster. Raises SweepError if the package is missing; on use, if nobody answers."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise SweepError("the package 'distributed' is missing; install the extra: pip install 'hippodrome[dask]'") from None

    if not is_guarded(address):
        print(
            f"hippodrome: --scheduler {address}: neither on this machine nor encrypted; who reaches it runs code there and here; "
            "see docs/sweeps.md for TLS",
            file=sys.stderr,
        )

    @contextmanager
    def connected(_: int | None) -> Iterator[Executor]:
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise SweepError(f"--scheduler {address}: no Dask scheduler answers ({_said(error)})") from None
        with client, client.get_executor(pure=False) as executor:  # type: ignore[no-untyped-call]
            yield executor

    return connected


def is_guarded(address: str) -> bool:
    """Whether a scheduler's address is this machine's own, one within this process, or encrypted."""
    kind, _, place = address.rpartition("://")
    host = place.rpartition(":")[0].strip("[]") or place
    return kind in ("tls", "wss", "inproc") or host in ("localhost", "::1") or re.fullmatch(r"127(\.\d+){3}", host) is not None


def _guarded(task: Callable[[TaskT], ResultT], item: TaskT) -> ResultT | Failure:
    """Run a task and bring errors back as values: a bug in one cell must not lose a night of others."""
    try:
        return task(item)
    except HippodromeError as error:
        return Failure(str(error))
    except Exception as error:
        return Failure(_said(error))
    except SystemExit as error:
        return Failure(f"it left the process with status {error.code}")


def _said(error: BaseException) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
