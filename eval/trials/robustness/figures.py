"""The figures of a robustness trial: a heat map of conditions by starts, and the curves of place recognition."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.lines import Line2D

from hippodrome.eval.figures.style import ERROR_MAP, SERIES, TRUTH, VERMILION, Axes, new_figure, save_figure, tidy
from hippodrome.eval.trials.robustness.recall import PRECISION, PlaceResult, curve, recogniser_names
from hippodrome.eval.trials.robustness.sequences import ConditionResult, SequenceResult

ERROR_RANGE_M: Final = (0.2, 20.0)  # range of the heat map's colours: below is the map's own error, above is a false fix
DARK_M: Final = 2.0  # mean errors above this are drawn dark, with white text upon them: the upper half of the colours
STYLES: Final = ("-", "--", ":")  # of the lines, once there are more of them than colours
CURVE_COLUMNS: Final = 4  # panels beside one another in the figure of the curves


def draw_heat_map(path: Path, name: str, results: Sequence[ConditionResult]) -> None:
    """Mean error of each start under each condition, one row a condition. The text in a cell says after how many metres it was
    localized; it is red where there was a false fix.
    """
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
            _write_cell(axes, column, row, sequence)
    axes.set_yticks(range(len(results)), [result.name for result in results], fontsize=8)
    axes.set_xticks(range(errors_m.shape[1]), [str(column + 1) for column in range(errors_m.shape[1])], fontsize=8)
    legend = (
        "unknown start along the drive; figures: metres until localized, x: never,\n-: too little mapped road, red: a false fix"
    )
    axes.set_xlabel(legend, fontsize=8)
    axes.set_title(f"{name}: localization under other conditions", loc="left", fontsize=10)
    save_figure(figure, path, for_print=True)


def draw_curves(path: Path, name: str, results: Sequence[PlaceResult]) -> None:
    """Precision over recall of each recogniser, a panel for each condition."""
    styles = dict(zip(recogniser_names(results), product(STYLES, SERIES), strict=False))
    columns = min(CURVE_COLUMNS, len(results))
    rows = -(-len(results) // columns)
    figure = new_figure(max(7.0, 2.6 * columns), 2.2 * rows + 0.6)
    panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    for axes in panels[len(results) :]:
        axes.set_visible(False)
    lines: dict[str, Line2D] = {}
    for axes, result in zip(panels, results, strict=False):
        for answers in result.answers:
            found, (style, colour) = curve(answers), styles[answers.method]
            percent = 100 * found.recall, 100 * found.precision
            lines[answers.method] = axes.plot(*percent, color=colour, linewidth=1.4, linestyle=style)[0]
        axes.axhline(100 * PRECISION, color="#777777", linewidth=0.6, linestyle=":")
        tidy(axes, "recall (%)", "precision (%)", result.condition)
        axes.set_xlim(0, 101)
        axes.set_ylim(50, 101)
    figure.legend(lines.values(), lines, loc="outside lower center", ncols=len(lines), fontsize=8, frameon=False)
    figure.suptitle(f"{name}: place recognition alone", x=0.01, ha="left", fontsize=10)
    save_figure(figure, path, for_print=True)


def _write_cell(axes: Axes, column: int, row: int, sequence: SequenceResult) -> None:
    """The text in one cell of the heat map, in a colour that can be read on the cell's."""
    after_m = sequence.localized_after_m
    bad = sequence.false_fixes > 0
    dark = sequence.error_mean_m is not None and sequence.error_mean_m > DARK_M
    colour = VERMILION if bad else "white" if dark else TRUTH
    never = "-" if sequence.success is None else "x"
    axes.text(column, row, never if after_m is None else f"{after_m:.0f}", ha="center", va="center", fontsize=7, color=colour,
              fontweight="bold" if bad else "normal")  # fmt: skip
