"""The page of one drive, ``drive.html``: its map over the network's own roads, frames, figures and what nothing vouches for."""

from __future__ import annotations

import base64
from typing import Final

import cv2
import numpy as np

from hippodrome.core.types import MatchStatus
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.eval.real.drawing import drive_map
from hippodrome.eval.real.drive import MAX_ROWS, NEXT, WORDS, Drive, marks, status_of
from hippodrome.eval.real.findings_file import place_words
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.pages import page
from hippodrome.eval.report.tables import scrolling
from hippodrome.sim.recording import Recording

FRAMES: Final = 6  # shown, evenly over the drive
FRAME_PX: Final = 480  # width of a frame on the page
JPEG_QUALITY: Final = 75
STATISTICS: Final = ("mean (m)", "median (m)", "p95 (m)", "max (m)", "samples")  # of a line of `hippodrome score`
STYLE: Final = """
.drive-map { width: 100%; height: auto; max-height: 80vh; display: block; border: 1px solid var(--line); border-radius: 10px;
  background: var(--panel); }
.drive-map .roads { fill: none; stroke: var(--road); stroke-linecap: round; stroke-linejoin: round; }
.drive-map .truth { fill: none; stroke: var(--truth); }
.drive-map .line { fill: none; stroke-linecap: round; stroke-linejoin: round; }
.drive-map text { fill: var(--ink); paint-order: stroke; stroke: var(--paper);
  font-family: system-ui, sans-serif; font-weight: 600; font-size: calc(18 * var(--pixel)); }
.legend { display: flex; flex-wrap: wrap; gap: 0.3rem 1.2rem; font-size: 0.88rem; color: var(--soft);
  padding: 0; list-style: none; }
.legend span { display: inline-block; width: 1.4rem; height: 0.3rem; border-radius: 2px; vertical-align: middle;
  margin-right: 0.4rem; }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 20rem), 1fr)); gap: 1rem; }
.frames figure { margin: 0; } .frames img { width: 100%; height: auto; display: block; border-radius: 6px; }
.words td { white-space: normal; text-align: left; min-width: 8rem; } .words th { text-align: left; }
[aria-label="figures"] :is(th, td):last-child { text-align: left; white-space: normal; min-width: 18rem; }
@media (max-width: 40rem) {
  .drive-map text { font-size: calc(34 * var(--pixel)); }
  .words thead { display: none; } .words tr { display: block; padding: 0.4rem 0; border-bottom: 1px solid var(--line); }
  .words :is(th, td) { display: block; border: 0; padding: 0.1rem 0.62rem; }
}
.notes { color: var(--soft); font-size: 0.9rem; overflow-wrap: anywhere; }
"""


def drive_page(drive: Drive) -> str:
    """The page as HTML that fetches nothing. Raises HippodromeError if frames of the recording cannot be read."""
    tone = None if (status_of(drive) == MatchStatus.MATCHED).any() else "bad"
    title = f"{drive.name} on {drive.network}"
    body = [
        element("header", element("h1", title), element("p", _summary(drive), class_=tone)),
        element(
            "main",
            _tiles(drive),
            element("h2", "The map"),
            *drive_map(drive),
            element("h2", "What could not be vouched for"),
            _refused(drive),
            element("h2", "Where the map seems wrong"),
            _findings(drive),
            element("h2", "Frames along the drive"),
            _frames(drive),
            element("h2", "Figures"),
            _figures(drive.scores),
            element("h2", "What the stages said"),
            _said(drive),
        ),
    ]
    return page(title, body, (), style=STYLE)


def _summary(drive: Drive) -> str:
    if (warning := refusal_note(drive.cognitive_map)) is not None:
        return warning[0].upper() + warning[1:] + "."
    green = "Green is where roads vouch for the map: there it is metric, in the frame of the road network."
    if not drive.breaks:
        return f"{green} They do so all along this drive."
    return f"{green} The rest has a pose, too, but nothing that vouches for it; the table below says why, and what to do."


def _tiles(drive: Drive) -> Html:
    status = status_of(drive)
    good = int(np.count_nonzero(status == MatchStatus.MATCHED))
    steps_m = np.hypot(*np.diff(drive.cognitive_map.poses[:, :2], axis=0).T)
    tiles = [
        ("vouched for", f"{100.0 * good / max(1, len(status)):.0f} %", f"{good} of {len(status)} vertices"),
        ("driven", f"{float(steps_m.sum()) / 1e3:.2f} km", f"in {float(drive.recording.samples.t_s[-1]):.0f} s"),
        (
            "not vouched for",
            _counted(len(drive.breaks), "stretch", "stretches"),
            "see below" if drive.breaks else "nothing to do",
        ),
    ]
    if drive.findings:
        tiles.append(("the map seems wrong", _counted(len(drive.findings), "place", "places"), "see below"))
    found = [(numbers, definition) for numbers, definition in map(_parted, drive.scores) if definition]
    headlines = [next((one for one in found if _is_about(one[1], words)), None) for words in (("APE",), ("RPE", "20 m"))]
    for numbers, definition in filter(None, headlines if good else []):  # no error of a map that nothing vouches for is one
        name, *how = definition.split(";")
        tiles.append((f"{name.split(',')[0]}, mean", numbers.split(",")[0].removeprefix("mean "), ";".join(how[:2]).strip()))
    shown = [(element("span", a), element("strong", b), element("small", c)) for a, b, c in tiles]
    return element("div", [element("div", *parts, class_="figure-tile") for parts in shown], class_="tiles")


