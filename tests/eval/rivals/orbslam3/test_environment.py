"""The tracker's environment: in the user's cache, of known bytes, and not used where others may have written."""

import os
import re
from pathlib import Path

import pytest

from hippodrome.eval.rivals.orbslam3 import environment
from hippodrome.eval.rivals.orbslam3.environment import READY, REQUIREMENTS, NotInstalled, ensure_environment, environment_folder

ROOT = Path(__file__).parents[4]


def made(folder):
    (folder / "bin").mkdir(parents=True)
    folder.parent.chmod(0o700)
    folder.chmod(0o755)
    (folder / READY).touch()
    return folder


def test_it_lies_in_the_users_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert environment_folder().parent == tmp_path / "cache" / "hippodrome"
    monkeypatch.setenv("HOME", str(tmp_path))
    for useless in ("", "relative/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", useless)
        assert environment_folder().parent == tmp_path / ".cache" / "hippodrome"


def test_a_finished_one_is_used_and_its_own_user_alone_may_have_made_it(tmp_path):
    folder = made(tmp_path / "cache" / "env")
    assert ensure_environment(folder) == folder / "bin" / "python"
    for place in (folder, folder.parent):
        mode = place.stat().st_mode
        place.chmod(0o777)
        with pytest.raises(NotInstalled, match="group and others may write there, so its programs are not run"):
            ensure_environment(folder)
        place.chmod(mode)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_that_of_another_user_is_not_run(tmp_path):
    folder = made(tmp_path / "cache" / "env")
    os.chown(folder, 12345, 12345)
    with pytest.raises(NotInstalled, match="belongs to another user"):
        ensure_environment(folder)


def test_every_package_has_hashes_and_numpy_is_the_one_that_is_locked():
    packages = re.findall(r"^(\S+)==(\S+) \\$", REQUIREMENTS, flags=re.MULTILINE)
    assert [name for name, _ in packages] == ["pyorbslam3", "numpy"]
    assert len(set(re.findall(r"sha256:([0-9a-f]{64})\b", REQUIREMENTS))) == 6
    assert f"numpy=={dict(packages)['numpy']}" in (ROOT / "constraints.txt").read_text().splitlines()


def test_it_is_installed_with_hashes_and_a_failure_is_a_sentence(tmp_path, monkeypatch):
    commands = []
    monkeypatch.setattr(environment, "_run", lambda command, what: commands.append(command))
    folder = tmp_path / "cache" / "env"
    folder.mkdir(parents=True, mode=0o755)
    ensure_environment(folder)
    assert any("--require-hashes" in command and "--only-binary" in command for command in commands)
    (tmp_path / "file").touch()
    with pytest.raises(NotInstalled, match="no environment can be made there"):
        ensure_environment(tmp_path / "file" / "env")
