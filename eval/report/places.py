"""Why is it wrong here? The places at which a map or a localizer is worst, with what was seen and known there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final
from urllib.parse import quote

from hippodrome.eval.methods.method import method_of
from hippodrome.eval.report.belief import Belief, worst_steps
from hippodrome.eval.report.candidates import ViewCandidate
from hippodrome.eval.report.evidence import Layer, MapEvidence, Thumbnails
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.why import WITHIN_95, Place

SCORES: Final = (
    "A score says by how many standard deviations a stored view resembles the frame more than all stored views do in the mean; "
    "evidence adds up the scores of views in a row, along the streets."
)
FRAME_LABEL: Final = "camera frame at {:.1f} s"
NBSP: Final = "\N{NO-BREAK SPACE}"


def mapping_places(files: ScenarioFiles, town: str) -> Html | None:
    """Where each method in the network's frame is worst on the first drive; buttons show the places on the map below."""
    evidence = files.evidence
    if evidence is None:
        return None
    known = {(place.method, place.vertex): place for place in files.why.places} if files.why else {}
    layers = [layer for layer in evidence.methods if method_of(layer.name, layer.frame).frame == "network"]
    groups = []
    for layer in reversed(layers):  # in the order of the tables
        cards = [_vertex(layer, vertex, evidence, known.get((layer.name, vertex)), town, files) for vertex in layer.worst]
        groups.append(element("div", element("h4", f"{layer.name}, first drive"), element("div", cards, class_="cards")))
    return joined(groups)


def localization_places(files: ScenarioFiles, town: str) -> Html | None:
    """Where each localizer was worst while it said that it was localized: the frame beside the view that fired."""
    if files.second is None or files.evidence is None:
        return None
    groups = [
        element("div", element("h4", f"{belief.name}, second drive"), element("div", cards, class_="cards pairs"))
        for belief in reversed(files.second.beliefs)
        if (cards := [_step(belief, step, files.second.frames, files.evidence, town, files) for step in worst_steps(belief)])
    ]
    return joined(element("p", SCORES, class_="note"), *groups) if groups else None


def _vertex(layer: Layer, vertex: int, evidence: MapEvidence, place: Place | None, town: str, files: ScenarioFiles) -> Html:
    t_s, error_m = layer.t_s[vertex], layer.error_m[vertex] or 0.0
    when = f"vertex {vertex}, {t_s:.1f}{NBSP}s into the drive"
    words = joined(element("strong", f"{error_m:.2f}{NBSP}m off"), element("small", when))
    tile = frame_tile(evidence.thumbnails, t_s) if files.thumbnails else None
    button = element("button", tile, words, type="button", class_="goto card",
                     data_method=layer.name, data_vertex=vertex, title="Show on the map")  # fmt: skip
    link = _link(town, 1, t_s, layer.name)
    return element("div", button, _list(_vertex_facts(place)) if place else None, link, class_="place")


def _vertex_facts(place: Place) -> list[str]:
    """What the map says of a vertex, a line each."""
    along = f", {place.position_m:.0f}{NBSP}m along it" if place.position_m is not None else ""
    lane = f" to lane {_lane(place.lane)}{along}" if place.lane is not None else ""
    facts = [
        f"Matched{lane}." if place.status == "matched" else f"Nothing vouches for this place: road match {place.status}{lane}."
    ]
    if place.sure_m is not None:
        facts.append(f"The map says that it is 95{NBSP}% sure within {place.sure_m:.2f}{NBSP}m.")
    if place.since_closure_m is None or place.closed_with_s is None:
        facts.append("No loop had been closed before.")
    else:
        is_here, far = place.since_closure_m == 0.0, f"{place.since_closure_m:.0f}{NBSP}m before"
        closed = "A loop is closed here" if is_here else f"The last loop was closed {far}"
        facts.append(f"{closed}, with the view stored at {place.closed_with_s:.1f}{NBSP}s.")
    if place.lanes:
        facts.append(f"Other lanes: {'; '.join(f'{_lane(one.lane)}, {one.apart_m:.1f}{NBSP}m away' for one in place.lanes)}.")
    near = [f"{'no truth there' if one.error_m is None else f'{one.error_m:.2f}{NBSP}m off'} ({one.apart_m:.1f}{NBSP}m away)"
            for one in place.neighbours]  # fmt: skip
    return [*facts, f"Other passes of this street: {', '.join(near)}." if near else "There is no other pass of this street."]


