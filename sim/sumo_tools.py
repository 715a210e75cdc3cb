"""SUMO's own programs: netconvert and netgenerate, from the ``eclipse-sumo`` package."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final

import sumo

from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError

TOOL_TIMEOUT_S: Final = 120.0  # netconvert takes 0.1 s for a generated town and some 10 s for a city


def sumo_binary(name: str) -> str:
    """Path of one of the programs in the ``eclipse-sumo`` package."""
    binary = Path(sumo.SUMO_HOME) / "bin" / (f"{name}.exe" if os.name == "nt" else name)
    if not binary.is_file():
        raise HippodromeError(f"{binary}: program missing; reinstall the Python package eclipse-sumo")
    return str(binary)


def run_tool(name: str, *options: str) -> None:
    """Runs one of SUMO's programs; its complaint becomes the error."""
    environment = {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}
    command = [sumo_binary(name), *options]
    try:
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TOOL_TIMEOUT_S,
            check=False,
            preexec_fn=dying_with_me(),
        )
    except subprocess.TimeoutExpired as error:
        raise HippodromeError(f"{name}: no answer within {TOOL_TIMEOUT_S:.0f} s; make the network smaller") from error
    if done.returncode != 0:
        raise HippodromeError(f"{name} failed ({done.returncode}): {' '.join(done.stderr.split())[:500]}")
