"""A virtual environment for the tracker alone, so that its licence, its crashes and its packages stay out of ours."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError

PACKAGES = ("pyorbslam3==0.1.1", "numpy>=2.0")
INSTALL_LIMIT_S = 600.0
READY = ".ready"  # file that says that the environment is complete


class NotInstalled(HippodromeError):
    """The tracker cannot be installed here; the message says why."""


def ensure_environment(folder: Path) -> Path:
    """The Python of the environment in ``folder``, which is made if it is not there. Raises NotInstalled."""
    python = folder / "bin" / "python"
    if not (folder / READY).exists():
        _run([sys.executable, "-m", "venv", "--clear", str(folder)], "making the virtual environment")
        quiet = ["--quiet", "--disable-pip-version-check", "--no-input"]
        _run([str(python), "-m", "pip", "install", *quiet, *PACKAGES], f"installing {PACKAGES[0]}")
        _run([str(python), "-c", "import pyorbslam3"], "importing pyorbslam3")
        (folder / READY).touch()
    return python.absolute()


def _run(command: list[str], what: str) -> None:
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=INSTALL_LIMIT_S,
            check=False,
            preexec_fn=dying_with_me(),
        )
    except subprocess.TimeoutExpired:
        raise NotInstalled(f"{what} took more than {INSTALL_LIMIT_S:.0f} s") from None
    except OSError as error:
        raise NotInstalled(f"{what} failed: {error}") from None
    if done.returncode != 0:
        lines = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
        raise NotInstalled(f"{what} failed: {lines[-1] if lines else f'exit status {done.returncode}'}")
