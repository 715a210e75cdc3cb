"""Memory of a method that shares our process: what the process grew by while it ran, and what its libraries hold.

A process of its own would tell it exactly, and ``hippodrome baselines`` measures so, at the price of running every method twice.
Linux lets a process forget the most memory that it held, so that what it holds at most from then on is known without any cost.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._native import give_back_memory
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.types import Observation

FORGET: Final = Path("/proc/self/clear_refs")
FORGET_PEAK: Final = "5"  # what is written there, see proc(5)
STATUS: Final = Path("/proc/self/status")
ALONE: Final = (sys.executable, "-m", "hippodrome.eval.methods.memory")
FRAMES: Final = 20  # of noise, that make the mapper load its compiled functions


class Growth:
    """What the process holds more than when this was made, at most."""

    def __init__(self) -> None:
        give_back_memory()  # what was freed before would be filled again unseen
        self._before_bytes = _figure_bytes("VmRSS") if _forget_peak() else None

    def as_if_alone_bytes(self) -> int | None:
        """The most memory that a process with the libraries alone would have held, had it done the same; None where unknown."""
        peak_bytes, libraries_bytes = _figure_bytes("VmHWM"), held_by_libraries()
        if self._before_bytes is None or peak_bytes is None or libraries_bytes is None:
            return None
        return libraries_bytes + max(peak_bytes - self._before_bytes, 0)


@cache
def held_by_libraries() -> int | None:
    """What a process holds that has loaded the libraries of our methods, and done next to nothing; found once by starting one."""
    try:
        done = subprocess.run(ALONE, capture_output=True, text=True, timeout=60.0, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return _figure_of(done.stdout, "VmHWM")


def _forget_peak() -> bool:
    """Whether the most memory that was held could be forgotten."""
    try:
        FORGET.write_text(FORGET_PEAK)
    except OSError:
        return False
    return True


def _figure_bytes(name: str) -> int | None:
    try:
        return _figure_of(STATUS.read_text(), name)
    except OSError:
        return None


def _figure_of(status: str, name: str) -> int | None:
    """A figure of the text of a process's status; None if it has none."""
    _, found, rest = status.partition(f"{name}:")
    return 1024 * int(rest.split()[0]) if found else None


def main() -> None:
    """Load what a mapper loads, with a few frames of noise, and print the status of this process."""
    mapper, rng = Mapper(MapperConfig()), np.random.default_rng(0)
    for i in range(FRAMES):
        mapper.step(Observation(0.1 * (i + 1), 0.1, 5.0, 0.1, rng.integers(0, 256, (120, 160, 3), dtype=np.uint8)))
    mapper.finish()
    print(STATUS.read_text())


if __name__ == "__main__":
    main()
