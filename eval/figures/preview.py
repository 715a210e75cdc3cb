"""A scenario before it is run: the network, where the two drives go, and what is driven more than once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray
from hippodrome.eval.figures.style import BLUE, GREEN, ORANGE, VERMILION, draw_network, new_figure, save_figure

VISIT_COLOURS = (BLUE, GREEN, ORANGE)  # of roads that are driven once, twice, more often
VISIT_LABELS = ("mapping, once", "twice", "more often")


def draw_preview(
    path: Path, network: RoadNetwork, mapping_m: FloatArray, visits: IntArray, second_m: FloatArray, title: str
) -> None:
    """The mapping drive, coloured by how often its road is driven, and the second drive.

    Args:
        path: The picture.
        network: The road network, drawn in grey.
        mapping_m: The mapping drive (N, 2 or more columns).
        visits: How often the road of each of its steps (N,) is driven.
        second_m: The second drive (M, 2 or more columns).
        title: Stands above the figure.
    """
    figure = new_figure(7.6, 7.0)
    axes = figure.subplots()
    draw_network(axes, network, np.concatenate([mapping_m[:, :2], second_m[:, :2]]))
    steps = np.stack([mapping_m[:-1, :2], mapping_m[1:, :2]], axis=1)
    often = np.clip(visits[1:], 1, len(VISIT_COLOURS))
    for times, (colour, label) in enumerate(zip(VISIT_COLOURS, VISIT_LABELS, strict=True), start=1):
        chosen = often == times
        if np.any(chosen):
            axes.add_collection(
                LineCollection(list(steps[chosen]), colors=colour, linewidths=1.0 + 0.8 * times, label=label, zorder=times)
            )
    axes.plot(
        second_m[:, 0], second_m[:, 1], color=VERMILION, linewidth=1.0, linestyle=(0, (4, 2)), label="localization", zorder=5
    )
    for drive_m, colour, label in ((mapping_m, BLUE, "starts"), (second_m, VERMILION, "_")):
        axes.plot(*drive_m[0, :2], "o", color=colour, markeredgecolor="white", markersize=9, label=label, zorder=6)
    axes.autoscale_view()
    axes.set_title(title, loc="left", fontsize=10)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
    save_figure(figure, path)
