import subprocess
import sys
import time
from pathlib import Path

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.render import probe

COMPLAINS = "import sys; print('Traceback\\nImportError: Unable to load EGL library', file=sys.stderr); sys.exit(1)"
HANGS = "import time; time.sleep(60)"
WORKS = "print('drawn by a fake driver')"


@pytest.fixture
def trial(monkeypatch):
    """Puts a program of Python in the place of the child that draws; nothing is known of the machine before and after."""
    monkeypatch.setattr(probe, "_drivers", [])
    return lambda program: monkeypatch.setattr(probe, "TRIAL", (sys.executable, "-c", program))


@pytest.fixture
def broken(trial):
    """A machine on which the child that draws fails."""
    trial(COMPLAINS)


def test_a_frame_is_drawn_here():
    works, driver = probe.probe()
    assert works, driver
    assert driver


def test_the_missing_package_is_named_in_one_line(broken, monkeypatch, capsys):
    monkeypatch.setattr(probe, "LIBRARIES", {"libNoSuchThing.so.9": "libnosuchthing9"})
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    assert probe.main([]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert "libnosuchthing9" in err and "Unable to load EGL library" in err


def test_with_all_libraries_the_driver_is_what_is_missing(broken, monkeypatch):
    monkeypatch.setattr(probe, "LIBRARIES", {})
    assert probe.missing_packages() == probe.DRIVER_PACKAGES


def test_a_platform_that_the_user_chose_is_blamed(broken, monkeypatch):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    with pytest.raises(HippodromeError, match="PYOPENGL_PLATFORM=osmesa"):
        probe.require_gl()


def test_nothing_is_installed_without_root(broken, monkeypatch):
    monkeypatch.setattr(probe.os, "geteuid", lambda: 1000)
    assert probe.install() is False


def test_install_is_asked_for_by_name_and_tried_again(trial, monkeypatch, capsys):
    trial(COMPLAINS)
    monkeypatch.setattr(probe, "LIBRARIES", {"libNoSuchThing.so.9": "libnosuchthing9"})
    monkeypatch.setattr(probe.os, "geteuid", lambda: 0)
    monkeypatch.setattr(probe.shutil, "which", lambda _: "/usr/bin/apt-get")
    asked = []

    def run(command, **_):
        asked.append(command)
        trial(WORKS)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(probe.subprocess, "run", run)
    assert probe.main(["--install"]) == 0
    assert any("install" in c and "libnosuchthing9" in c for c in asked)
    assert "a fake driver" in capsys.readouterr().out


def test_a_driver_that_hangs_does_not_hang_us(trial, monkeypatch):
    trial(HANGS)
    monkeypatch.setattr(probe, "TIMEOUT_S", 0.2)
    works, line = probe.probe()
    assert not works and "does not answer" in line


def test_the_trial_goes_on_beside_what_is_done_and_is_made_once(trial, tmp_path):
    """The block does not wait for the child, which ends when the block lets it."""
    go = tmp_path / "go"
    trial(f"import os, time\nwhile not os.path.exists({str(go)!r}): time.sleep(.01)\n{WORKS}")
    with probe.gl_tried_beside() as require_gl:
        go.touch()
        assert require_gl() == require_gl() == "a fake driver"
    trial(COMPLAINS)
    assert probe.require_gl() == "a fake driver"


def test_what_is_missing_is_said_when_the_block_asks(broken):
    with pytest.raises(HippodromeError, match="Unable to load EGL library"), probe.gl_tried_beside() as require_gl:
        require_gl()


@pytest.mark.parametrize("error", [HippodromeError("the network is broken"), KeyboardInterrupt()])
def test_a_trial_ends_with_the_block_and_does_not_hide_its_error(trial, tmp_path, error):
    pid = tmp_path / "pid"
    trial(f"import os; from pathlib import Path; Path({str(pid)!r}).write_text(str(os.getpid())); {HANGS}")
    begun = time.monotonic()
    with pytest.raises(type(error)) as raised, probe.gl_tried_beside():
        while not (pid.exists() and pid.read_text()):
            time.sleep(0.01)
        raise error
    assert raised.value is error
    assert time.monotonic() - begun < 30.0
    assert not Path(f"/proc/{pid.read_text()}").exists()
