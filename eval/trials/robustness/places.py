"""Place recognition alone, on paper: recall at 99 % precision per condition and recogniser, and the curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.eval.figures.style import SERIES, new_figure, save_figure, tidy
from hippodrome.eval.trials.robustness.place_recognition import (
    MAPPED_M,
    PRECISION,
    SAME_M,
    STRUCK,
    Answers,
    curve,
    recall_at,
)

DEFINITION: Final = (
    f"recall at {100 * PRECISION:g} % precision of the looks of the localization drive; {100 * STRUCK:g} % of the places, those "
    f"farthest west, are struck from the map. A look is mapped if a place lies within {MAPPED_M:g} m, facing the same way; an "
    f"answer is right within {SAME_M:g} m (strict: {MAPPED_M:g} m). RatSLAM's template match is judged by its difference, and by "
    "the margin over the best place elsewhere, as ours is."
)
COLUMNS: Final = 4  # of the figure


@dataclass(frozen=True, slots=True, eq=False)
class PlaceResult:
    """All recognisers under one condition."""

    condition: str
    answers: tuple[Answers, ...]

    def summary(self) -> dict[str, Any]:
        """Recall, strict recall and the share of right best matches for each recogniser."""
        mapped = self.answers[0].mapped
        return {
            "condition": self.condition,
            "looks": len(mapped),
            "mapped": int(mapped.sum()),
            "recognisers": {one.method: _figures(one) for one in self.answers},
        }


def _figures(answers: Answers) -> dict[str, float]:
    return {
        "recall": recall_at(curve(answers)),
        "recall_strict": recall_at(curve(answers, strict=True)),
        "best_is_right": float(answers.right[answers.mapped].mean()) if answers.mapped.any() else 0.0,
    }


def markdown(results: Sequence[PlaceResult]) -> str:
    """One row a condition, one column a recogniser."""
    methods = [one.method for one in results[0].answers]
    lines = ["## Place recognition alone", "", f"| condition | looks (mapped) | {' | '.join(methods)} |"]
    lines.append("|---" * (len(methods) + 2) + "|")
    for result in results:
        row = result.summary()
        cells = [
            f"{100 * figures['recall']:.0f} % ({100 * figures['recall_strict']:.0f} %)" for figures in row["recognisers"].values()
        ]
        lines.append(f"| {result.condition} | {row['looks']} ({row['mapped']}) | {' | '.join(cells)} |")
    return "\n".join([*lines, "", f"{DEFINITION} In brackets: strict.", ""])


def draw_curves(path: Path, name: str, results: Sequence[PlaceResult]) -> None:
    """Precision over recall, a panel for each condition."""
    columns = min(COLUMNS, len(results))
    rows = -(-len(results) // columns)
    figure = new_figure(max(7.0, 2.6 * columns), 2.2 * rows + 0.6)
    panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    for axes in panels[len(results) :]:
        axes.set_visible(False)
    for axes, result in zip(panels, results, strict=False):
        for answers, colour in zip(result.answers, SERIES, strict=False):
            found = curve(answers)
            axes.plot(100 * found.recall, 100 * found.precision, color=colour, linewidth=1.4, label=answers.method)
        axes.axhline(100 * PRECISION, color="#777777", linewidth=0.6, linestyle=":")
        tidy(axes, "recall (%)", "precision (%)", result.condition)
        axes.set_xlim(0, 101)
        axes.set_ylim(50, 101)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    figure.suptitle(f"{name}: place recognition alone", x=0.01, ha="left", fontsize=10)
    save_figure(figure, path)
