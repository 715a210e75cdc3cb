"""The commands that make the rows of a scenario again, to be typed in the folder of the report."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from importlib.metadata import version

from hippodrome.eval.files.scenarios import PACKAGE
from hippodrome.eval.methods.method import SEMI_METRIC, Method, method_of
from hippodrome.eval.report.evidence import MapEvidence
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.results.model import ScenarioResult


def again(command: str) -> Html:
    """A command with a button that copies it, and where and with what it runs."""
    where = (
        " It works only in the folder that this page was made in, where each town's scenario.json lies: ask whoever sent it for "
        f"that folder. The page was made by hippodrome {version('hippodrome')}; "
    )
    return joined(
        element("code", command, class_="command"),
        " ",
        element("button", "Copy", type="button", class_="copy"),
        element("small", where, element("code", "make setup"), " in its source installs it."),
    )


def command_lines(scenario: ScenarioResult, evidence: MapEvidence | None) -> Iterator[tuple[str, str]]:
    """Name and command of each row that can be made again; the first command makes all of them.

    Args:
        scenario: The scenario's result.
        evidence: Its ``map.json``, which names the recordings and the network. Without it there is the first command only.
    """
    name, path = scenario.name, scenario.network.path
    is_packaged = path is not None and path.startswith(PACKAGE)  # then scenario.json names the network so that eval finds it
    network = ["--network", path if is_packaged else f"PATH/{path}"] if path else []
    all_rows = ["hippodrome", "eval", f"{name}/scenario.json", *([] if is_packaged else network), "--out", "again"]
    yield "all rows", shlex.join(all_rows)
    if evidence is None or not {"mapping", "localization"} <= set(evidence.recordings):
        return
    settings = ["--scenario", f"{name}/scenario.json"]
    mapping = f"recordings/{evidence.recordings['mapping']}"
    semi_metric = str(SEMI_METRIC.map_file)
    yield SEMI_METRIC.label, shlex.join(["hippodrome", "map", mapping, *settings, "--out", semi_metric])
    roads = network or ["--network", f"towns/{evidence.network}"]
    for row in scenario.rows:
        yield from _topometric(method_of(row.method), name, evidence, roads, settings)


def _topometric(
    method: Method, name: str, evidence: MapEvidence, roads: list[str], settings: list[str]
) -> Iterator[tuple[str, str]]:
    """The commands that refine a method's map and localize the second drive in it; none for a method without a refined map.

    ``roads`` and ``settings`` are the options that name the network, and the scenario that settings are taken from.
    """
    if method.mode is None or method.map_file is None:
        return
    start = ["--start=" + ",".join(f"{value:.6f}" for value in evidence.start)] if method.mode == "paper" else []
    semi_metric = f"{name}/{SEMI_METRIC.map_file}"
    options = [*roads, "--mode", method.mode, *start, *settings, "--out", method.map_file]
    yield method.label, shlex.join(["hippodrome", "refine", semi_metric, *options])
    drive = f"recordings/{evidence.recordings['localization']}"
    localize = ["hippodrome", "localize", f"{name}/{method.map_file}", drive, *roads, *settings, "--out", f"{method.mode}.tum"]
    yield f"{method.label}, localization", shlex.join(localize)
