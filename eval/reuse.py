"""When a result on disk may be used again: of which code it must be, and which keys of a scenario its drives depend on."""

from __future__ import annotations

from typing import Final

from hippodrome._files import PACKAGE, code_sha256

FIGURE_CODE: Final = (  # all code that a figure in the tables comes from, as patterns below the package's folder
    "_files.py",
    "core/**/*.py",
    "sim/**/*.py",
    "proto/**/*.py",
    "eval/evaluate.py",
    "eval/contest/**/*.py",
    "eval/methods/**/*.py",
    "eval/metrics/**/*.py",
    "eval/rivals/**/*.py",
    "eval/results/**/*.py",
)
# Keys of a scenario that no drive and no recording depends on: they say how the algorithms answer, what limits their answers must
# keep, and what people should know. Two scenarios that differ only in these pose the same question and share their recordings.
DRIVE_INDEPENDENT_KEYS: Final = ("mapper", "refine", "localizer", "methods", "missions", "thresholds", "description")


def figure_code_sha256(*more: str) -> str:
    """Hash of the code that figures come from. ``more``: patterns of further code that a caller's own results depend on."""
    return code_sha256(PACKAGE, (*FIGURE_CODE, *more))
