"""The command before it works and after: an interrupt from the keyboard ends it without a traceback at any moment."""

import signal
import subprocess
import sys

import pytest

RUN = "import sys; from hippodrome.__main__ import main; sys.exit(main())"
WHILE_LOADED = """
import os, signal, sys, types
cli = types.ModuleType("hippodrome.eval.cli")  # its code is what takes long to load
cli.__getattr__ = lambda name: os.kill(os.getpid(), signal.SIGINT) or exec("while True: pass")
sys.modules["hippodrome.eval.cli"] = cli
"""
AT_WORK = """
import os, signal
from hippodrome.eval import cli
cli._run = lambda options: os.kill(os.getpid(), signal.SIGINT)
"""
AFTER_ITS_LAST_WORD = """
import os, signal, threading, time
from hippodrome.eval import cli
def late():
    threading.main_thread().join()  # the interpreter is at its end, which waits for this thread
    time.sleep(0.1)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(30.0)
cli._run = lambda options: threading.Thread(target=late).start() or 0
"""
IGNORED = """
import os, signal
from hippodrome.eval import cli
signal.signal(signal.SIGINT, signal.SIG_IGN)
cli._run = lambda options: os.kill(os.getpid(), signal.SIGINT) or 0
"""
SENTENCE = "hippodrome: interrupted; what was finished is kept, the same command resumes\n"


@pytest.mark.parametrize(("before", "status", "said"), [
    (WHILE_LOADED, -signal.SIGINT, ""),
    (AT_WORK, 130, SENTENCE),
    (AFTER_ITS_LAST_WORD, -signal.SIGINT, ""),
    (IGNORED, 0, ""),
], ids=["while loaded", "at work", "after its last word", "ignored"])  # fmt: skip
def test_an_interrupt_ends_the_command_without_a_traceback(before, status, said):
    script = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler){before}{RUN}"
    done = subprocess.run([sys.executable, "-c", script, "scenario", "list"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (status, said)


def test_the_package_is_the_command():
    done = subprocess.run([sys.executable, "-m", "hippodrome", "--version"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.startswith("hippodrome ")
