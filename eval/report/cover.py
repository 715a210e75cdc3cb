"""The README's film, picture and table: ``python -m hippodrome.eval.report.cover out/eval grid``, in the README's folder."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.figures.style import BLUE, ERROR_MAP, ROAD, TRUTH, Axes, new_figure, save_figure
from hippodrome.eval.methods.method import SEMI_METRIC, TOPOMETRIC
from hippodrome.eval.report.evidence import MAP_JSON, THUMBNAILS, Layer, MapEvidence, read_map_evidence
from hippodrome.eval.report.film import draw_film
from hippodrome.eval.results import markdown
from hippodrome.eval.results.model import Row, ScenarioResult, read_results, result_of
from hippodrome.eval.results.paper_rows import quoted_rows
from hippodrome.eval.results.tables import (
    LOCALIZATION_COLUMNS,
    MAPPING_COLUMNS,
    QUOTED_NOTE,
    Column,
    row_cells,
)

SHOWN: Final = (SEMI_METRIC.label, TOPOMETRIC.label)
COLOUR_RANGE_M: Final = (0.05, 5.0)  # of the errors, from a tyre's width to a car's length
README_COLUMNS: Final = ("Method", "CPU (%)", "APE (m)", "APE SE(2) (m)", "APE Sim(2) (m)", "RPE (m)")
FRAMES: Final = 4  # shown of the drive, in two rows
FILM, PICTURE, README = Path("docs/film.webp"), Path("docs/result.png"), Path("README.md")
BEGIN, END = "<!-- table: made by hippodrome.eval.report.cover -->\n", "<!-- end of table -->"


def draw_cover(run: Path, name: str, path: Path) -> None:
    """Draw what the camera saw, the map made of it, and the same map with the road network, side by side.

    Args:
        run: Folder of a finished run.
        name: The scenario's name.
        path: The picture.

    Raises:
        HippodromeError: A file is missing or not readable, or one of the two maps failed.
    """
    evidence = read_map_evidence(run / name / MAP_JSON)
    layers = {layer.name: layer for layer in evidence.methods}
    errors_m = {row.method: row.ape.mean_m for row in result_of(read_results(run / "results.json"), name).rows if row.ape}
    if missing := [method for method in SHOWN if method not in layers or method not in errors_m]:
        raise HippodromeError(f"{run / name}: no map '{missing[0]}', for it failed; choose another scenario")
    semi_metric, topometric = (layers[method] for method in SHOWN)
    figure = new_figure(8.6, 2.75)
    seen, before, after = figure.subplots(1, 3, width_ratios=(1.22, 1.0, 1.15))
    _picture(seen, _frames(run / name / THUMBNAILS, evidence), "one camera and wheel odometry")
    _map(before, evidence, f"{SHOWN[0]}: {errors_m[SHOWN[0]]:.1f} m off in the mean")
    before.plot(semi_metric.x_m, semi_metric.y_m, ".", color=BLUE, markersize=2.2, zorder=3)
    _map(after, evidence, f"{SHOWN[1]}: {errors_m[SHOWN[1]]:.2f} m")
    after.sharex(before)
    after.sharey(before)
    bar = figure.colorbar(_dots(after, topometric), ax=after, label="error (m)", shrink=0.75, ticks=(0.1, 1.0), extend="both")
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    bar.minorticks_off()
    bar.outline.set_visible(False)
    save_figure(figure, path)


def _frames(path: Path, evidence: MapEvidence) -> Any:
    """A few frames of the sheet of thumbnails, spread evenly over the drive, as one RGB picture."""
    sheet = cv2.imread(str(path))
    if sheet is None:
        raise HippodromeError(f"{path}: no frames to show; run `hippodrome eval` again")
    tiles, width, height = evidence.thumbnails, evidence.thumbnails.width, evidence.thumbnails.height
    chosen = np.linspace(0, len(tiles.t_s) - 1, FRAMES + 2).astype(int)[1:-1]
    corners = [(height * (tile // tiles.columns), width * (tile % tiles.columns)) for tile in chosen]
    cut = [sheet[top : top + height, left : left + width, ::-1] for top, left in corners]
    return np.vstack([np.hstack(cut[:2]), np.hstack(cut[2:])])


def _picture(axes: Axes, image: Any, title: str) -> None:
    axes.imshow(image, interpolation="nearest")
    _frameless(axes, title)


def _map(axes: Axes, evidence: MapEvidence, title: str) -> None:
    """Axes with the roads and the true path."""
    roads = [np.reshape(road, (-1, 2)) for road in evidence.roads]
    axes.add_collection(LineCollection(roads, colors=ROAD, linewidths=0.8, zorder=0))
    axes.plot(evidence.truth.x_m, evidence.truth.y_m, color=TRUTH, linewidth=0.7, zorder=2)
    axes.set_aspect("equal", adjustable="box")
    _frameless(axes, title)


def _dots(axes: Axes, layer: Layer) -> Any:
    columns = zip(layer.x_m, layer.y_m, layer.error_m, strict=True)
    known = [place for place in columns if place[2] is not None]
    x_m, y_m, error_m = np.array(known).T
    return axes.scatter(x_m, y_m, c=error_m, norm=LogNorm(*COLOUR_RANGE_M), cmap=ERROR_MAP, s=5, linewidths=0, zorder=3)


def _frameless(axes: Axes, title: str) -> None:
    axes.set_anchor("N")  # the three titles in one line
    axes.set_title(title, loc="left", fontsize=8)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)


def with_table(text: str, result: ScenarioResult, quoted: Sequence[Row]) -> str:
    """A document with the part between the two marks made anew: a few columns of Table I, and the localization error."""
    columns = [
        *(column for column in MAPPING_COLUMNS if column.title in README_COLUMNS),
        Column("Localization (m)", next(column.cell for column in LOCALIZATION_COLUMNS if column.title == "Error (m)")),
    ]
    rows = (row_cells(columns, row) for row in (*result.rows, *quoted))
    table = "\n".join(markdown.table([column.title for column in columns], rows))
    before, rest = text.split(BEGIN, maxsplit=1)
    _, after = rest.split(END, maxsplit=1)
    return f"{before}{BEGIN}\n{table}\n\n{QUOTED_NOTE}.\n{END}{after}"


def main(run: Path, name: str) -> None:
    """Make film, picture and table of one scenario of a run anew, in the working directory's docs and README."""
    draw_cover(run, name, PICTURE)
    draw_film(run, name, FILM)
    result = result_of(read_results(run / "results.json"), name)
    write_atomically(README, with_table(README.read_text(encoding="utf-8"), result, quoted_rows()).encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
