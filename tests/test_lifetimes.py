"""What a command leaves behind, however it ends: no process, no temporary folder, no unfinished file."""

import errno
import os
import pickle
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hippodrome._files import allowed, replacing, write_atomically
from hippodrome._folders import (
    folder_of_this_process,
    sweep_temporary,
    temporary_folder,
    unfinished_folder,
    written_by_one,
)
from hippodrome._processes import Terminated, dying_with_me, ending_like_an_interrupt
from hippodrome.core.types import HippodromeError
from hippodrome.eval.commands.boundary import machine_fault

POOL = """
import os, signal, sys, time
from hippodrome._processes import ending_like_an_interrupt
from hippodrome.eval.pool import worker_pool
if __name__ == "__main__":
    try:
        with ending_like_an_interrupt(), worker_pool(2) as pool:
            pids = {pool.executor.submit(os.getpid).result() for _ in range(20)}
            busy = [pool.executor.submit(time.sleep, 60.0) for _ in range(2)]
            while not all(one.running() for one in busy):
                time.sleep(0.01)
            print(*pids, flush=True)
            pool.run("wait", time.sleep, 4 * [60.0])
    except KeyboardInterrupt as error:
        sys.exit(128 + getattr(error, "number", signal.SIGINT))
"""
UNFINISHED = """
import sys, time
from pathlib import Path
from hippodrome._files import replacing
from hippodrome._folders import temporary_folder, written_by_one
from hippodrome._processes import ending_like_an_interrupt
from hippodrome.eval.pool import worker_pool

def hold(out):
    with temporary_folder() as one, replacing(out / "a.json") as two:
        print(one, two, sep="\\n", file=sys.__stdout__, flush=True)
        time.sleep(60.0)

if __name__ == "__main__":
    out = Path(sys.argv[1])
    try:
        with ending_like_an_interrupt(), written_by_one(out), worker_pool(1) as pool:
            pool.run("hold", hold, [out])
    except KeyboardInterrupt as error:
        sys.exit(128 + error.number)
"""
HOLDER = """
import sys, time
from pathlib import Path
from hippodrome._folders import temporary_folder, unfinished_folder, written_by_one
from hippodrome._files import replacing
out = Path(sys.argv[1])
with written_by_one(out), temporary_folder() as one, unfinished_folder(out / "new") as two, replacing(out / "a.json") as three:
    (one / "file").write_text("x")
    (two / "file").write_text("x")
    three.write_text("half")
    print(one, two, three, sep="\\n", flush=True)
    time.sleep(60.0)
"""


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def wait_until(condition, limit_s=5.0):
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


def hearing_all_signals():
    """Whoever starts the tests with nohup has them ignore SIGHUP, and with them all that they start."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture
def started(tmp_path):
    """Starts a Python script of the text given, in a session and a folder for temporary files of its own."""
    processes = []
    (tmp_path / "tmp").mkdir()

    def start(text, *arguments):
        script = tmp_path / "script.py"
        script.write_text(text)
        environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp")}
        process = subprocess.Popen(
            [sys.executable, str(script), *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=environment, start_new_session=True, preexec_fn=hearing_all_signals,
        )  # fmt: skip
        processes.append(process)
        return process

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize(("number", "status"), [
    (signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL),
])  # fmt: skip
def test_workers_end_with_the_command_that_started_them(started, number, status):
    """The signal goes to the main process alone; both workers are in the middle of something."""
    process = started(POOL)
    pids = [int(word) for word in process.stdout.readline().split()]
    assert pids and all(map(alive, pids))
    process.send_signal(number)
    assert process.wait(timeout=20) == status
    assert wait_until(lambda: not any(map(alive, pids)))
    if number != signal.SIGKILL:
        assert process.stderr.read() == ""


def test_a_program_dies_with_the_process_that_started_it(started):
    process = started("""
