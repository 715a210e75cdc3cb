"""One style for all figures. Colours are Okabe and Ito's, which colour-blind readers can tell apart.

No figure uses matplotlib's global state, and the same data give the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hippodrome._files import write_atomically
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

Axes: TypeAlias = Any  # matplotlib ships no types
Item = TypeVar("Item")

ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7",
)  # fmt: skip
VIOLET = "#5b3a9e"  # in place of their black, which shows the truth here
TRUTH, ROAD, FAINT = "#222222", "#c8c8c8", "#777777"
SERIES: Final = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, SKY, VIOLET)  # of methods, in the order in which they are given
ERROR_MAP: Final = "viridis_r"  # large errors are dark, as they must stand out on white
DPI = 130
WITHOUT_DATE: Final[dict[str, dict[str, None]]] = {  # what a program usually notes in a file, by its format
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
WHOLE_LANES_M: Final = 200e3  # a network with more of them is not drawn whole: a drive would be a dot in it
WHOLE_ACROSS_M: Final = 50e3  # nor one that is wider: its parts lie far from each other
AROUND_M: Final = 300.0  # of it, lanes this far around a drive are drawn
AROUND_SHARE: Final = 0.25  # or this share of the drive's larger extent, if that is more
FLOOR_M = 0.01  # where logarithmic error axes begin


def coloured(methods: Iterable[Item]) -> list[tuple[Item, str]]:
    """Methods with their colours; from the eighth on, colours come again, as they do on the page."""
    return list(zip(methods, cycle(SERIES), strict=False))


def legend_of(axes: Axes, first: int = 0) -> tuple[list[Any], list[str]]:
    """Lines and names of a legend in the order of the tables, where the last method comes first, as it is what a run is about.

    Args:
        axes: What was drawn.
        first: How many lines are of no method, and stay in front.
    """
    lines, names = axes.get_legend_handles_labels()
    return lines[:first] + lines[first:][::-1], names[:first] + names[first:][::-1]


def new_figure(width_in: float, height_in: float) -> Any:
    """An empty figure that belongs to no display and not to matplotlib's global list of figures."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path, *, for_print: bool = False) -> None:
    """Write a figure as PNG, atomically, without date or program version in it.

    Args:
        figure: The figure.
        path: The PNG.
        for_print: Whether to write it as SVG and PDF too, beside the PNG: letters stay letters, and nothing is pixels.
    """
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    write_atomically(path, buffer.getvalue())
    if for_print:
        figure.set_layout_engine("none")  # the PNG has laid it out already
        for kind, metadata in WITHOUT_DATE.items():
            write_atomically(path.with_suffix(f".{kind}"), _drawn(figure, kind, metadata))


def _drawn(figure: Any, kind: str, metadata: dict[str, None]) -> bytes:
    """The figure as vectors; the same figure gives the same bytes."""
    buffer = BytesIO()
    with rc_context({"svg.hashsalt": "hippodrome", "svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()


def tidy(axes: Axes, x_label: str, y_label: str, title: str = "") -> None:
    """Labels with units, a light grid, no box."""
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    if title:
        axes.set_title(title, loc="left", fontsize=10)
    axes.grid(color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def log_errors(axes: Axes, errors_m: np.ndarray[Any, Any]) -> None:
    """A logarithmic error axis with plain numbers, from ``FLOOR_M`` to the power of ten above the largest error."""
    top = max(float(np.max(errors_m, initial=1.0)), 1.0)
    axes.set_yscale("log")
    axes.set_ylim(FLOOR_M, 10.0 ** np.ceil(np.log10(top)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")


def draw_network(axes: Axes, network: RoadNetwork, drive_m: FloatArray) -> None:
    """The lanes' centrelines in grey, equal scales, metres; of a large network those around a drive (N, 2 or more columns)."""
    lines = [network.lane_points_m(lane) for lane in _drawn_lanes(network, drive_m[:, :2])]
    axes.add_collection(LineCollection(lines, colors=ROAD, linewidths=1.0, zorder=0))
    frame_map(axes, "x east (m)", "y north (m)")


def _drawn_lanes(network: RoadNetwork, drive_m: FloatArray) -> IntArray:
    """All lanes of a network that is drawn whole, else those that reach into the box of the drive and its surroundings."""
    small = network.lane_lengths_m()[~network.is_internal].sum() <= WHOLE_LANES_M
    if len(drive_m) == 0 or (small and np.ptp(network.points_m, axis=0).max() <= WHOLE_ACROSS_M):
        return np.arange(network.lane_count, dtype=np.int32)
    low_m, high_m = drive_m.min(axis=0), drive_m.max(axis=0)
    around_m = max(AROUND_M, AROUND_SHARE * float((high_m - low_m).max()))
    first = network.point_start[:-1]
    least_m, most_m = (bound.reduceat(network.points_m, first, axis=0) for bound in (np.minimum, np.maximum))
    reaches = np.all((most_m >= low_m - around_m) & (least_m <= high_m + around_m), axis=1)
    return np.flatnonzero(reaches).astype(np.int32)


def frame_map(axes: Axes, x_label: str, y_label: str) -> None:
    """Axes of a map, with equal scales around all that was drawn."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    tidy(axes, x_label, y_label)
