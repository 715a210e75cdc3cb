"""Table II: ten sequences of the published lengths, each localized from an unknown start in a saved map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import BaseModel

from hippodrome._files import write_atomically
from hippodrome.core.types import Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.method import method_of
from hippodrome.eval.metrics.localization import LocalizationScore
from hippodrome.eval.results import markdown
from hippodrome.eval.results.model import LocalizationSummary, summarize_localization, to_json
from hippodrome.eval.results.paper_rows import INITIAL_TIME_MS, LOCALIZATION_ERROR_M, ORB_SLAM3, SEQUENCE_LENGTH_M, TOPOMETRIC

TABLE_TWO: Final = "table2.json"
HEAD: Final = (
    "Method",
    "Sequence",
    "Length (m)",
    "Success",
    "CPU of the first fix (ms)",
    "First fix (m driven)",
    "Error (m)",
    "False fixes",
)
QUOTED: Final = "† quoted from the paper, other drives in another simulator; not measured here"
NONE: Final = "-"


class SequenceRow(BaseModel):
    """One method on one sequence. Where it could not be run, ``failure`` says why and the figures are missing."""

    method: str
    number: int  # of the sequence, 1 to 10 as published
    length_m: float
    first_step: int | None = None  # step of the localization recording at which the sequence begins
    failure: str | None = None
    localization: LocalizationSummary | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LocalizedSequence:
    """A row of Table II, and the errors that its figures sum up, if there are any."""

    row: SequenceRow
    score: LocalizationScore | None = None


def failed_sequence(row: SequenceRow, cause: str) -> LocalizedSequence:
    """The row of a sequence that could not be run or scored."""
    return LocalizedSequence(row.model_copy(update={"failure": cause}))


def localized_sequence(
    row: SequenceRow, first_step: int, declared: Trajectory | None, score: LocalizationScore, folder: Path
) -> LocalizedSequence:
    """The row with its figures. The declared poses go to a file, for whoever wants to compute the error again.

    Args:
        row: The row without figures.
        first_step: Step of the localization recording at which the sequence begins.
        declared: The poses that the localizer declared, in the network's frame, if there are any.
        score: How well it did.
        folder: The scenario's folder.
    """
    if declared is not None:
        write_tum(_sequence_file(folder, row), declared)
    figures = {"first_step": first_step, "localization": summarize_localization(score)}
    return LocalizedSequence(row.model_copy(update=figures), score)


def write_table_two(out: Path, name: str, rows: Sequence[SequenceRow]) -> None:
    """Write ``out/table2.md``, and the rows as JSON below ``out/name``, the scenario's folder."""
    write_atomically(out / name / TABLE_TWO, to_json([row.model_dump(mode="python") for row in rows]).encode())
    write_atomically(out / "table2.md", table_two_markdown(rows).encode())


def table_two_markdown(rows: Sequence[SequenceRow]) -> str:
    """One line per method and sequence, the published figures below ours, the causes of failures below both."""
    lines = markdown.table(HEAD, [*(sequence_cells(row) for row in rows), *quoted_cells()], spaced=True)
    failures = [f"- {row.method}, sequence {row.number}: FAILED: {row.failure}" for row in rows if row.failure is not None]
    return "\n".join([*lines, "", *failures, QUOTED, ""])


def sequence_cells(row: SequenceRow) -> list[str]:
    """The cells of a row, one per heading of ``HEAD``."""
    summary = row.localization
    names = [row.method, str(row.number), f"{row.length_m:g}"]
    if summary is None:
        return [*names, "FAILED", NONE, NONE, NONE, NONE]
    figures = [_figure(value) for value in (summary.initial_time_ms, summary.initial_distance_m, summary.error_mean_m)]
    return [*names, "yes" if summary.success else "NO", *figures, str(summary.false_fixes)]


def quoted_cells() -> list[list[str]]:
    """The published table in the same columns."""
    lines = []
    for method in (ORB_SLAM3, TOPOMETRIC):
        figures = zip(SEQUENCE_LENGTH_M, INITIAL_TIME_MS[method], LOCALIZATION_ERROR_M[method], strict=True)
        for number, (length_m, time_ms, error_m) in enumerate(figures, start=1):
            lines.append([f"{method} †", str(number), f"{length_m:g}", NONE, f"{time_ms:g}", NONE, f"{error_m:g}", NONE])
    return lines


def _sequence_file(folder: Path, row: SequenceRow) -> Path:
    return folder / "sequences" / f"{method_of(row.method).stem}-{row.number}.tum"


def _figure(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f}"