def _lane(name: str) -> str:
    """A lane's name; SUMO begins those inside junctions with a colon, which a reader may take for a slip."""
    return f"{name} (in a junction)" if name.startswith(":") else name


def _step(belief: Belief, step: int, frames: Thumbnails, evidence: MapEvidence, town: str, files: ScenarioFiles) -> Html:
    t_s, view_s, spread = belief.t_s[step], belief.view_s[step], belief.covariance_m2[step]
    seen = frame_tile(frames, t_s, "tile second") if files.second_frames else None
    fired = frame_tile(evidence.thumbnails, view_s) if files.thumbnails and view_s is not None else None
    facts = [
        "Left: what the camera saw."
        + (
            " No view has fired yet."
            if view_s is None
            else f" Right: the kept frame nearest to the view that fired, {view_s:.1f}{NBSP}s."
        ),
        "It does not say how sure it was."
        if spread is None
        else f"It said that it was 95{NBSP}% sure within {_sure_m(spread):.2f}{NBSP}m.",
        f"The evidence for the last view led that for any other place by {belief.confidence[step]:.2f}.",
    ]
    looks = files.second.looks if files.second else ()
    if views := next((look.views for look in looks if (look.method, look.t_s) == (belief.name, t_s)), None):
        facts.append(f"This frame alone resembles the views of {'; '.join(map(_resemblance, views))}.")
    off_m, when = belief.error_m[step] or 0.0, f"{t_s - belief.t_s[0]:.1f}{NBSP}s into the drive"
    words = joined(element("strong", f"{off_m:.2f}{NBSP}m off"), element("small", when))
    pictures = element("div", seen, fired, class_="pair")
    link = _link(town, 2, t_s, belief.name)
    return element("div", element("div", pictures, words, class_="card"), _list(facts), link, class_="place")


def _resemblance(view: ViewCandidate) -> str:
    """A candidate: when it was stored, its score, and how far from the car it lies."""
    off = "no truth" if view.off_m is None else f"{view.off_m:.1f}{NBSP}m off"
    return f"{view.view_s:.1f}{NBSP}s (score {view.score:.1f}, {off})"


def _sure_m(covariance_m2: tuple[float, float, float]) -> float:
    """Half axis of the ellipse that holds 95 %."""
    xx, xy, yy = covariance_m2
    largest = (xx + yy) / 2.0 + (((xx - yy) / 2.0) ** 2 + xy**2) ** 0.5
    return float(WITHIN_95 * max(largest, 0.0) ** 0.5)


def _list(facts: Sequence[str]) -> Html:
    return element("ul", [element("li", fact) for fact in facts], class_="facts")


def _link(town: str, drive: int, t_s: float, method: str) -> Html:
    """A link that plays one of the drives in the map of a method, from a time on."""
    return element("a", "Play from here", href=f"{place_address(town, drive, t_s, method)}&play=1")


def place_address(town: str, drive: int, t_s: float, method: str) -> str:
    """The address, within the page, of a time of one of a town's drives, in the map of a method."""
    return f"#town={quote(town, safe='')}&drive={drive}&t={round(t_s, 2)}&map={quote(method, safe='')}"


def frame_tile(tiles: Thumbnails, t_s: float, kind: str = "tile") -> Html:
    """The embedded frame nearest to a time, cut out of its sheet."""
    tile = min(range(len(tiles.t_s)), key=lambda place: abs(tiles.t_s[place] - t_s))
    rows = -(-len(tiles.t_s) // tiles.columns)
    style = f"--column:{tile % tiles.columns};--row:{tile // tiles.columns}"
    own = f";--columns:{tiles.columns};--rows:{rows};--ratio:{tiles.width}/{tiles.height}" if kind != "tile" else ""
    return element("div", class_=kind, role="img", aria_label=FRAME_LABEL.format(tiles.t_s[tile]), style=style + own)
