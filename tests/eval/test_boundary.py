"""Whatever a command raises is one sentence and an exit status; what the machine refuses is told apart from our own faults."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import hippodrome.eval.cli
from hippodrome._folders import sweep_temporary
from hippodrome._output import one_line
from hippodrome._processes import Terminated
from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.eval.commands.boundary import guarded, machine_fault, make_numba_cache

SOURCE = Path(hippodrome.eval.cli.__file__).parents[1]
HIPPODROME = [sys.executable, "-m", "hippodrome.eval.cli"]


def raising(error):
    def command():
        raise error

    return command


@pytest.mark.parametrize(("error", "status", "said"), [
    (HippodromeError("a.yaml:3: seed: no\nsuch seed"), 2, "hippodrome: a.yaml:3: seed: no such seed\n"),
    (HippodromeError("a\x1b[31m\x07b\u202ec"), 2, "hippodrome: a [31m b c\n"),
    (OSError(errno.ENOSPC, "No space left on device", "out/a.json"), 2, "out/a.json: No space left on device; free some"),
    (PermissionError(errno.EACCES, "Permission denied", "out"), 2, "hippodrome: out: Permission denied; permission is missing"),
    (OSError(errno.EROFS, "Read-only file system", "out"), 2, "the disk can only be read"),
    (OSError(errno.EXDEV, "Invalid cross-device link", "a", None, "b"), 2, "a -> b: Invalid cross-device link; check"),
    (OSError("no number"), 2, "hippodrome: the system: no number; check"),
    (MemoryError(), 2, "hippodrome: out of memory; "),
    (KeyboardInterrupt(), 130, "hippodrome: interrupted; what was finished is kept"),
    (Terminated(15), 143, "hippodrome: ended by SIGTERM; what was finished is kept"),
    (Terminated(1), 129, "hippodrome: ended by SIGHUP; what was finished is kept"),
])  # fmt: skip
def test_an_error_is_one_sentence(error, status, said, capsys):
    assert guarded(raising(error)) == status
    heard = capsys.readouterr()
    assert heard.out == "" and heard.err.count("\n") == 1 and said in heard.err


def test_our_own_fault_is_told_apart_and_its_traceback_kept(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert guarded(raising(ZeroDivisionError("oh\nno"))) == 70
    said = capsys.readouterr().err
    (report,) = tmp_path.iterdir()
    assert said == f"hippodrome: this is a fault of hippodrome; please report it with {report}: ZeroDivisionError: oh no\n"
    assert "Traceback" in report.read_text() and "in command" in report.read_text()
    monkeypatch.setenv("HIPPODROME_TRACEBACK", "1")
    assert guarded(raising(ZeroDivisionError())) == 70
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_the_report_of_a_fault_outlives_the_next_command(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert guarded(raising(ZeroDivisionError())) == 70
    sweep_temporary()
    assert len(list(tmp_path.iterdir())) == 1


def test_what_is_printed_cannot_command_the_terminal(capsys):
    assert guarded(lambda: print("a\x1b]0;x\x07b\u202ec\udcff\nd\te", "\r") or 0) == 0
    assert capsys.readouterr().out == "a ]0;x b c \nd\te  \n"


def test_a_fault_is_told_where_no_file_can_be_written(capsys, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", "/proc/none")
    assert guarded(raising(KeyError("x"))) == 70
    assert "please report it (HIPPODROME_TRACEBACK=1 shows where): KeyError" in capsys.readouterr().err


def test_what_has_no_code_and_no_number_is_still_a_line():
    assert one_line("  two\nlines\t\x00 ") == "two lines"
    assert machine_fault(FileNotFoundError(errno.ENOENT, "No such file or directory", "x")).startswith("x: No such file")


def shell(command, **environment):
    program = " ".join(HIPPODROME)
    return subprocess.run(["bash", "-c", command.replace("hippodrome", program, 1)], capture_output=True, text=True, check=False,
                          env={**os.environ, **environment}, timeout=120)  # fmt: skip


@pytest.mark.parametrize(("command", "status", "said"), [
    ("hippodrome scenario schema > /dev/full", 2, "No space left on device; free some space"),
    ("hippodrome scenario schema | head -c 10; exit ${PIPESTATUS[0]}", 0, ""),
    ("hippodrome scenario schema >&-", 0, ""),
    ("hippodrome report /nowhere 2>&-", 2, ""),
    ("hippodrome report /nowhere 2>/dev/full", 2, ""),
    ("cd $(mktemp -d); rmdir $PWD; hippodrome report out", 2, "hippodrome: "),
    ("hippodrome report $'a\\x1b[31m\\n\\xff'", 2, "hippodrome: "),
])  # fmt: skip
def test_ways_out_of_a_shell(command, status, said):
    done = shell(command)
    assert done.returncode == status, done.stderr
    assert said in done.stderr and "Traceback" not in done.stderr and "Exception ignored" not in done.stderr
    assert done.stderr.count("\n") <= 1 and "\x1b" not in done.stderr


def test_a_terminal_that_knows_ascii_only():
    done = shell("hippodrome report 'grün/≤'", PYTHONIOENCODING="ascii", LC_ALL="C", PYTHONUTF8="0")
    assert done.returncode == 2 and "gr" in done.stderr and "Traceback" not in done.stderr


def test_compiled_code_that_cannot_be_kept_is_named_and_no_reason_to_fail(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    make_numba_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ and capsys.readouterr().err == ""
    monkeypatch.setattr("hippodrome.eval.commands.boundary._can_write", lambda _: False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    make_numba_cache()
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent == tmp_path
    assert "set NUMBA_CACHE_DIR to a folder of your own" in capsys.readouterr().err
    del os.environ["NUMBA_CACHE_DIR"]


@pytest.mark.parametrize("module", ["methods.stages", "exchange.score", "authoring.check", "exchange.importing", "report.report"])
def test_commands_that_draw_nothing_need_no_gl(module):
    program = f"import sys, hippodrome.eval.{module}; print('OpenGL' in sys.modules or 'pyrender' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_missing_library_of_gl_is_named():
    program = """
