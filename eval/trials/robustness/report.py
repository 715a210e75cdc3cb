"""The robustness matrix on paper: JSON, a Markdown table and a heat map of conditions by starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.localization.config import Mode
from hippodrome.core.types import FloatArray
from hippodrome.eval.figures.style import ERROR_MAP, TRUTH, VERMILION, Axes, new_figure, save_figure
from hippodrome.eval.metrics.mapped_road import MAPPED, OnMap
from hippodrome.eval.results.model import to_json
from hippodrome.eval.trials.robustness.cases import (
    Kidnapping,
    PaperSequence,
    cases_markdown,
    kidnapping_summary,
    paper_record,
    paper_summary,
)
from hippodrome.eval.trials.robustness.conditions import SAME
from hippodrome.eval.trials.robustness.places import DEFINITION as PLACE_DEFINITION
from hippodrome.eval.trials.robustness.places import PlaceResult, draw_curves
from hippodrome.eval.trials.robustness.places import markdown as places_markdown
from hippodrome.eval.trials.robustness.targets import Target, targets
from hippodrome.eval.trials.robustness.targets import markdown as targets_markdown

ELSEWHERE: Final = "another town"  # whatever is declared there is false
WITHIN_M: Final = 200.0  # a start counts as a success if the localizer is right within this distance
ERROR_RANGE_M: Final = (0.2, 20.0)  # of the heat map's colours: below is the map's own error, above is a false fix
DEFINITION: Final = (
    f"success: declared localized, and within 20 m of the truth, before {WITHIN_M:g} m of mapped road are driven; drives "
    "without a fix and with less mapped road are not judged. Error: position, declared steps on mapped road from then on, of "
    "all sequences; worst: the largest mean error of one sequence. Off the map: share of the declared steps elsewhere, by dead "
    "reckoning, and their mean error, m. False: sequences with a declared step more than 20 m wrong, on the map or off it. "
    "Localized: share of steps after the first fix that are declared. NEES: per dimension (x, y, heading), 1 is calibrated. "
    f"Sequences overlap where the drive is short; all conditions drive the same route. Mapped: {MAPPED}."
)
HEADINGS: Final = (
    "condition", "success", "error mean / p95 / worst, m", "localized after median / max, m", "off the map, error", "false",
    "localized", "NEES",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class SequenceResult:
    """One unknown start."""

    number: int  # of the start along the drive, from 1: ``--start`` runs it alone
    start: tuple[float, ...]  # true pose: m, m, rad
    on_map: OnMap
    false_fixes: int
    false_share: float  # of the declared steps
    declared: int  # steps of the whole sequence
    nees: float | None  # mean over the declared steps
    step_ms: float  # mean over all steps, process CPU time
    look_ms: float  # median of the steps that look at a frame

    @property
    def localized_after_m(self) -> float | None:
        """Metres of mapped road; None: never."""
        return self.on_map.localized_after_m

    @property
    def success(self) -> bool | None:
        """None: there was too little mapped road to tell."""
        after_m = self.localized_after_m
        if after_m is None and self.on_map.way_m < WITHIN_M:
            return None
        return after_m is not None and after_m <= WITHIN_M

    @property
    def localized_share(self) -> float | None:
        """Of the steps from the first fix on."""
        on_map = self.on_map
        return (len(on_map.errors_m) + len(on_map.off_map_errors_m)) / on_map.steps if on_map.steps else None

    @property
    def error_mean_m(self) -> float | None:
        return _mean(self.on_map.errors_m)


@dataclass(frozen=True, slots=True, eq=False)
class ConditionResult:
    """All starts under one condition, by one mode of the localizer."""

    name: str
    sequences: tuple[SequenceResult, ...]
    mode: Mode = "coupled"

    @property
    def failures(self) -> list[SequenceResult]:
        """Sequences with a false fix or, in the mapped town, without a right one in time."""
        return [one for one in self.sequences if one.false_fixes > 0 or (self.name != ELSEWHERE and one.success is False)]

    def summary(self) -> dict[str, Any]:
        """The row of the table; figures without a sample are None."""
        return {"condition": self.name, "mode": self.mode, **pooled(self.sequences)}


def pooled(sequences: Sequence[SequenceResult]) -> dict[str, Any]:
    """Figures over sequences, from their steps; None without a sample."""
    errors_m = np.concatenate([sequence.on_map.errors_m for sequence in sequences])
    off_map_m = np.concatenate([sequence.on_map.off_map_errors_m for sequence in sequences])
    after_m = [sequence.localized_after_m for sequence in sequences if sequence.localized_after_m is not None]
    declared, steps = len(errors_m) + len(off_map_m), sum(sequence.on_map.steps for sequence in sequences)
    judged = [sequence.success for sequence in sequences if sequence.success is not None]
    means_m = [mean for sequence in sequences if (mean := sequence.error_mean_m) is not None]
    nees = [(sequence.nees, sequence.declared) for sequence in sequences if sequence.nees is not None]
    return {
        "sequences": len(sequences),
        "judged": len(judged),
        "success_share": float(np.mean(judged)) if judged else None,
        "error_mean_m": _mean(errors_m),
        "error_p95_m": float(np.percentile(errors_m, 95.0)) if len(errors_m) else None,
        "worst_sequence_mean_m": max(means_m, default=None),
        "localized_after_median_m": float(np.median(after_m)) if after_m else None,
        "localized_after_max_m": max(after_m, default=None),
        "false_sequences": sum(sequence.false_fixes > 0 for sequence in sequences),
        "off_map_share": len(off_map_m) / declared if declared else None,
        "off_map_error_mean_m": _mean(off_map_m),
        "localized_share": declared / steps if steps else None,
        "nees": sum(mean * count for mean, count in nees) / sum(count for _, count in nees) if nees else None,
    }


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """All that one run of the command found."""

    results: Sequence[ConditionResult]  # by mode, then by condition; last, the coupled attractors in another town
    places: Sequence[PlaceResult]
    kidnapped: dict[str, tuple[Kidnapping, ...]]  # by condition
    paper: tuple[PaperSequence, ...]
    map_bytes: int  # on disk
    views: int  # in the map

    @property
    def bytes_per_view(self) -> float:
        return self.map_bytes / self.views

    @property
    def conditions(self) -> list[ConditionResult]:
        """Those of mode ``coupled``, in the mapped town."""
        return [result for result in self.results if result.mode == "coupled" and result.name != ELSEWHERE]

    def summary(self) -> dict[str, Any]:
        """Every figure as plain data."""
        kidnappings = [one for found in self.kidnapped.values() for one in found]
        return {
            "conditions": [_record(result) for result in self.results],
            "places": [result.summary() for result in self.places],
            "kidnapping": {name: kidnapping_summary(found) for name, found in self.kidnapped.items()},
            "kidnapping_all": kidnapping_summary(kidnappings),
            "paper_lengths": {**paper_summary(self.paper), "sequences_run": [paper_record(one) for one in self.paper]},
            "bytes_per_view": self.bytes_per_view,
            "timings": {"step_ms": self._median("step_ms"), "look_ms": self._median("look_ms")},
        }

    def targets(self) -> list[Target]:
        """Against what they must be. A declaration in another town is a false fix too."""
        data = self.summary()
        everywhere = [result.summary() for result in self.results if result.mode == "coupled"]
        mapped = pooled([one for result in self.conditions for one in result.sequences])
        measured = {**data["timings"], "bytes_per_view": self.bytes_per_view}
        return targets(mapped, everywhere, data["places"], data["paper_lengths"], data["kidnapping_all"], measured)

    def _median(self, field: str) -> float:
        return float(np.median([getattr(one, field) for result in self.conditions for one in result.sequences]))


def report(folder: Path, name: str, found: Findings) -> None:
    """Write the files and print the tables."""
    data = {"scenario": name, "definition": DEFINITION, "place_definition": PLACE_DEFINITION, **found.summary()}
    write_atomically(folder / "robustness.json", to_json(data, "robustness").encode())
    away = [result for result in found.results if result.name == ELSEWHERE]
    parts = [
        markdown(name, [*found.conditions, *away]), yardsticks(found.results), places_markdown(found.places),
        cases_markdown(found.kidnapped, found.paper), targets_markdown(found.targets()), _failures(found.results),
    ]  # fmt: skip
    text = "\n".join(parts)
    write_atomically(folder / "robustness.md", text.encode())
    draw_heat_map(folder / "robustness.png", name, [*found.conditions, *away])
    draw_curves(folder / "places.png", name, found.places)
    print(f"{text}\nwritten: {folder}/robustness.json, .md, .png, places.png")


def _record(result: ConditionResult) -> dict[str, Any]:
    starts = [
        {
            "number": sequence.number,
            "start": list(sequence.start),
            "localized_after_m": sequence.localized_after_m,
            "error_mean_m": sequence.error_mean_m,
            "off_map_error_mean_m": _mean(sequence.on_map.off_map_errors_m),
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
        cells = [result.name, *_cells(result.summary())]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", DEFINITION, ""])


def yardsticks(results: Sequence[ConditionResult]) -> str:
    """One row a mode: the same condition, and all conditions pooled."""
    lines = ["## Yardsticks, given the same injections", "", f"| mode | {' | '.join(HEADINGS[1:])} | same: error mean / p95, m |"]
    lines.append("|---" * (len(HEADINGS) + 1) + "|")
    for mode in dict.fromkeys(result.mode for result in results):
        of_mode = [result for result in results if result.mode == mode and result.name != ELSEWHERE]
        row = pooled([one for result in of_mode for one in result.sequences])
        same = next((_figures(result.summary(), "error_mean_m", "error_p95_m") for result in of_mode if result.name == SAME), "-")
        lines.append(f"| {mode} | {' | '.join([*_cells(row), same])} |")
    return "\n".join([*lines, ""])


def _cells(row: dict[str, Any]) -> list[str]:
    return [
        "-" if row["success_share"] is None else f"{100 * row['success_share']:.0f} % of {row['judged']}",
        _figures(row, "error_mean_m", "error_p95_m", "worst_sequence_mean_m"),
        _figures(row, "localized_after_median_m", "localized_after_max_m"),
        f"{_percent(row['off_map_share'])}, {_figures(row, 'off_map_error_mean_m')}",
        f"{row['false_sequences']} of {row['sequences']}",
        _percent(row["localized_share"]),
        _figures(row, "nees"),
    ]


def _failures(results: Sequence[ConditionResult]) -> str:
    """What to run again: every failed sequence of mode ``coupled``."""
    failed = [(result, one) for result in results if result.mode == "coupled" for one in result.failures]
    lines = [
        f"- {result.name}, start {one.number}: "
        + (f"{one.false_fixes} false fixes" if one.false_fixes else f"not localized within {WITHIN_M:g} m")
        + f"; again: `--conditions {result.name} --start {one.number}`"
        for result, one in failed
    ]
    return "\n".join(["## Failures", "", *(lines or ["none"]), ""])


def _figures(row: dict[str, Any], *fields: str) -> str:
    return " / ".join("-" if row[field] is None else f"{row[field]:.2f}" for field in fields)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def draw_heat_map(path: Path, name: str, results: Sequence[ConditionResult]) -> None:
    """Mean error of each start under each condition; a cross where it was never localized, red where it was false."""
    means_m = [[sequence.error_mean_m for sequence in result.sequences] for result in results]
    errors_m = np.array(means_m, dtype=np.float64)  # None, no error, becomes NaN, no colour
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
    legend = (
        "unknown start along the drive; figures: metres until localized, x: never,\n-: too little mapped road, red: a false fix"
    )
    axes.set_xlabel(legend, fontsize=8)
    axes.set_title(f"{name}: localization under other conditions", loc="left", fontsize=10)
    save_figure(figure, path)


def _cell(axes: Axes, column: int, row: int, sequence: SequenceResult) -> None:
    after_m = sequence.localized_after_m
    bad = sequence.false_fixes > 0
    dark = sequence.error_mean_m is not None and sequence.error_mean_m > 2.0  # the upper half of the colours
    colour = VERMILION if bad else "white" if dark else TRUTH
    never = "-" if sequence.success is None else "x"
    axes.text(column, row, never if after_m is None else f"{after_m:.0f}", ha="center", va="center", fontsize=7, color=colour,
              fontweight="bold" if bad else "normal")  # fmt: skip


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) else None
