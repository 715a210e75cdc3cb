"""Localization: the error over time with the localizer's own verdict, and the strip of Fig. 4 A-D, Li et al. 2025."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, Frame, LocalizationEstimate
from hippodrome.eval.figures.style import (
    BLUE,
    FAINT,
    FLOOR_M,
    GREEN,
    TRUTH,
    VERMILION,
    Axes,
    coloured,
    log_errors,
    new_figure,
    save_figure,
    tidy,
)
from hippodrome.eval.metrics.localization import FALSE_FIX_M, LocalizationScore

SHEET_SIZE = 48  # cells of a drawn grid module along each axis
RING_SIZE = 72  # cells of the drawn head-direction ring
PEAKED = 10.0  # a sheet whose maximum is so many times its mean has one sharp peak, which is marked


def draw_localization_error(
    path: Path, t_s: FloatArray, errors_m: FloatArray, localized: NDArray[np.bool_], title: str = ""
) -> None:
    """Position error over time; bands show where the localizer declared itself localized, and where it was wrong.

    Args:
        path: The picture.
        t_s: Times (N,).
        errors_m: Errors (N,).
        localized: Whether each step (N,) was declared localized.
        title: Stands above the figure.
    """
    figure = new_figure(9.0, 3.4)
    axes = figure.subplots()
    wrong = localized & (errors_m > FALSE_FIX_M)
    for chosen, colour, label in (
        (localized & ~wrong, GREEN, "localized"),
        (wrong, VERMILION, "false fix"),
        (~localized, FAINT, "not localized"),
    ):
        _bands(axes, t_s, chosen, colour, label)
    axes.plot(t_s, np.maximum(errors_m, FLOOR_M), color=TRUTH, linewidth=1.0, label="error")
    axes.axhline(FALSE_FIX_M, color=VERMILION, linewidth=0.8, linestyle="--", label=f"false fix beyond {FALSE_FIX_M:g} m")
    tidy(axes, "time (s)", "position error (m)", title)
    log_errors(axes, errors_m)
    axes.set_xlim(t_s[0], t_s[-1])
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    save_figure(figure, path, for_print=True)


def draw_localization_comparison(
    path: Path, scores: Mapping[str, LocalizationScore], title: str = "", order: Sequence[str] = ()
) -> None:
    """Position error of several methods over the same time, where each declared itself localized, with a mark at its first fix.

    Args:
        path: The picture.
        scores: Score by label of the method, at least one.
        title: Stands above the figure.
        order: Labels of methods in the order of the colours, where other figures show more methods; others follow.
    """
    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    colours = dict(coloured(dict.fromkeys([*order, *scores])))
    start_s = min(score.t_s[0] for score in scores.values())
    for method, score in scores.items():
        colour = colours[method]
        vouched_m = np.where(score.localized, np.maximum(score.errors_m, FLOOR_M), np.nan)
        mean = "never localized" if score.error_mean_m is None else f"mean {score.error_mean_m:.2f} m"
        axes.plot(score.t_s - start_s, vouched_m, color=colour, linewidth=1.2, label=f"{method}: {mean}")
        if score.initial_drive_s is not None:
            axes.axvline(score.t_s[0] - start_s + score.initial_drive_s, color=colour, linewidth=0.9, linestyle=":")
    axes.axhline(FALSE_FIX_M, color=FAINT, linewidth=0.8, linestyle="--", label=f"false fix beyond {FALSE_FIX_M:g} m")
    tidy(axes, "time since the first frame (s); dotted: first fix", "position error (m)", title)
    log_errors(axes, np.concatenate([score.errors_m[score.localized] for score in scores.values()]))
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    save_figure(figure, path, for_print=True)


def strip_steps(t_s: FloatArray, columns: int = 8) -> list[int]:
    """Numbers of up to ``columns`` of the steps at ``t_s`` (N,), evenly on a logarithmic axis, with the first and the last."""
    elapsed = t_s - t_s[0]
    first = elapsed[1] if len(elapsed) > 1 else 0.0
    wanted = np.geomspace(max(first, 1e-3), max(elapsed[-1], 2e-3), columns - 1)
    return sorted({0, *(int(i) for i in np.clip(np.searchsorted(elapsed, wanted), 0, len(t_s) - 1))})


def draw_localization_strip(
    path: Path,
    frames: Sequence[Frame],
    shown: Sequence[LocalizationEstimate],
    t_s: FloatArray,
    errors_m: FloatArray,
    module: int = 0,
    title: str = "",
) -> None:
    """Frame, grid-cell sheet and head-direction ring at a few steps, and below them the error of all steps.

    Time runs from the first step on a logarithmic axis, as in the paper, as the estimate settles in the first seconds.

    Args:
        path: The picture.
        frames: The frames of the steps that are shown.
        shown: The estimates of the steps that are shown.
        t_s: Times (N,) of all steps.
        errors_m: Errors (N,) of all steps.
        module: Which grid module is shown.
        title: Stands above the figure.
    """
    columns = len(shown)
    figure = new_figure(1.45 * columns + 0.6, 6.2)
    grid = figure.add_gridspec(4, columns, height_ratios=(1.0, 1.0, 1.0, 1.5))
    for column, (frame, estimate) in enumerate(zip(frames, shown, strict=True)):
        picture, sheet = figure.add_subplot(grid[0, column]), figure.add_subplot(grid[1, column])
        picture.imshow(frame, cmap="gray")
        picture.set_title(f"{estimate.t_s - t_s[0]:.1f} s", fontsize=9, color=GREEN if estimate.localized else FAINT)
        _sheet(sheet, grid_sheet(estimate, module))
        ring = figure.add_subplot(grid[2, column], projection="polar")
        _ring(ring, estimate)
        for axes, name in ((picture, "frame"), (sheet, f"grid cells,\nmodule {module + 1}"), (ring, "head\ndirection")):
            axes.set_xticks([])
            axes.set_yticks([])
            if column == 0:
                axes.set_ylabel(name, fontsize=8)
    _log_time_error(figure.add_subplot(grid[3, :]), shown, t_s, errors_m)
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    save_figure(figure, path)


def grid_sheet(estimate: LocalizationEstimate, module: int) -> FloatArray:
    """Activity (n, n) of one grid module: the sum of a von Mises bump on the torus per population, flat while uninformed."""
    angles = np.linspace(-np.pi, np.pi, SHEET_SIZE, endpoint=False)
    activity = np.zeros((SHEET_SIZE, SHEET_SIZE))
    for mean, reliability in zip(estimate.grid_phase_rad[module], estimate.grid_reliability[module], strict=True):
        x, y = (_bump(angles, float(mean[axis]), float(reliability[axis])) for axis in (0, 1))
        activity += np.outer(x, y)
    return activity


def head_ring(estimate: LocalizationEstimate) -> FloatArray:
    """Activity (n,) of the head-direction ring, beginning at -pi."""
    angles = np.linspace(-np.pi, np.pi, RING_SIZE, endpoint=False)
    pairs = zip(estimate.head_direction_rad, estimate.head_reliability, strict=True)
    activity: FloatArray = np.sum([_bump(angles, float(mean), float(reliability)) for mean, reliability in pairs], axis=0)
    return activity


def _bump(angles: FloatArray, mean_rad: float, reliability: float) -> FloatArray:
    """A von Mises density (n,); if it is narrow, ``reliability`` is 1/sigma^2, as in Eqs. (1)-(2), Li et al. 2025."""
    bump = np.exp(max(reliability, 0.0) * (np.cos(angles - mean_rad) - 1.0))
    density: FloatArray = bump / bump.sum()
    return density


def _sheet(axes: Axes, activity: FloatArray) -> None:
    """Draw the activity of a grid module. A sharp peak may be smaller than a cell, so a circle shows where it is."""
    axes.imshow(activity.T, origin="lower", cmap="magma", vmin=0.0)
    if activity.max() > PEAKED * activity.mean():
        x, y = np.unravel_index(int(activity.argmax()), activity.shape)
        axes.autoscale(False)  # a circle at the border is cut off; otherwise the sheet would grow to hold it
        axes.scatter([x], [y], s=90, facecolors="none", edgecolors="white", linewidths=0.9)


def _ring(axes: Any, estimate: LocalizationEstimate) -> None:
    activity = head_ring(estimate)
    angles = np.linspace(-np.pi, np.pi, RING_SIZE, endpoint=False)
    axes.bar(angles, activity / activity.max(), width=2.0 * np.pi / RING_SIZE, bottom=1.2, color=BLUE, linewidth=0)
    axes.plot(np.linspace(-np.pi, np.pi, 90), np.full(90, 1.2), color=FAINT, linewidth=0.8)
    if estimate.localized:  # before, the pose means nothing
        axes.plot([estimate.pose[2]] * 2, [0.0, 1.1], color=VERMILION, linewidth=1.5)
    axes.set_ylim(0.0, 2.3)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines["polar"].set_visible(False)


def _log_time_error(axes: Axes, shown: Sequence[LocalizationEstimate], t_s: FloatArray, errors_m: FloatArray) -> None:
    elapsed = t_s - t_s[0]
    start = max(elapsed[1] / 2.0 if len(elapsed) > 1 else 0.1, 1e-3)  # left end of the axis, where the first step is drawn
    axes.plot(np.maximum(elapsed, start), np.maximum(errors_m, FLOOR_M), color=TRUTH, linewidth=1.0)
    for estimate in shown:
        colour = GREEN if estimate.localized else FAINT
        axes.axvline(max(estimate.t_s - t_s[0], start), color=colour, linewidth=0.9, linestyle=":")
    axes.set_xscale("log")
    axes.set_xlim(start, max(elapsed[-1], 2.0 * start))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    tidy(axes, "time since the first frame (s); dotted: the columns above, green once localized", "position error (m)")
    log_errors(axes, errors_m)


def _bands(axes: Axes, t_s: FloatArray, chosen: NDArray[np.bool_], colour: str, label: str) -> None:
    """Shade each run of chosen steps, from its first step to the step after its last."""
    alpha = 0.5 if colour == VERMILION else 0.18
    changes = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(np.int8)))
    for first, stop in changes.reshape(-1, 2):
        axes.axvspan(t_s[first], t_s[min(stop, len(t_s) - 1)], color=colour, alpha=alpha, linewidth=0, label=label)
        label = "_"  # keeps further runs out of the legend
