"""The robustness matrix on paper: JSON, a Markdown table and a heat map of conditions by starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.figures.style import ERROR_MAP, TRUTH, VERMILION, Axes, new_figure, save_figure
from hippodrome.eval.results import to_json
from hippodrome.proto.atomic import write_atomically

WITHIN_M: Final = 200.0  # a start counts as a success if the localizer is right within this distance
ERROR_RANGE_M: Final = (0.2, 20.0)  # of the heat map's colours: below is the map's own error, above is a false fix
DEFINITION: Final = (
    f"success: declared localized, and within 20 m of the truth, before {WITHIN_M:g} m are driven. Error: position, declared "
    "steps from then on, pooled over sequences; worst: the largest mean error of one sequence. False: sequences with a declared "
    "step more than 20 m wrong. Localized: share of steps after the first fix that are declared. NEES: per dimension (x, y, "
    "heading), 1 is calibrated. Sequences overlap where the drive is short; all conditions drive the same route."
)
HEADINGS: Final = (
    "condition", "success", "error mean / p95 / worst, m", "localized after median / max, m", "false", "localized", "NEES",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class SequenceResult:
    """One unknown start."""

    start: tuple[float, ...]  # true pose: m, m, rad
    localized_after_m: float | None  # metres driven, None: never
    errors_m: FloatArray  # declared steps from the first fix on
    false_fixes: int
    false_share: float  # of the declared steps
    steps: int  # from the first fix on; the declared ones have an error
    declared: int  # steps of the whole sequence
    nees: float | None  # mean over the declared steps

    @property
    def success(self) -> bool:
        return self.localized_after_m is not None and self.localized_after_m <= WITHIN_M

    @property
    def localized_share(self) -> float | None:
        """Of the steps from the first fix on."""
        return len(self.errors_m) / self.steps if self.steps else None

    @property
    def error_mean_m(self) -> float | None:
        return float(self.errors_m.mean()) if len(self.errors_m) else None


@dataclass(frozen=True, slots=True, eq=False)
class ConditionResult:
    """All starts under one condition."""

    name: str
    sequences: tuple[SequenceResult, ...]

    def summary(self) -> dict[str, Any]:
        """The row of the table; figures without a sample are None."""
        errors_m = np.concatenate([sequence.errors_m for sequence in self.sequences])
        after_m = [sequence.localized_after_m for sequence in self.sequences if sequence.localized_after_m is not None]
        steps = sum(sequence.steps for sequence in self.sequences)
        means_m = [mean for sequence in self.sequences if (mean := sequence.error_mean_m) is not None]
        nees = [(sequence.nees, sequence.declared) for sequence in self.sequences if sequence.nees is not None]
        return {
            "condition": self.name,
            "sequences": len(self.sequences),
            "success_share": float(np.mean([sequence.success for sequence in self.sequences])),
            "error_mean_m": float(errors_m.mean()) if len(errors_m) else None,
            "error_p95_m": float(np.percentile(errors_m, 95.0)) if len(errors_m) else None,
            "worst_sequence_mean_m": max(means_m, default=None),
            "localized_after_median_m": float(np.median(after_m)) if after_m else None,
            "localized_after_max_m": max(after_m, default=None),
            "false_sequences": sum(sequence.false_fixes > 0 for sequence in self.sequences),
            "localized_share": len(errors_m) / steps if steps else None,
            "nees": sum(mean * count for mean, count in nees) / sum(count for _, count in nees) if nees else None,
        }


def report(folder: Path, name: str, results: Sequence[ConditionResult]) -> None:
    """Write the three files and print the table."""
    data = {"scenario": name, "definition": DEFINITION, "conditions": [_record(result) for result in results]}
    write_atomically(folder / "robustness.json", to_json(data, "robustness").encode())
    text = markdown(name, results)
    write_atomically(folder / "robustness.md", text.encode())
    draw_heat_map(folder / "robustness.png", name, results)
    print(f"{text}\nwritten: {folder}/robustness.json, .md, .png")


def _record(result: ConditionResult) -> dict[str, Any]:
    starts = [
        {
            "start": list(sequence.start),
            "localized_after_m": sequence.localized_after_m,
            "error_mean_m": sequence.error_mean_m,
            "false_fixes": sequence.false_fixes,
            "false_share": sequence.false_share,
            "localized_share": sequence.localized_share,
            "nees": sequence.nees,
        }
        for sequence in result.sequences
    ]
    return {**result.summary(), "starts": starts}


def markdown(name: str, results: Sequence[ConditionResult]) -> str:
    """One row a condition."""
    lines = [f"# Localization under other conditions: {name}", "", f"| {' | '.join(HEADINGS)} |", "|---" * len(HEADINGS) + "|"]
    for result in results:
        row = result.summary()
        cells = [
            result.name,
            f"{100 * row['success_share']:.0f} %",
            _figures(row, "error_mean_m", "error_p95_m", "worst_sequence_mean_m"),
            _figures(row, "localized_after_median_m", "localized_after_max_m"),
            f"{row['false_sequences']} of {row['sequences']}",
            _percent(row["localized_share"]),
            _figures(row, "nees"),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", DEFINITION, ""])


def _figures(row: dict[str, Any], *fields: str) -> str:
    return " / ".join("-" if row[field] is None else f"{row[field]:.2f}" for field in fields)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def draw_heat_map(path: Path, name: str, results: Sequence[ConditionResult]) -> None:
    """Mean error of each start under each condition; a cross where it was never localized, red where it was false."""
    errors_m = np.array([[_or_nan(sequence.error_mean_m) for sequence in result.sequences] for result in results])
    figure = new_figure(3.2 + 0.55 * errors_m.shape[1], 1.6 + 0.32 * len(results))
    axes = figure.subplots()
    low, high = np.log10(ERROR_RANGE_M)
    image = axes.imshow(np.log10(np.maximum(errors_m, ERROR_RANGE_M[0])), cmap=ERROR_MAP, vmin=low, vmax=high, aspect="auto")
    bar = figure.colorbar(image, ax=axes)
    bar.set_label("mean error (m)", fontsize=8)
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{10.0**value:.2g}")
    for row, result in enumerate(results):
        for column, sequence in enumerate(result.sequences):
            _cell(axes, column, row, sequence)
    axes.set_yticks(range(len(results)), [result.name for result in results], fontsize=8)
    axes.set_xticks(range(errors_m.shape[1]), [str(column + 1) for column in range(errors_m.shape[1])], fontsize=8)
    axes.set_xlabel("unknown start along the drive; figures: metres until localized, x: never, red: a false fix", fontsize=8)
    axes.set_title(f"{name}: localization under other conditions", loc="left", fontsize=10)
    save_figure(figure, path)


def _cell(axes: Axes, column: int, row: int, sequence: SequenceResult) -> None:
    after_m = sequence.localized_after_m
    bad = sequence.false_fixes > 0
    dark = sequence.error_mean_m is not None and sequence.error_mean_m > 2.0  # the upper half of the colours
    colour = VERMILION if bad else "white" if dark else TRUTH
    axes.text(column, row, "x" if after_m is None else f"{after_m:.0f}", ha="center", va="center", fontsize=7, color=colour,
              fontweight="bold" if bad else "normal")  # fmt: skip


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value
