"""Two runs side by side: each method's map in both, and where it became better or worse, on one page (``compare.html``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.eval.report.evidence import MAP_JSON, EvidenceModel, Layer, MapEvidence, read_map_evidence, worst_places
from hippodrome.eval.report.markup import Child, Html, data_script, element
from hippodrome.eval.report.pages import page
from hippodrome.eval.report.tables import plain_table

COMPARE_PAGE: Final = "compare.html"
SCRIPTS: Final = ("basics.js", "vector.js", "save.js", "story.js", "tables.js", "versus.js")
NEAR_S: Final = 0.5  # vertices of two runs that are nearer in time than this are compared: a car drives a few metres in it
PLACES: Final = 5  # where the change is largest, to be looked at first
PANES: Final = (("before", "A, before"), ("after", "B, after"), ("change", "Change from A to B"))


class Both(EvidenceModel):
    """One method's vertices in both runs: N places on the first drive that both maps have a vertex for."""

    name: str
    t_s: list[float]
    x_before_m: list[float]
    y_before_m: list[float]
    x_after_m: list[float]
    y_after_m: list[float]
    before_m: list[float]  # error in A
    after_m: list[float]  # error in B
    largest: list[int]  # places where the error changed most, largest first


class Versus(EvidenceModel):
    """What ``versus.js`` draws of one scenario."""

    roads: list[list[float]]
    methods: list[Both]


def write_versus(
    path: Path,
    folders: tuple[Path, Path],
    names: Sequence[str],
    heads: Sequence[str],
    rows: Sequence[Sequence[Child]],
    lost: Sequence[str],
) -> None:
    """Write the page of two runs.

    Args:
        path: The page.
        folders: The runs, the earlier one first.
        names: Scenarios that both runs have.
        heads: Heads of the table of figures that moved.
        rows: Its rows.
        lost: What one run has and the other has not, in words.

    Raises:
        ResultsError: A file of a run cannot be read.
    """
    before, after = folders
    sections = [one for name in names if (one := _section(folders, name)) is not None]
    moved = plain_table(heads, rows, "what moved") if rows else element("p", "No figure moved.", class_="note")
    words = (
        "The table has every figure that moved. Below it the maps: blue where B is better, orange where it is worse, grey where "
        "the error is the same within a tenth of a metre or of itself."
    )
    body = [
        element("header", element("h1", "Compared: ", " and ".join(_titles(before, after)))),
        element(
            "main",
            element("p", f"A is {before}, B is {after}. {words}", class_="lede"),
            element("section", element("h2", "What moved"), moved, _list(lost)),
            sections or element("p", "There is no map to show: both folders need a scenario's map.json.", class_="note"),
        ),
        element("footer", "Made by ", element("code", f"hippodrome compare {before} {after} --html"), "; it is no test."),
    ]  # fmt: skip
    write_atomically(path, page("hippodrome compare", body, SCRIPTS).encode())


def _titles(before: Path, after: Path) -> tuple[str, str]:
    """The ends of both paths, as short as they can be while they differ."""
    for count in range(1, max(len(before.parts), len(after.parts)) + 1):
        names = ["/".join(path.parts[-count:]) or str(path) for path in (before, after)]
        if names[0] != names[1]:
            return names[0], names[1]
    return str(before), str(after)


def _list(lines: Sequence[str]) -> Html | None:
    return element("ul", [element("li", line) for line in lines]) if lines else None


def _section(folders: tuple[Path, Path], name: str) -> Html | None:
    """One scenario's maps; None if a run has none."""
    if Path(name).name != name or not all((folder / name / MAP_JSON).exists() for folder in folders):
        return None
    before, after = (read_map_evidence(folder / name / MAP_JSON) for folder in folders)
    methods = list(_methods(before, after))
    if not methods:
        return None
    panes = [
        element(
            "figure", element("canvas", role="img", aria_label=f"{words}, {name}", data_pane=kind), element("figcaption", words)
        )
        for kind, words in PANES
    ]
    return element(
        "section",
        element("h2", name),
        element("div", data_script(Versus(roads=before.roads, methods=methods)), element("div", panes, class_="panes"),
                element("div", element("label", "Map ", element("select", class_="choice")),
                        element("label", "Place ", element("input", type="range", min=0, value=0, class_="scrub")),
                        element("span", "", class_="said", role="status"), class_="transport"),
                element("div", class_="places"), element("div", class_="versus-scale"), class_="versus"),
        data_town=name,
    )  # fmt: skip


def _methods(before: MapEvidence, after: MapEvidence) -> Iterator[Both]:
    """The methods that both runs have a map of, in the order of the later run."""
    earlier = {layer.name: layer for layer in before.methods}
    for layer in after.methods:
        if layer.name in earlier and (both := _both(earlier[layer.name], layer)) is not None:
            yield both


def _both(before: Layer, after: Layer) -> Both | None:
    """The vertices that lie at the same time in both, with their errors; None if there is none."""
    if not before.t_s or not after.t_s:
        return None
    times_s = np.array(before.t_s)
    pairs = []
    for late, t_s in enumerate(after.t_s):
        early = int(np.abs(times_s - t_s).argmin())
        known = before.error_m[early] is not None and after.error_m[late] is not None
        if known and abs(times_s[early] - t_s) <= NEAR_S:
            pairs.append((early, late))
    if not pairs:
        return None
    first, second = ([before.error_m[early] or 0.0 for early, _ in pairs], [after.error_m[late] or 0.0 for _, late in pairs])
    changes_m = np.abs(np.subtract(second, first))
    return Both(
        name=after.name,
        t_s=[after.t_s[late] for _, late in pairs],
        x_before_m=[before.x_m[early] for early, _ in pairs],
        y_before_m=[before.y_m[early] for early, _ in pairs],
        x_after_m=[after.x_m[late] for _, late in pairs],
        y_after_m=[after.y_m[late] for _, late in pairs],
        before_m=first,
        after_m=second,
        largest=[place for place in worst_places(changes_m, PLACES) if changes_m[place] > 0.0],
    )
