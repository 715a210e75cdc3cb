"""Virtual environments for programs alone, so that their licences, their crashes and their packages stay out of ours.

They lie in the user's cache, not among the results: a folder of results may come from somebody else, and what is in an
environment is run. The packages of one are those that its requirements name, to the last byte.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hippodrome._files import read_bounded, why_unreadable
from hippodrome._folders import temporary_folder
from hippodrome._processes import dying_with_me
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.process import command_words
from hippodrome.sim.method_spec import MethodSpec

INSTALL_LIMIT_S = 600.0
READY = ".ready"  # file that says that the environment is complete


MAX_REQUIREMENTS_BYTES: Final = 1 << 20


class NotInstalled(MethodError):
    """An environment cannot be made here; the message says why."""


@dataclass(frozen=True, slots=True)
class Environment:
    """What an environment is called, and what is in it."""

    name: str
    requirements: str  # of pip, each with its hashes; others are refused
    imported: str | None = None  # a module whose import shows that all works

    def python(self) -> Path:
        """Its Python. The environment is made if it is not there yet. Raises NotInstalled."""
        return ensure_environment(self, environment_folder(self))


def words_of(spec: MethodSpec, command: str, **places: Path) -> list[str]:
    """The words of a program's command, with folders and the Python of its environment in their places. Raises MethodError."""
    if spec.environment is None:
        return command_words(command, **places)
    try:
        requirements = read_bounded(spec.environment, MAX_REQUIREMENTS_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        raise NotInstalled(f"environment {spec.environment}: cannot be read: {why_unreadable(error)}") from None
    return command_words(command, python=Environment(spec.environment.stem, requirements).python(), **places)


def user_cache() -> Path:
    """The user's cache. Raises NotInstalled where there is none."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    try:
        return Path(named) if Path(named).is_absolute() else Path.home() / ".cache"  # the standard lets ignore a relative one
    except RuntimeError as error:
        raise NotInstalled(f"there is no folder for the environment: {error}; set XDG_CACHE_HOME") from None


def environment_folder(environment: Environment) -> Path:
    """Where an environment lies: in the user's cache, by what is in it. Raises NotInstalled where there is no such cache."""
    key = hashlib.sha256(f"{environment.requirements}{sys.executable}{sys.version}".encode()).hexdigest()[:12]
    return user_cache() / "hippodrome" / f"{environment.name}-{key}"


def ensure_environment(environment: Environment, folder: Path) -> Path:
    """The Python of the environment in ``folder``, which is made if it is not there. Raises NotInstalled."""
    python = folder / "bin" / "python"
    with _alone(folder.parent):
        if not (folder / READY).exists():
            _run([sys.executable, "-m", "venv", "--clear", str(folder)], "making the virtual environment")
            _install(environment, python)
            folder.chmod(0o700)  # a lax umask lets a group write below it
            (folder / READY).touch()
        for place in (folder.parent, folder):
            _require_own(place)
    return python.absolute()


def _install(environment: Environment, python: Path) -> None:
    """Install the packages, each only if it has the hash that is expected; wheels only, so that nothing is built."""
    with temporary_folder() as folder:
        requirements = folder / "requirements.txt"
        requirements.write_text(environment.requirements, encoding="utf-8")
        quiet = ["--quiet", "--disable-pip-version-check", "--no-input", "--require-hashes", "--only-binary", ":all:"]
        command = [str(python), "-m", "pip", "install", *quiet, "--requirement", str(requirements)]
        _run(command, f"installing {environment.imported or f'the requirements of {environment.name}'}")
    if environment.imported is not None:
        _run([str(python), "-c", f"import {environment.imported}"], f"importing {environment.imported}")


@contextmanager
def _alone(parent: Path) -> Iterator[None]:
    """Let one command at a time make an environment below ``parent``; others wait."""
    try:
        parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        handle = os.open(parent, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise NotInstalled(f"{parent}: no environment can be made there: {error.strerror or error}") from None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    except OSError as error:
        raise NotInstalled(f"{parent}: no environment can be made there: {error.strerror or error}") from None
    finally:
        os.close(handle)


def _require_own(place: Path) -> None:
    """Raise NotInstalled unless only the user, and the superuser, can have put there what is there."""
    status = place.stat()
    others = "group and others" if status.st_mode & stat.S_IWOTH else "its group" if status.st_mode & stat.S_IWGRP else ""
    if status.st_uid not in (os.geteuid(), 0):
        raise NotInstalled(f"{place}: belongs to another user, whose programs are not run; remove it")
    if others:
        raise NotInstalled(f"{place}: {others} may write there, so its programs are not run; chmod go-w it, or remove it")


def _run(command: list[str], what: str) -> None:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=INSTALL_LIMIT_S, check=False, preexec_fn=dying_with_me()
        )
    except subprocess.TimeoutExpired:
        raise NotInstalled(f"{what} took more than {INSTALL_LIMIT_S:.0f} s") from None
    except OSError as error:
        raise NotInstalled(f"{what} failed: {error}") from None
    if done.returncode != 0:
        lines = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
        raise NotInstalled(f"{what} failed: {lines[-1] if lines else f'exit status {done.returncode}'}")
