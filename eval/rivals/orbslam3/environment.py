"""A virtual environment for the tracker alone, so that its licence, its crashes and its packages stay out of ours.

It lies in the user's cache, not among the results: a folder of results may come from somebody else, and what is in the
environment is run. Its packages are those that ``REQUIREMENTS`` names, to the last byte.
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
from pathlib import Path
from typing import Final

from hippodrome._folders import temporary_folder
from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError

# The wheels of CPython 3.11, 3.12 and 3.13 on x86_64; there are no others of the tracker. NumPy's version is constraints.txt's.
REQUIREMENTS: Final = """\
pyorbslam3==0.1.1 \\
    --hash=sha256:dbbc0ae582b0aec75dd02935b19873dce23c3899e25ee358d58b66c80ea81288 \\
    --hash=sha256:5566ee8a36bbc262dd62f8d27256d4b19d9ea54ad8beb9e16c93ae544f7c1746 \\
    --hash=sha256:daa786c8dcd86122bdbf1072733fa1ac5a7b306e220de25580c932662b994be0
numpy==2.4.6 \\
    --hash=sha256:89cd468399cfd2504718f0ba50e410dca55a170b61a02ad92bb18c8a65186e93 \\
    --hash=sha256:90f9849678c75fe7afa2d348ac842c168b0a4d3d61919687216dfc547976d853 \\
    --hash=sha256:a7830bab239b79cda9c08c2da014761cafb48da6150e1da17ac06283f43b6089
"""
INSTALL_LIMIT_S = 600.0
READY = ".ready"  # file that says that the environment is complete


class NotInstalled(HippodromeError):
    """The tracker cannot be installed here; the message says why."""


def environment_folder() -> Path:
    """Where the environment lies: in the user's cache, by what is in it. Raises NotInstalled where there is no such cache."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    try:
        cache = Path(named) if Path(named).is_absolute() else Path.home() / ".cache"  # the standard lets ignore a relative one
    except RuntimeError as error:
        raise NotInstalled(f"there is no folder for the environment: {error}; set XDG_CACHE_HOME") from None
    key = hashlib.sha256(f"{REQUIREMENTS}{sys.executable}{sys.version}".encode()).hexdigest()[:12]
    return cache / "hippodrome" / f"orb-slam3-{key}"


def ensure_environment(folder: Path) -> Path:
    """The Python of the environment in ``folder``, which is made if it is not there. Raises NotInstalled."""
    python = folder / "bin" / "python"
    with _alone(folder.parent):
        if not (folder / READY).exists():
            _run([sys.executable, "-m", "venv", "--clear", str(folder)], "making the virtual environment")
            _install(python)
            folder.chmod(0o700)  # a lax umask lets a group write below it
            (folder / READY).touch()
        for place in (folder.parent, folder):
            _require_own(place)
    return python.absolute()


def _install(python: Path) -> None:
    """Install the packages, each only if it has the hash that is expected; wheels only, so that nothing is built."""
    with temporary_folder() as folder:
        requirements = folder / "requirements.txt"
        requirements.write_text(REQUIREMENTS, encoding="utf-8")
        quiet = ["--quiet", "--disable-pip-version-check", "--no-input", "--require-hashes", "--only-binary", ":all:"]
        _run([str(python), "-m", "pip", "install", *quiet, "--requirement", str(requirements)], "installing pyorbslam3")
    _run([str(python), "-c", "import pyorbslam3"], "importing pyorbslam3")


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
