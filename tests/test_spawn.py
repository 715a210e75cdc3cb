"""Signals to all processes of a pool, Python's own among them: nobody says a word, and no process and no name is left."""

import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from hippodrome._spawn import SpawnPool, _Tokens, hear_signals, signals_blocked
from tests.families import command_line, kill, session, with_default_signals

SCRIPT = """
import multiprocessing, os, signal, sys, time
from hippodrome._processes import ending_like_an_interrupt
from hippodrome.eval.pool import worker_pool
if __name__ == "__main__":
    multiprocessing.current_process()._config["semprefix"] = f"/hippodrome-test-{os.getpid()}"
    try:
        with ending_like_an_interrupt(), worker_pool(2) as pool:
            pool.run("wait", time.sleep, 4 * [float(sys.argv[1])])
            pool.run("again", time.sleep, 4 * [0.0])
    except KeyboardInterrupt as error:
        sys.exit(128 + getattr(error, "number", signal.SIGINT))
"""
LIMIT_S = 240.0  # of a machine that others use
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")


def pids_of(process, word, wanted):
    """The processes of its session with this word in their command line, once there are so many of them."""
    end_s = time.monotonic() + LIMIT_S
    while len(found := [pid for pid in session(process.pid) if word in command_line(pid)]) < wanted and time.monotonic() < end_s:
        time.sleep(0.01)
    assert len(found) >= wanted
    return found


def gone(process):
    """Whether nobody of its session is left after a while, in which a busy machine ends them; who is, is ended."""
    end_s = time.monotonic() + 30.0
    while (left := session(process.pid)) and time.monotonic() < end_s:
        time.sleep(0.05)
    for pid in left:
        kill(pid, "SIGKILL")
    return not left


@pytest.mark.parametrize(("target", "name", "after_s", "status"), [
    ("all", "SIGHUP", 1.5, 129),  # the tracker did not ignore it
    ("all", "SIGKILL", 1.5, -signal.SIGKILL),  # nobody was left to take the names away
    ("all", "SIGINT", 0.0, 130),  # the workers are still starting
    ("all", "SIGTERM", 0.2, 143),
    ("tracker", "SIGKILL", 0.5, 0),  # the next one was told to forget what it had not heard
])  # fmt: skip
def test_a_signal_leaves_no_word_no_process_and_no_name(tmp_path, target, name, after_s, status):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    seconds = "1.0" if target == "tracker" else "60.0"
    with subprocess.Popen([sys.executable, str(script), seconds], stderr=subprocess.PIPE, text=True, start_new_session=True,
                          preexec_fn=with_default_signals) as process:  # fmt: skip
        pids_of(process, b"spawn_main", 1)
        time.sleep(after_s)
        for pid in session(process.pid) if target == "all" else pids_of(process, b"resource_tracker", 1):
            kill(pid, name)
        said = process.communicate(timeout=LIMIT_S)[1]
    lines = [line for line in said.splitlines() if not re.fullmatch(r"\w+: \d of 4 done, \d+ s", line)]
    assert (process.returncode, lines) == (status, [])
    assert gone(process)
    assert not list(Path("/dev/shm").glob(f"*hippodrome-test-{process.pid}*"))


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_second_signal_waits_for_no_task(tmp_path, name):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    with subprocess.Popen([sys.executable, str(script), "600.0"], stderr=subprocess.PIPE, text=True, start_new_session=True,
                          preexec_fn=with_default_signals) as process:  # fmt: skip
        pids_of(process, b"spawn_main", 2)
        time.sleep(0.5)
        for _ in range(2):  # to the main process alone: the workers are asked by it, or die with it
            kill(process.pid, name)
            time.sleep(0.1)
        said, number = process.communicate(timeout=LIMIT_S)[1], int(getattr(signal, name))
    assert (process.returncode in (128 + number, -number), said) == (True, "")
    assert gone(process)


def _blocked():
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_process_of_a_pool_begins_without_hearing_signals_until_it_says_so():
    before = _blocked()
    with SpawnPool(1, hear_signals) as pool:
        assert pool.submit(_blocked).result(LIMIT_S) == set()
    with SpawnPool(1, _blocked) as pool:
        assert pool.submit(_blocked).result(LIMIT_S) >= {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    assert _blocked() == before


def test_a_signal_that_comes_while_it_is_blocked_is_heard_afterwards():
    heard = []
    kept = signal.signal(signal.SIGUSR1, lambda number, _: heard.append(number))
    try:
        with signals_blocked([signal.SIGUSR1]):
            signal.raise_signal(signal.SIGUSR1)
            assert heard == []
        assert heard == [signal.SIGUSR1]
    finally:
        signal.signal(signal.SIGUSR1, kept)


def test_a_signal_that_another_thread_takes_is_heard_afterwards():
    heard = []
    kept = signal.signal(signal.SIGUSR1, lambda number, _: heard.append(number))
    try:
        with signals_blocked([signal.SIGUSR1]):
            other = threading.Thread(target=_take_a_signal)
            other.start()
            other.join(LIMIT_S)
            assert heard == []
        assert heard == [signal.SIGUSR1]
    finally:
        signal.signal(signal.SIGUSR1, kept)


def _take_a_signal():
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGUSR1])
    signal.raise_signal(signal.SIGUSR1)


def test_tokens_let_so_many_in_and_one_more_for_each_that_leaves():
    tokens = _Tokens(2)
    assert tokens.acquire() and not tokens._is_zero() and tokens.acquire(timeout=1.0)
    assert tokens._is_zero() and not tokens.acquire(block=False) and not tokens.acquire(timeout=0.05)
    threading.Timer(0.1, tokens.release).start()
    with tokens:
        assert tokens._is_zero()
    assert not tokens._semlock._is_zero()


def test_of_many_who_wait_for_a_token_one_at_a_time_gets_it():
    tokens, inside, most = _Tokens(1), [], []

    def enter():
        for _ in range(50):
            with tokens:
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    threads = [threading.Thread(target=enter) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT_S)
    assert max(most) == 1 and len(most) == 400
