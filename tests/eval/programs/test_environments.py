"""Environments of programs: in the user's cache, of known bytes, and not used where others may have written."""

import os
import re
from pathlib import Path

import pytest

from hippodrome.eval.programs import environments
from hippodrome.eval.programs.environments import (
    READY,
    Environment,
    NotInstalled,
    ensure_environment,
    environment_folder,
    words_of,
)
from hippodrome.eval.rivals.orbslam3.method import ENVIRONMENT
from hippodrome.sim.method_spec import MethodSpec

ROOT = Path(__file__).parents[3]


def made(folder):
    (folder / "bin").mkdir(parents=True)
    folder.parent.chmod(0o700)
    folder.chmod(0o755)
    (folder / READY).touch()
    return folder


def test_it_lies_in_the_users_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert environment_folder(ENVIRONMENT).parent == tmp_path / "cache" / "hippodrome"
    monkeypatch.setenv("HOME", str(tmp_path))
    for useless in ("", "relative/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", useless)
        assert environment_folder(ENVIRONMENT).parent == tmp_path / ".cache" / "hippodrome"


def test_a_finished_one_is_used_and_its_own_user_alone_may_have_made_it(tmp_path):
    folder = made(tmp_path / "cache" / "env")
    assert ensure_environment(ENVIRONMENT, folder) == folder / "bin" / "python"
    for place in (folder, folder.parent):
        mode = place.stat().st_mode
        place.chmod(0o777)
        with pytest.raises(NotInstalled, match="group and others may write there, so its programs are not run"):
            ensure_environment(ENVIRONMENT, folder)
        place.chmod(mode)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_that_of_another_user_is_not_run(tmp_path):
    folder = made(tmp_path / "cache" / "env")
    os.chown(folder, 12345, 12345)
    with pytest.raises(NotInstalled, match="belongs to another user"):
        ensure_environment(ENVIRONMENT, folder)


def test_every_package_has_hashes_and_numpy_is_the_one_that_is_locked():
    packages = re.findall(r"^(\S+)==(\S+) \\$", ENVIRONMENT.requirements, flags=re.MULTILINE)
    assert [name for name, _ in packages] == ["pyorbslam3", "numpy", "protobuf"]
    assert len(set(re.findall(r"sha256:([0-9a-f]{64})\b", ENVIRONMENT.requirements))) == 7
    locked = (ROOT / "constraints.txt").read_text().splitlines()
    assert all(f"{name}=={dict(packages)[name]}" in locked for name in ("numpy", "protobuf"))


def test_it_is_installed_with_hashes_and_a_failure_is_a_sentence(tmp_path, monkeypatch):
    commands = []
    monkeypatch.setattr(environments, "_run", lambda command, what: commands.append(command))
    folder = tmp_path / "cache" / "env"
    folder.mkdir(parents=True, mode=0o755)
    ensure_environment(ENVIRONMENT, folder)
    assert any("--require-hashes" in command and "--only-binary" in command for command in commands)
    (tmp_path / "file").touch()
    with pytest.raises(NotInstalled, match="no environment can be made there"):
        ensure_environment(ENVIRONMENT, tmp_path / "file" / "env")


def test_a_method_brings_an_environment_of_its_own(tmp_path, monkeypatch):
    requirements = tmp_path / "mine.txt"
    requirements.write_text("a==1 --hash=sha256:00\n")
    made_of = []
    monkeypatch.setattr(
        environments, "ensure_environment", lambda environment, folder: made_of.append((environment, folder.name)) or Path("/py")
    )
    spec = MethodSpec(command="{python} run.py {sequence} {out}", environment=requirements)
    assert words_of(spec, spec.command, sequence=Path("s"), out=Path("o")) == ["/py", "run.py", "s", "o"]
    ((environment, folder),) = made_of
    assert environment == Environment("mine", requirements.read_text())
    assert folder.startswith("mine-")
    with pytest.raises(NotInstalled, match=r"absent\.txt: cannot be read"):
        words_of(spec.model_copy(update={"environment": tmp_path / "absent.txt"}), spec.command)


def test_the_environment_and_its_python_go_together():
    for settings in ({"command": "{python} a {sequence} {out}"}, {"stream": "./a", "environment": "requirements.txt"}):
        with pytest.raises(ValueError, match="go together"):
            MethodSpec.model_validate(settings)
