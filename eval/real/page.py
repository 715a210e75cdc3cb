"""The page of one drive, ``drive.html``: its map over the network's own roads, frames, figures and what nothing vouches for."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from typing import Final

import cv2
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, MatchBreak, MatchStatus, Trajectory, UInt8Array
from hippodrome.eval.exchange.drives.exported import truth_of
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.eval.metrics.alignment import apply_to_positions, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.sim.recording import Recording

FRAMES: Final = 6  # shown, evenly over the drive
FRAME_PX: Final = 480  # width of a frame on the page
JPEG_QUALITY: Final = 75
MARGIN_M: Final = 60.0  # roads are drawn up to so far around the drive
MAX_POINTS: Final = 200_000  # of roads on a page; beyond, the page would be slow, and the rest is counted
MAX_ROWS: Final = 200  # refused stretches in the table
COLOURS: Final = {
    MatchStatus.MATCHED: "#1a7f4b",
    MatchStatus.AMBIGUOUS: "#c77700",
    MatchStatus.OFF_NETWORK: "#c0331b",
    MatchStatus.NO_ROUTE: "#8b3fb5",
}
WORDS: Final = {
    MatchStatus.MATCHED: "on a road that vouches for it",
    MatchStatus.AMBIGUOUS: "several places fit",
    MatchStatus.OFF_NETWORK: "no road there",
    MatchStatus.NO_ROUTE: "no route",
}
NEXT: Final = {
    MatchStatus.MATCHED: "",
    MatchStatus.AMBIGUOUS: "Drive farther and round corners, so that only one place fits, or say with --start where it began.",
    MatchStatus.OFF_NETWORK: "Look at the place: a car park or a new road is missing in the map. Take a newer or larger extract.",
    MatchStatus.NO_ROUTE: "Look at one-way streets, forbidden turns and gaps of the map there. Does the self-motion jump?",
}
STYLE: Final = """
.drive-map { width: 100%; height: auto; max-height: 80vh; display: block; border: 1px solid var(--line); border-radius: 10px;
  background: var(--panel); }
.drive-map .roads { fill: none; stroke: var(--road); stroke-linecap: round; stroke-linejoin: round; }
.drive-map .truth { fill: none; stroke: var(--truth); }
.drive-map .line { fill: none; stroke-linecap: round; stroke-linejoin: round; }
.drive-map text { fill: var(--ink); paint-order: stroke; stroke: var(--paper);
  font-family: system-ui, sans-serif; font-weight: 600; font-size: calc(15 * var(--pixel)); }
.legend { display: flex; flex-wrap: wrap; gap: 0.3rem 1.2rem; font-size: 0.88rem; color: var(--soft);
  padding: 0; list-style: none; }
.legend span { display: inline-block; width: 1.4rem; height: 0.3rem; border-radius: 2px; vertical-align: middle;
  margin-right: 0.4rem; }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 20rem), 1fr)); gap: 1rem; }