import sys
sys.modules["OpenGL"] = None
try:
    import hippodrome.sim.render.gl
except Exception as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("HippodromeError no off-screen OpenGL: install the system package")


@pytest.mark.parametrize("arguments", [
    ["refine", "m", "--network", "n", "--out", "o", "--start", "nan,0,0"],
    ["refine", "m", "--network", "n", "--out", "o", "--start", "0,inf,0"],
    ["refine", "m", "--network", "n", "--out", "o", "--start", "0,0"],
    ["baselines", "a.yaml", "--seconds", "nan"],
    ["baselines", "a.yaml", "--seconds", "-1"],
    ["gate", "a.yaml", "--town-limit", "nan"],
    ["gate", "a.yaml", "--town-limit", "0"],
])  # fmt: skip
def test_options_take_no_numbers_that_are_none(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2 and "error: argument" in capsys.readouterr().err


WANTED = {  # what each command takes where {} stands, by the word before it
    "a recording": ["map {} --out o", "score f.tum {}", "export {} --to evo --out o", "import {} --out o"],
    "a map": ["refine {} --network n --out o", "localize {} d --out o", "import {} --from odometry --out o"],
    "results": ["report {}", "compare {} d", "compare f.tum {}", "board {} --out o", "gate s.yaml --baseline {} --out o"],
    "a scenario": ["scenario validate {}", "scenario preview {} --out o", "stress {} --out o", "drive {} --out o"],
    "a network": ["scenario new x --from {} --out o.yaml", "run d --network {} --out o"],
    "a folder to write in": ["eval towns/grid --out {}", "serve {} --port 0"],
}


@pytest.mark.parametrize("line", [line for lines in WANTED.values() for line in lines])
def test_a_file_for_a_folder_a_folder_for_a_file_and_nothing_at_all_are_refused_in_words(tmp_path, monkeypatch, capsys, line):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d" / "manifest.json").mkdir(parents=True)
    (tmp_path / "f.tum").write_text("0 0 0 0 0 0 0 1\n")
    (tmp_path / "empty").touch()
    writes = line.startswith(("eval", "serve"))  # there a folder, or one that is still to come, is what is wanted
    for given in ("f.tum", "empty", "f.tum/below", *(() if writes else ("d", "missing"))):
        assert main(line.format(given).split()) == 2
        said = capsys.readouterr().err.strip()
        assert "Errno" not in said and "\n" not in said and ";" in said, said
