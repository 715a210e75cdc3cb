import subprocess

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.render import probe


@pytest.fixture
def broken(monkeypatch):
    """A machine on which the child that draws fails."""
    failed = subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: Unable to load EGL library\n")
    monkeypatch.setattr(probe.subprocess, "run", lambda *_, **__: failed)
    probe.require_gl.cache_clear()
    yield
    probe.require_gl.cache_clear()


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


def test_install_is_asked_for_by_name_and_tried_again(monkeypatch, capsys):
    monkeypatch.setattr(probe, "LIBRARIES", {"libNoSuchThing.so.9": "libnosuchthing9"})
    monkeypatch.setattr(probe.os, "geteuid", lambda: 0)
    monkeypatch.setattr(probe.shutil, "which", lambda _: "/usr/bin/apt-get")
    asked = []

    def run(command, **_):
        asked.append(command)
        installed = any("install" in c for c in asked)
        drawing = "--draw" in command
        return subprocess.CompletedProcess(
            command, 0 if installed or not drawing else 1, "drawn by a fake driver\n" * drawing, "no\n"
        )

    monkeypatch.setattr(probe.subprocess, "run", run)
    assert probe.main(["--install"]) == 0
    assert any("install" in c and "libnosuchthing9" in c for c in asked)
    assert "a fake driver" in capsys.readouterr().out


def test_a_driver_that_hangs_does_not_hang_us(monkeypatch):
    def run(*_, **__):
        raise subprocess.TimeoutExpired("python", 1.0)

    monkeypatch.setattr(probe.subprocess, "run", run)
    works, line = probe.probe()
    assert not works and "does not answer" in line
