"""Tasks over processes: results in order, tasks that follow from results, and an end without a traceback when interrupted."""

import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Future

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.files.progress import Teller, read_progress
from hippodrome.eval.pool import Workers, progress_bar, worker_pool

INTERRUPTED = 130  # exit status by which a shell knows a process that was interrupted
SCRIPT = """
import signal, sys, time
from hippodrome.eval.pool import worker_pool
if __name__ == "__main__":
    handler, seconds = getattr(signal, sys.argv[1]), float(sys.argv[2])
    signal.signal(signal.SIGINT, handler)
    try:
        with worker_pool(2) as pool:
            busy = pool.executor.submit(time.sleep, seconds)
            pool.executor.submit(time.sleep, 0.0).result()
            while not busy.running():
                time.sleep(0.01)
            print("ready", flush=True)
            pool.run("wait", time.sleep, 4 * [seconds])
    except KeyboardInterrupt:
        sys.exit(130)
"""


def test_results_come_in_the_order_of_the_tasks_and_then_of_those_that_follow():
    with worker_pool(2) as pool:
        assert pool.run("size", abs, [-8, 3, -5], follow=lambda size: -103 if size == 3 else None) == [8, 3, 5, 103]


def _die(name):
    """Ends the process as a library does that gives up, or as a system does that is out of memory."""
    time.sleep(0.2)
    if name.startswith("SIG"):
        os.kill(os.getpid(), getattr(signal, name))
    time.sleep(5.0)


@pytest.mark.parametrize(("name", "said"), [
    ("SIGABRT", r"drive: a worker process crashed \(SIGABRT\) over .*net SIGABRT.*; SUMO or another library cannot take it"),
    ("SIGSEGV", r"drive: a worker process crashed \(SIGSEGV\) over .*net SIGSEGV.*"),
    ("SIGKILL", r"drive: a worker process died over .*net SIGKILL.* \(out of memory\?\); run the same command again to resume"),
])  # fmt: skip
def test_a_worker_that_dies_is_told_with_what_it_worked_on(name, said):
    with worker_pool(2) as pool, pytest.raises(HippodromeError, match=said) as caught:
        pool.run("drive", _die, ["a", name], place=lambda item: f"net {item}")
    assert "\n" not in str(caught.value)


def test_a_worker_that_dies_between_two_stages_is_told_by_the_next():
    with worker_pool(1) as pool, pytest.raises(HippodromeError, match=r"weigh: a worker process died \(out of memory"):
        pid = pool.run("size", _pid, [None])[0]
        os.kill(pid, signal.SIGKILL)
        while not getattr(pool.executor, "_broken", True):
            time.sleep(0.01)
        pool.run("weigh", abs, ["a"], place=lambda item: f"net {item}")


@pytest.mark.parametrize(("ended_by", "cancelled"), [(KeyboardInterrupt, False), (HippodromeError, True)])
def test_at_an_interrupt_the_executor_alone_lets_go_of_its_tasks(ended_by, cancelled):
    """Its thread fails with a traceback if it finds a process dead, as after a signal to all, and a task cancelled here."""
    left = [Future(), Future()]
    left[0].set_result(None)
    given = iter(left)

    class Executor:
        submit = staticmethod(lambda *_: next(given))

    def end(_):
        raise ended_by

    with progress_bar() as progress, pytest.raises(ended_by):
        Workers(Executor(), progress, 1, Teller(False)).run("wait", abs, [1, 2], follow=end)
    assert left[1].cancelled() == cancelled


def _pid(_):
    return os.getpid()


@pytest.mark.parametrize(("handler", "seconds", "status"), [("default_int_handler", 60.0, INTERRUPTED), ("SIG_IGN", 1.0, 0)])
def test_an_interrupt_ends_busy_and_idle_workers_quietly_unless_it_is_ignored(tmp_path, handler, seconds, status):
    """A shell's background commands ignore the keyboard, their workers too."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), handler, str(seconds)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        assert process.stdout.readline() == "ready\n"
        os.killpg(process.pid, signal.SIGINT)
        said = process.communicate(timeout=30)[1]
    complaints = [line for line in said.splitlines() if not re.fullmatch(r"wait: \d of 4 done, \d+ s", line)]
    assert (process.returncode, complaints) == (status, [])


def test_without_a_terminal_each_quarter_of_a_stage_is_a_line(capsys):
    with worker_pool(1) as pool:
        pool.run("size", abs, list(range(8)))
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"size: 8 of 8 done, \d+ s", lines[-1])
    assert 1 <= len(lines) <= 5


def test_each_stage_says_its_time_and_what_is_next_and_keeps_it_while_the_run_goes_on(capsys, tmp_path):
    with worker_pool(1, ("load", "size", "weigh"), tmp_path) as pool:
        pool.run("load", abs, [])
        pool.run("size", abs, [1, 2])
        kept = read_progress(tmp_path)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "load: nothing to do; next: size"
    assert re.fullmatch(r"size: 2 of 2 done, \d+ s; next: weigh", lines[-1])
    assert kept.plan == ("load", "size", "weigh")
    assert [(stage.name, stage.done, stage.total) for stage in kept.stages] == [("load", 0, 0), ("size", 2, 2)]
    assert read_progress(tmp_path) is None and list(tmp_path.iterdir()) == []
