"""The map on the page of a drive: an SVG of the drive over the network's own roads, and its legend."""

from __future__ import annotations

import html
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, MatchStatus, UInt8Array
from hippodrome.eval.real.drive import COLOURS, FINDING, MAX_ROWS, WORDS, Drive, marks, same_frame, status_of, truth_line
from hippodrome.eval.report.markup import Html, element, joined

MARGIN_M: Final = 60.0  # roads are drawn up to so far around the drive
MAX_POINTS: Final = 200_000  # of roads on a page; beyond, the page would be slow, and the rest is counted


def drive_map(drive: Drive) -> Iterable[Html]:
    """The map as SVG, in decimetres so that numbers are whole, and its legend."""
    poses = drive.cognitive_map.poses
    low, high = poses[:, :2].min(axis=0) - MARGIN_M, poses[:, :2].max(axis=0) + MARGIN_M
    truth = truth_line(drive)
    if truth is not None:
        low, high = np.minimum(low, truth.min(axis=0) - MARGIN_M), np.maximum(high, truth.max(axis=0) + MARGIN_M)
    width, height = (10.0 * (high - low)).round().astype(int)
    pixel = max(width, height) / 1000.0  # of a map shown 1000 pixels wide
    place = _Place(low, high)
    status = status_of(drive)
    roads, left_out = _roads(drive.roads, place)
    parts = [Html(f'<path class="roads" stroke-width="{max(25.0, 1.2 * pixel):.1f}" d="{roads}"/>')]
    if truth is not None:
        parts.append(Html(f'<path class="truth" stroke-width="{1.2 * pixel:.1f}" d="{place.line(truth)}"/>'))
    for first, last, kind in _runs(status):
        dash = "" if kind == MatchStatus.MATCHED else f' stroke-dasharray="{8 * pixel:.0f} {6 * pixel:.0f}"'
        line = place.line(poses[first : last + 1, :2])
        parts.append(Html(f'<path class="line" stroke="{COLOURS[kind]}" stroke-width="{4.5 * pixel:.1f}"{dash} d="{line}"/>'))
    for number, one in enumerate(drive.breaks[:MAX_ROWS], 1):
        parts.append(_mark(place, poses[(one.first_vertex + one.last_vertex) // 2, :2], str(number), COLOURS[one.status], pixel))
    for letter, finding in zip(marks(len(drive.findings)), drive.findings[:MAX_ROWS], strict=False):
        line = place.line(np.array(finding.points_m))
        parts.append(Html(f'<path class="line" stroke="{FINDING}" stroke-width="{9 * pixel:.1f}" opacity="0.45" d="{line}"/>'))
        third = np.array(finding.points_m[len(finding.points_m) // 3])  # in the middle a stretch without a road has its number
        parts.append(_mark(place, third, letter, FINDING, pixel))
    parts.append(_mark(place, poses[0, :2], "start", "var(--ink)", pixel))
    name = f"map of {drive.name} over the roads of {drive.network}"
    size = f'viewBox="0 0 {width} {height}" style="--pixel: {pixel:.2f}px"'
    yield Html(
        f'<svg class="drive-map" {size} role="img" aria-label="{html.escape(name)}">{joined(parts)}'
        f"{_scale_bar(width, height, pixel)}</svg>"
    )
    kinds = [kind for kind in MatchStatus if (status == kind).any()]
    legend = [_legend(COLOURS[kind], f"{WORDS[kind]}: {np.count_nonzero(status == kind)} vertices") for kind in kinds]
    if drive.findings:
        legend.append(_legend(FINDING, "the map seems wrong, by letter"))
    if truth is not None:
        legend.append(_legend("var(--truth)", "truth" if same_frame(drive) else "truth, laid on the map by one rigid fit"))
    yield element("ul", *legend, _legend("var(--road)", "roads of the map"), class_="legend")
    if left_out:
        yield element("p", f"{left_out} lanes are not drawn, for the page's sake.", class_="note")


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """From metres, y up, to decimetres of the picture, y down."""

    low: FloatArray  # (2,)
    high: FloatArray  # (2,)

    def points(self, points_m: FloatArray) -> FloatArray:
        flipped = np.stack([points_m[:, 0] - self.low[0], self.high[1] - points_m[:, 1]], axis=1)
        return (10.0 * flipped).round()

    def line(self, points_m: FloatArray) -> str:
        text = " ".join(f"{x:.0f},{y:.0f}" for x, y in self.points(points_m))
        return f"M{text}"


def _roads(roads: RoadNetwork, place: _Place) -> tuple[str, int]:
    """Lanes that touch the picture, as one path, and how many were left out because there are too many."""
    low, high = place.low, place.high
    lines, count, left_out = [], 0, 0
    for lane in range(roads.lane_count):
        points = roads.lane_points_m(lane)
        if (points.max(axis=0) < low).any() or (points.min(axis=0) > high).any():
            continue
        if count > MAX_POINTS:
            left_out += 1
            continue
        count += len(points)
        lines.append(place.line(points))
    return "".join(lines), left_out


def _runs(status: UInt8Array) -> Iterable[tuple[int, int, MatchStatus]]:
    """Stretches (first, last, status) of vertices of one status; each begins at the last vertex of the one before."""
    ends = [0, *(np.flatnonzero(np.diff(status)) + 1).tolist(), len(status)]
    for first, after in pairwise(ends):
        if after > first:
            yield max(0, first - 1), after - 1, MatchStatus(int(status[first]))


def _mark(place: _Place, point_m: FloatArray, text: str, colour: str, pixel: float) -> Html:
    ((x, y),) = place.points(point_m[None, :])
    rim = f'stroke="var(--paper)" stroke-width="{pixel:.1f}"'
    dot = f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{5 * pixel:.0f}" fill="{colour}" {rim}/>'
    return Html(dot + _label(x + 8 * pixel, y - 5 * pixel, text, pixel))


def _label(x: float, y: float, text: str, pixel: float) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" stroke-width="{3 * pixel:.1f}">{html.escape(text)}</text>'


def _scale_bar(width: int, height: int, pixel: float) -> Html:
    """A bar of a round length, about a fifth of the picture."""
    steps_m = [digit * 10**power for power in range(5) for digit in (1, 2, 5)]
    length_m = max(step for step in steps_m if step <= max(1.0, width / 50.0))
    x, y = 15 * pixel, height - 15 * pixel
    bar = f'<path d="M{x:.0f},{y:.0f}h{10 * length_m}" stroke="var(--ink)" stroke-width="{2 * pixel:.1f}"/>'
    return Html(bar + _label(x, y - 6 * pixel, f"{length_m} m", pixel))


def _legend(colour: str, text: str) -> Html:
    return element("li", element("span", style=f"background: {colour}"), text)
