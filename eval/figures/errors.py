"""Errors along the drive and their distributions (Fig. 3 D-I, Li et al. 2025)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.figures.style import FLOOR_M, Axes, coloured, legend_of, log_errors, new_figure, save_figure, tidy
from hippodrome.eval.metrics.trajectory import Score

VIOLIN_GRID = 200


def draw_error_profiles(path: Path, ape: Mapping[str, Score], rpe: Mapping[str, Score], title: str = "") -> None:
    """APE above, RPE below, one line per method over the time of the drive. Earlier methods have wider lines, so that none hides.

    Args:
        path: The picture.
        ape: Score by label of the method, in the order of the colours.
        rpe: The same for the RPE.
        title: Stands above the figure.
    """
    figure = new_figure(9.0, 5.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, scores, name in zip(panels, (ape, rpe), ("APE", "RPE"), strict=True):
        for place, ((method, score), colour) in enumerate(coloured(scores.items())):
            look = {"color": colour, "linewidth": max(3.0 - place, 0.8), "label": f"{method}: mean {score.mean_m:.2f} m"}
            axes.plot(score.t_s, np.maximum(score.errors_m, FLOOR_M), **look)
        tidy(axes, "", f"{name} (m)", title if name == "APE" else "")
        log_errors(axes, _together(scores))
        if scores:
            axes.legend(*legend_of(axes), loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    panels[1].set_xlabel("time (s)")
    save_figure(figure, path, for_print=True)


def draw_error_violins(path: Path, ape: Mapping[str, Score], rpe: Mapping[str, Score], title: str = "") -> None:
    """Distribution of APE and RPE per method on a logarithmic axis, with median (bar), quartiles (box) and mean (diamond).

    Arguments are those of ``draw_error_profiles``.
    """
    methods = max(len(ape), len(rpe), 1)
    figure = new_figure(2.4 + 2.2 * methods, 4.4)
    for axes, scores, name in zip(figure.subplots(1, 2), (ape, rpe), ("APE", "RPE"), strict=True):
        for place, (score, colour) in enumerate(reversed(coloured(scores.values()))):  # the last one first, as in the tables
            _violin(axes, place, score.errors_m, colour)
        tidy(axes, "", f"{name} (m)", title if name == "APE" else "")
        axes.set_xticks(range(len(scores)), [method.replace(" ", "\n", 1) for method in reversed(list(scores))], fontsize=8)
        axes.set_xlim(-0.6, len(scores) - 0.4)
        log_errors(axes, _together(scores))
    figure.supxlabel("in both: box: quartiles, line: median, diamond and number: mean", fontsize=8)
    save_figure(figure, path, for_print=True)


def _violin(axes: Axes, place: int, errors_m: FloatArray, colour: str) -> None:
    """One violin. The density is that of the errors' logarithms, so that its shape is right on the logarithmic axis."""
    logs = np.log10(np.maximum(errors_m, FLOOR_M))
    levels, density = _density(logs)
    half_width = 0.38 * density / density.max()
    axes.fill_betweenx(10.0**levels, place - half_width, place + half_width, color=colour, alpha=0.45, linewidth=0)
    low, median, high = 10.0 ** np.percentile(logs, [25.0, 50.0, 75.0])
    axes.plot([place, place], [low, high], color=colour, linewidth=5.0, solid_capstyle="butt")
    axes.plot([place - 0.12, place + 0.12], [median, median], color="white", linewidth=2.0)
    axes.plot(place, max(float(errors_m.mean()), FLOOR_M), "D", color="white", markeredgecolor="black", markersize=5)
    axes.annotate(f"{errors_m.mean():.2f}", (place + 0.1, max(float(errors_m.mean()), FLOOR_M)), fontsize=8, va="bottom")


def _density(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Levels, and the density there, by Gaussian kernels with Silverman's bandwidth, but at least 2 % of a decade."""
    width = max(1.06 * float(logs.std()) * len(logs) ** -0.2, 0.02)
    levels = np.linspace(logs.min() - 2.0 * width, logs.max() + 2.0 * width, VIOLIN_GRID)
    histogram, edges = np.histogram(logs, bins=VIOLIN_GRID)
    centres = 0.5 * (edges[1:] + edges[:-1])
    kernels = np.exp(-0.5 * ((levels[:, np.newaxis] - centres) / width) ** 2)
    return levels, kernels @ histogram


def _together(scores: Mapping[str, Score]) -> Any:
    """All errors of all methods."""
    return np.concatenate([score.errors_m for score in scores.values()]) if scores else np.zeros(0)