import subprocess, sys, time
from hippodrome._processes import dying_with_me
child = subprocess.Popen(["sleep", "60"], preexec_fn=dying_with_me())
print(child.pid, flush=True)
time.sleep(60)
""")
    pid = int(process.stdout.readline())
    assert alive(pid)
    process.kill()
    assert wait_until(lambda: not alive(pid))
    assert subprocess.run(["true"], preexec_fn=dying_with_me(), check=False).returncode == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_as_an_interrupt_does_unless_it_is_ignored(number):
    with pytest.raises(KeyboardInterrupt) as caught, ending_like_an_interrupt():
        signal.raise_signal(number)
    assert isinstance(caught.value, Terminated) and caught.value.number == number
    assert signal.getsignal(number) == signal.SIG_DFL
    signal.signal(number, signal.SIG_IGN)
    try:
        with ending_like_an_interrupt():
            signal.raise_signal(number)
    finally:
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_after_a_signal_an_error_that_a_library_makes_of_it_is_the_signal(number):
    def convert(_):
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            raise ValueError from None

    with pytest.raises(KeyboardInterrupt) as caught, ending_like_an_interrupt():
        convert(0)
    assert isinstance(caught.value.__cause__, ValueError)
    assert isinstance(caught.value, Terminated) == (number == signal.SIGTERM)
    with pytest.raises(ValueError), ending_like_an_interrupt():  # nothing came: it stays what it is
        raise ValueError


def test_a_signal_while_a_module_is_loaded_comes_behind_it(tmp_path, monkeypatch):
    """Python makes a RuntimeError of what comes up in ``__set_name__``, and who can do without a module catches that."""
    (tmp_path / "slow_module.py").write_text("""
import signal
class Name:
    def __set_name__(self, owner, name):
        signal.raise_signal(signal.SIGTERM)
class Owner:
    name = Name()
""")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(Terminated), ending_like_an_interrupt():
        try:
            import slow_module
        except RuntimeError:
            pytest.fail("the signal came up within the module")
        assert slow_module.Owner.name is not None
        time.sleep(5.0)


@pytest.mark.parametrize("to_all", [False, True])
def test_nothing_is_left_of_what_workers_were_at_when_the_command_was_asked_to_end(started, tmp_path, to_all):
    process = started(UNFINISHED, tmp_path / "out")
    left = [Path(process.stdout.readline().strip()) for _ in range(2)]
    assert all(path.exists() for path in left)
    (os.killpg if to_all else os.kill)(process.pid, signal.SIGTERM)
    assert process.wait(20.0) == 143
    assert list((tmp_path / "tmp").iterdir()) == [] and not (tmp_path / "out").exists()


def test_what_a_killed_command_left_is_swept_by_the_next(started, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    process, out = started(HOLDER, tmp_path / "out"), tmp_path / "out"
    left = [Path(process.stdout.readline().strip()) for _ in range(3)]
    sweep_temporary()
    write_atomically(out / "a.json", b"{}")
    with unfinished_folder(out / "new"):
        pass
    assert all(path.exists() for path in left)  # it is still at work
    with pytest.raises(HippodromeError, match="another hippodrome command is writing there; wait"), written_by_one(out):
        pass
    process.kill()
    process.wait()
    assert all(path.exists() for path in left)
    sweep_temporary()
    with written_by_one(out):
        assert not any(path.exists() for path in left)
    assert list(out.iterdir()) == [out / "a.json"] and not list((tmp_path / "tmp").iterdir())


def test_each_write_sweeps_what_was_left_of_the_same_file(tmp_path):
    (tmp_path / ".a.json.abcdefgh.part").write_text("half")
    (tmp_path / ".b.json.abcdefgh.part").write_text("half")
    (tmp_path / ".movie.part").write_text("a browser's")
    write_atomically(tmp_path / "a.json", b"{}")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".b.json.abcdefgh.part", ".movie.part", "a.json"]
    with written_by_one(tmp_path):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == [".movie.part", "a.json"]


def test_a_folder_that_is_made_for_nothing_is_taken_away(tmp_path):
    with written_by_one(tmp_path / "new"):
        assert (tmp_path / "new").is_dir()
    assert not (tmp_path / "new").exists()
    (tmp_path / "file").write_text("")
    for name in ("file", "file/below", "nul\0"):
        with pytest.raises(HippodromeError, match="no folder can be made there"), written_by_one(tmp_path / name):
            pass


def test_links_are_never_followed(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "file").write_text("")
    (tmp_path / "hippodrome-link").symlink_to(kept)
    sweep_temporary()
    assert (kept / "file").exists() and (tmp_path / "hippodrome-link").is_symlink()


def test_temporary_folders_go_with_their_block(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with temporary_folder() as folder:
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not list(tmp_path.iterdir())
    kept = folder_of_this_process()
    sweep_temporary()
    assert kept.is_dir()


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664), (0o027, 0o640)])
def test_files_have_the_permissions_that_the_umask_leaves(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        with replacing(tmp_path / "a") as temporary:
            temporary.write_text("a")
        assert allowed(0o777) == 0o777 & ~umask
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == mode


def test_a_disk_that_is_full_is_named_with_the_file(tmp_path):
    with pytest.raises(OSError, match="No space left") as caught, replacing(tmp_path / "a.json"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert machine_fault(pickle.loads(pickle.dumps(caught.value))).startswith(
        f"{tmp_path / 'a.json'}: No space left on device; free"
    )
    assert not list(tmp_path.iterdir())
