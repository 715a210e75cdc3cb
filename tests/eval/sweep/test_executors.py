"""A task that fails, or kills its process, fails alone. The cluster's part is in test_sweep."""

import os
import signal
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import pytest
from rich.progress import Progress

from hippodrome.core.types import HippodromeError
from hippodrome.eval.sweep.executors import DIED, Failure, Runner, SweepError, dask_cluster, local_processes


def work(item):
    if item == "bad":
        raise HippodromeError("bad.yaml: no road")
    if item == "bug":
        raise KeyError("x")
    if item == "killer":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "hung up":
        signal.raise_signal(signal.SIGHUP)
    if item == "leaver":
        raise SystemExit(3)
    return item.upper()


WORK = ["a", "killer", "bad", "bug", "b", "hung up", "leaver"]


def test_each_fails_alone():
    found = {}
    with Progress(disable=True) as progress:
        Runner(local_processes(2), progress).run("work", work, WORK, found.__setitem__)
    assert found == {
        "a": "A",
        "b": "B",
        "bad": Failure("bad.yaml: no road"),
        "bug": Failure("KeyError: 'x'"),
        "killer": Failure(DIED),
        "hung up": Failure(DIED),  # the main process, which nobody hung up, goes on
        "leaver": Failure("it left the process with status 3"),
    }


def test_what_could_not_be_begun_as_a_process_had_died_is_done_later():
    executors = iter([_BreaksAtOnce(), ThreadPoolExecutor(), ThreadPoolExecutor()])
    found = {}
    with Progress(disable=True) as progress:
        Runner(lambda width: next(executors), progress).run("work", work, ["a", "b", "c"], found.__setitem__)
    assert found == {"a": "A", "b": "B", "c": "C"}


class _BreaksAtOnce(ThreadPoolExecutor):
    """Its first task dies with its process before the second one is submitted."""

    _died = False

    def submit(self, task, /, *arguments):
        if self._died:
            raise BrokenProcessPool("a child process terminated abruptly")
        self._died, future = True, Future()
        future.set_exception(BrokenProcessPool("a child process terminated abruptly"))
        return future


def test_a_scheduler_that_is_not_there(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("hippodrome.eval.sweep.executors.CONNECT_S", 0.2)
    with (
        pytest.raises(SweepError, match=r"--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers"),
        dask_cluster("tcp://127.0.0.1:9")(None),
    ):
        pass