def _when(first_s: float, last_s: float) -> str:
    first, last = f"{first_s:.0f}", f"{last_s:.0f}"
    return f"at {first} s" if first == last else f"{first} to {last} s"


def _counted(count: int, one: str, several: str) -> str:
    return f"{count} {one if count == 1 else several}"


def _refused(drive: Drive) -> Html:
    """Each stretch that nothing vouches for, with its cause and what to do next."""
    if not drive.breaks:
        return element("p", "Nothing: roads vouch for every vertex of this drive.", class_="good")
    t_s = drive.cognitive_map.t_s
    rows = [
        element(
            "tr",
            element("th", str(number)),
            element("td", _when(t_s[one.first_vertex], t_s[one.last_vertex])),
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


def _findings(drive: Drive) -> Html:
    """Each place where the map seems wrong, and how well the roads fit elsewhere."""
    if not (status_of(drive) == MatchStatus.MATCHED).any():
        return element("p", "Nothing vouches for this drive, so it says nothing of the map.", class_="note")
    fit = element("p", _fit_words(drive), class_="note")
    if not drive.findings:
        return joined(element("p", "Nowhere, as far as this drive can tell."), fit)
    t_s = drive.cognitive_map.t_s
    rows = [
        element(
            "tr",
            element("th", mark),
            element("td", one.words().replace("+-", "±")),
            element("td", place_words(one, drive.reference)),
            element("td", _when(t_s[one.first_vertex], t_s[one.last_vertex])),
        )
        for mark, one in zip(marks(len(drive.findings)), drive.findings[:MAX_ROWS], strict=False)
    ]
    where = "latitude, longitude" if drive.reference is not None else "place in the network"
    heads = element("tr", *(element("th", word) for word in ("on the map", "what", where, "when")))
    table = element("table", element("thead", heads), element("tbody", rows), class_="words", aria_label="the map seems wrong")
    return joined(element("div", table, class_="scroll"), element("p", "For a map editor: findings.geojson.", class_="note"), fit)


def _fit_words(drive: Drive) -> str:
    """How far the roads are drawn from where they were driven, where roads vouch for the drive."""
    if drive.map_error_m is None:
        return (
            "The roads were taken to be exact, so no road is said to be drawn in a wrong place: the network does not say where "
            "on Earth it lies, or --network-accuracy 0 was given."
        )
    median_m, most_m = drive.map_error_m
    return (
        f"Where roads vouch for the drive, half of them are drawn within {median_m:.1f} m of where they were driven, and 95 % "
        f"within {most_m:.1f} m, as the drive as a whole tells. It cannot tell whether the whole map is shifted alike."
    )


def _frames(drive: Drive) -> Html:
    recording = drive.recording
    if recording.frame_count == 0:
        return element("p", "The drive has no frames.", class_="note")
    numbers = np.unique(np.linspace(0, recording.frame_count - 1, FRAMES).round().astype(int))
    status = status_of(drive)
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


def _is_about(definition: str, words: tuple[str, ...]) -> bool:
    return all(word in definition for word in words)


def _statistics(numbers: str) -> list[str]:
    """The figures of a line of `hippodrome score`, one for each of ``STATISTICS``; "-" for one that it does not have."""
    names = [head.removesuffix(" (m)") for head in STATISTICS[:-1]]
    parts = [part.removesuffix(" m").rsplit(" ", 1) for part in numbers.split(", ")]
    named = {part[0]: part[-1] for part in parts if part[0] in names}
    rest = ", ".join(" ".join(part) for part in parts if part[0] not in names)
    return [*(named.get(name, "-") for name in names), rest.removesuffix(" samples") or "-"]


def _figures(scores: tuple[str, ...]) -> Html:
    rows = [
        element("tr", element("th", definition.partition(";")[0]), [element("td", figure) for figure in _statistics(numbers)],
                element("td", definition.partition("; ")[2]))
        for numbers, definition in map(_parted, scores)
        if definition
    ]  # fmt: skip
    words = [element("p", f"{line[:1].upper()}{line[1:]}", class_="note") for line in scores if not _parted(line)[1]]
    heads = element("tr", [element("th", word) for word in ("error", *STATISTICS, "how it is measured")])
    table = element("table", element("thead", heads), element("tbody", rows))
    return joined(scrolling(table, "figures") if rows else "", words)


def _said(drive: Drive) -> Html:
    times = ", ".join(f"{name} {'done before' if seconds is None else f'{seconds} s'}" for name, seconds in drive.stages.items())
    lines = [element("li", line) for line in drive.notes]
    return joined(element("p", f"Time: {times}.", class_="note"), element("ul", lines, class_="notes"))