.frames figure { margin: 0; } .frames img { width: 100%; height: auto; display: block; border-radius: 6px; }
.words td { white-space: normal; text-align: left; min-width: 8rem; } .words th { text-align: left; }
@media (max-width: 40rem) {
  .drive-map text { font-size: calc(34 * var(--pixel)); }
  .words thead { display: none; } .words tr { display: block; padding: 0.4rem 0; border-bottom: 1px solid var(--line); }
  .words :is(th, td) { display: block; border: 0; padding: 0.1rem 0.62rem; }
}
.notes { color: var(--soft); font-size: 0.9rem; overflow-wrap: anywhere; }
"""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """All that the page of a drive shows."""

    name: str
    network: str  # name of the map's file
    recording: Recording
    cognitive_map: CognitiveMap  # in the network's frame
    roads: RoadNetwork
    breaks: tuple[MatchBreak, ...]
    scores: tuple[str, ...]  # lines of `hippodrome score`
    notes: tuple[str, ...]  # lines of the stages before
    stages: Mapping[str, float | None]  # seconds of each; None: done in an earlier run


def drive_page(drive: Drive) -> str:
    """The page as HTML that fetches nothing. Raises HippodromeError if frames of the recording cannot be read."""
    style = files("hippodrome.eval.report").joinpath("style.css").read_text(encoding="utf-8") + STYLE
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", f"{drive.name} on {drive.network}"),
        element("style", Html(style)),
    )
    tone = None if (_status(drive) == MatchStatus.MATCHED).any() else "bad"
    body = element(
        "body",
        element("header", element("h1", f"{drive.name} on {drive.network}"), element("p", _summary(drive), class_=tone)),
        _tiles(drive),
        element("h2", "The map"),
        *_map(drive),
        element("h2", "What could not be vouched for"),
        _refused(drive),
        element("h2", "Frames along the drive"),
        _frames(drive),
        element("h2", "Figures"),
        _figures(drive.scores),
        element("h2", "What the stages said"),
        _said(drive),
    )
    return f"<!doctype html>\n{element('html', head, body, lang='en')}\n"


def _status(drive: Drive) -> UInt8Array:
    match = drive.cognitive_map.road_match
    return match.status if match is not None else np.zeros(len(drive.cognitive_map.t_s), dtype=np.uint8)


def _summary(drive: Drive) -> str:
    if (warning := refusal_note(drive.cognitive_map)) is not None:
        return warning[0].upper() + warning[1:] + "."
    return (
        "Green is where roads vouch for the map: there it is metric, in the frame of the road network. The rest has a pose, "
        "too, but nothing that vouches for it; the table below says why, and what to do."
    )


def _tiles(drive: Drive) -> Html:
    status = _status(drive)
    good = int(np.count_nonzero(status == MatchStatus.MATCHED))
    steps_m = np.hypot(*np.diff(drive.cognitive_map.poses[:, :2], axis=0).T)
    tiles = [
        ("vouched for", f"{good / max(1, len(status)):.0%}", f"{good} of {len(status)} vertices"),
        ("driven", f"{float(steps_m.sum()) / 1e3:.2f} km", f"in {float(drive.recording.samples.t_s[-1]):.0f} s"),
        ("stretches to look at", str(len(drive.breaks)), "in the table below"),
    ]
    found = [(numbers, definition) for numbers, definition in map(_parted, drive.scores) if definition]
    for numbers, definition in found[:2] if good else []:  # an error of a map that nothing vouches for is no headline
        name, *how = definition.split(";")
        tiles.append((f"{name.split(',')[0]}, mean", numbers.split(",")[0].removeprefix("mean "), ";".join(how[:2]).strip()))
    shown = [(element("span", a), element("strong", b), element("small", c)) for a, b, c in tiles]
    return element("div", [element("div", *parts, class_="figure-tile") for parts in shown], class_="tiles")


def _map(drive: Drive) -> Iterable[Html]:
    """The map as SVG, in decimetres so that numbers are whole, and its legend."""
    poses = drive.cognitive_map.poses
    low, high = poses[:, :2].min(axis=0) - MARGIN_M, poses[:, :2].max(axis=0) + MARGIN_M
    truth = _truth_line(drive)
    if truth is not None:
        low, high = np.minimum(low, truth.min(axis=0) - MARGIN_M), np.maximum(high, truth.max(axis=0) + MARGIN_M)
    width, height = (10.0 * (high - low)).round().astype(int)
    pixel = max(width, height) / 1000.0  # of a map shown 1000 pixels wide
    place = _Place(low, high)
    status = _status(drive)
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
    parts.append(_mark(place, poses[0, :2], "start", "var(--ink)", pixel))
    name = f"map of {drive.name} over the roads of {drive.network}"
    size = f'viewBox="0 0 {width} {height}" style="--pixel: {pixel:.2f}px"'
    yield Html(
        f'<svg class="drive-map" {size} role="img" aria-label="{html.escape(name)}">{joined(parts)}'
        f"{_scale_bar(width, height, pixel)}</svg>"
    )
    kinds = [kind for kind in MatchStatus if (status == kind).any()]
    legend = [_legend(COLOURS[kind], f"{WORDS[kind]}: {np.count_nonzero(status == kind)} vertices") for kind in kinds]
    if truth is not None:
        legend.append(_legend("var(--truth)", "truth" if _same_frame(drive) else "truth, laid on the map by one rigid fit"))
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


def _same_frame(drive: Drive) -> bool:
    return bool(drive.recording.manifest.get("truth_frame", "network") == "network")


def _truth_line(drive: Drive) -> FloatArray | None:
    """True positions (N, 2) over the map: as they are if they have the network's frame, else after a rigid fit to the map."""
    truth = truth_of(drive.recording)
    if truth is None:
        return None
    if _same_frame(drive):
        return truth.poses[:, :2]
    estimate = Trajectory(drive.cognitive_map.t_s, drive.cognitive_map.poses)
    try:
        pairs = associate(estimate, truth, min_coverage=0.0)
        fit = find_alignment("se2", pairs.reference, pairs.estimate)
        return apply_to_positions(fit, truth.poses[:, :2])
    except (HippodromeError, ValueError):
        return None  # too little of the truth is known; the score says so


