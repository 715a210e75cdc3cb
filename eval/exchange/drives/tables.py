"""Text tables whose numbers read back exactly."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.recording import Recording

ODOMETRY = "odometry.csv"
ODOMETRY_HEAD = "#t_s,speed [map units/s],yaw_rate [rad/s], means since the line before"


def write_rows(path: Path, rows: Iterable[Sequence[Any]], head: str | None = None, separator: str = " ") -> None:
    """Write a text table, a line a row, below the line ``head``. Floats are printed so that they read back exactly."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [head] if head else []
    lines += [separator.join(_printed(value) for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_odometry(path: Path, recording: Recording) -> None:
    """Write the self-motion as it was sensed, which is all that a mapper may have beside the frames."""
    samples = recording.samples
    rows = zip(samples.t_s, samples.speed, samples.yaw_rate_radps, strict=True)
    write_rows(path, rows, ODOMETRY_HEAD, ",")


def flat(matrix: FloatArray) -> list[float]:
    """The numbers of a matrix, row by row."""
    return [float(value) for value in matrix.ravel()]


def _printed(value: Any) -> str:
    return repr(float(value)) if isinstance(value, float | np.floating) else str(value)
