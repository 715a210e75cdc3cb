"""Maps: over ground truth, as built, and coloured by error (Fig. 3 A-C, Li et al. 2025)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.ticker import LogLocator

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, EdgeKind, FloatArray
from hippodrome.eval.figures.style import (
    BLUE,
    ERROR_MAP,
    ORANGE,
    ROAD,
    TRUTH,
    VERMILION,
    coloured,
    draw_network,
    frame_map,
    legend_of,
    new_figure,
    save_figure,
)

DOT_SIZES = 5.5, 3.0  # of the first and the last map, in points
LEGEND_SIZE = 8.0  # of the dots in the legend, in points
ERROR_RANGE_M = 0.05, 5.0  # of the colours; the same in every picture, so that pictures can be compared by eye


def draw_maps_over_truth(
    path: Path, network: RoadNetwork, truth_m: FloatArray, maps_m: Mapping[str, FloatArray], title: str = ""
) -> None:
    """Vertices of several maps over the driven path, on the network in grey.

    Args:
        path: The picture.
        network: The road network.
        truth_m: The driven path (T, 2 or more columns).
        maps_m: Positions (N, 2 or more columns) by label of the method, in the order of the colours.
        title: Stands above the figure.
    """
    figure = new_figure(7.2, 6.4)
    axes = figure.subplots()
    draw_network(axes, network, truth_m)
    axes.plot(truth_m[:, 0], truth_m[:, 1], color=TRUTH, linewidth=0.9, label="ground truth", zorder=2.5)
    sizes = np.linspace(*DOT_SIZES, len(maps_m))  # good maps cover one another, so smaller dots of later ones leave a rim
    for ((name, positions_m), colour), size in zip(coloured(maps_m.items()), sizes, strict=True):
        axes.plot(positions_m[:, 0], positions_m[:, 1], ".", color=colour, markersize=size, alpha=0.8, label=name, zorder=3)
    axes.autoscale_view()
    axes.set_title(title, loc="left", fontsize=10)
    _legend_below(figure, *legend_of(axes, first=1))
    save_figure(figure, path, for_print=True)


def draw_cognitive_map(path: Path, cognitive_map: CognitiveMap, title: str = "") -> None:
    """Vertices, odometry edges and loop closures of a map in its own frame (Fig. 3A)."""
    figure = new_figure(7.2, 6.4)
    axes = figure.subplots()
    unit = "m" if cognitive_map.frame == "network" else "map units"
    edges, positions = cognitive_map.edges, cognitive_map.poses[:, :2]
    ends = np.stack([positions[edges.source], positions[edges.target]], axis=1)
    is_closure = edges.kind == EdgeKind.CLOSURE
    for chosen, colour, width, label in (
        (~is_closure, ROAD, 1.2, "odometry edge"),
        (is_closure, ORANGE, 0.9, "loop closure"),
    ):
        name = f"{label} ({np.count_nonzero(chosen):,})"
        axes.add_collection(LineCollection(list(ends[chosen]), colors=colour, linewidths=width, label=name, zorder=1))
    axes.plot(positions[:, 0], positions[:, 1], ".", color=BLUE, markersize=3.0, label=f"vertex ({len(positions):,})", zorder=2)
    if len(positions):
        axes.plot(*positions[0], "*", color=VERMILION, markeredgecolor="white", markersize=14, label="start", zorder=3)
    frame_map(axes, f"x ({unit})", f"y ({unit})")
    axes.set_title(title, loc="left", fontsize=10)
    _legend_below(figure, *axes.get_legend_handles_labels())
    save_figure(figure, path, for_print=True)


def draw_error_map(
    path: Path, network: RoadNetwork, positions_m: FloatArray, errors_m: FloatArray, title: str = "", label: str = "APE (m)"
) -> None:
    """Positions coloured by their error, on a logarithmic scale that is the same in all pictures (Fig. 3C).

    Args:
        path: The picture.
        network: The road network, drawn in grey.
        positions_m: Positions (N, 2 or more columns).
        errors_m: Errors (N,).
        title: Stands above the figure.
        label: Stands beside the scale.
    """
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots()
    draw_network(axes, network, positions_m)
    order = np.argsort(errors_m, kind="stable")  # the worst on top
    dots = axes.scatter(
        positions_m[order, 0],
        positions_m[order, 1],
        c=np.maximum(errors_m[order], ERROR_RANGE_M[0]),
        norm=LogNorm(*ERROR_RANGE_M),
        cmap=ERROR_MAP,
        s=12,
        linewidths=0,
        zorder=3,
    )
    ticks = LogLocator(subs=(1.0, 2.0, 5.0))
    bar = figure.colorbar(dots, ax=axes, label=label, shrink=0.8, extend="both", ticks=ticks)
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    bar.minorticks_off()
    bar.outline.set_visible(False)
    axes.set_title(title, loc="left", fontsize=10)
    save_figure(figure, path, for_print=True)


def _legend_below(figure: Any, lines: list[Any], names: list[str]) -> None:
    """A legend below the map, where it hides no road."""
    legend = figure.legend(lines, names, loc="outside lower center", ncols=4, frameon=False)
    for handle in legend.get_lines():
        handle.set_markersize(LEGEND_SIZE)  # however small the dots are in the map, their colour must be seen here