def _refused(drive: Drive) -> Html:
    """Each stretch that nothing vouches for, with its cause and what to do next."""
    if not drive.breaks:
        return element("p", "Nothing: roads vouch for every vertex of this drive.", class_="good")
    t_s = drive.cognitive_map.t_s
    rows = [
        element(
            "tr",
            element("th", str(number)),
            element("td", f"{t_s[one.first_vertex]:.0f} to {t_s[one.last_vertex]:.0f} s"),
            element("td", f"{WORDS[one.status]}: {one.cause}"),
            element("td", NEXT[one.status]),
        )
        for number, one in enumerate(drive.breaks[:MAX_ROWS], 1)
    ]
    heads = element("tr", *(element("th", word) for word in ("on the map", "when", "why", "what to do next")))
    table = element("table", element("thead", heads), element("tbody", rows), class_="words", aria_label="not vouched for")
    more = len(drive.breaks) - MAX_ROWS
    rest = element("p", f"{more} more are in refinement.json.", class_="note") if more > 0 else Html("")
    return joined(element("div", table, class_="scroll"), rest)


def _frames(drive: Drive) -> Html:
    recording = drive.recording
    if recording.frame_count == 0:
        return element("p", "The drive has no frames.", class_="note")
    numbers = np.unique(np.linspace(0, recording.frame_count - 1, FRAMES).round().astype(int))
    status = _status(drive)
    figures = []
    for number in numbers:
        t_s = float(recording.samples.t_s[recording.samples.frame_steps[number]])
        vertex = int(np.clip(np.searchsorted(drive.cognitive_map.t_s, t_s, "right") - 1, 0, len(status) - 1))
        words = f"{t_s:.0f} s: {WORDS[MatchStatus(int(status[vertex]))]}"
        image = element("img", src=_data_url(recording, int(number)), alt=f"frame at {t_s:.0f} s", loading="lazy")
        figures.append(element("figure", image, element("figcaption", words)))
    return element("div", figures, class_="frames")


def _data_url(recording: Recording, number: int) -> str:
    frame = recording.frame(number)
    scale = min(1.0, FRAME_PX / frame.shape[1])
    size = max(1, round(frame.shape[1] * scale)), max(1, round(frame.shape[0] * scale))
    small = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", small[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg.tobytes()).decode()}"


def _parted(line: str) -> tuple[str, str]:
    """The numbers and the definition of a line of `hippodrome score`; no definition where it is a line of words."""
    numbers, _, definition = line.partition(": ")
    return (numbers, definition) if line.startswith("mean ") else (line, "")


def _figures(scores: tuple[str, ...]) -> Html:
    rows = [
        element("tr", element("td", numbers), element("td", definition))
        for numbers, definition in map(_parted, scores)
        if definition
    ]
    words = [element("p", line, class_="note") for line in scores if not _parted(line)[1]]
    heads = element("tr", element("th", "error"), element("th", "what is measured"))
    table = element("table", element("thead", heads), element("tbody", rows), class_="words", aria_label="figures")
    return joined(element("div", table, class_="scroll") if rows else "", words)


def _said(drive: Drive) -> Html:
    times = ", ".join(f"{name} {'done before' if seconds is None else f'{seconds} s'}" for name, seconds in drive.stages.items())
    lines = [element("li", line) for line in drive.notes]
    return joined(element("p", f"Time: {times}.", class_="note"), element("ul", lines, class_="notes"))
