"""Every figure of the page equals ``results.json``: read back from the markup, and compared with the file's own numbers.

Nothing of what makes the page is used to read it, so that a column with the wrong figure, unit or scale is found. The page of a
real run is read if ``HIPPODROME_REPORT`` names one.
"""

import json
import os
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from hippodrome.eval.report.evidence import read_map_evidence
from hippodrome.eval.report.report import write_report
from tests.eval.report.samples import write_run

NBSP = "\N{NO-BREAK SPACE}"
VOID = {"img", "meta", "input", "br"}
MEGA, PERCENT = 1e-6, 100.0
MAPPING = {  # where the figure under a head stands in a row of results.json, and its factor there
    "APE (m)": ("ape.mean_m", 1.0),
    "APE SE(2) (m)": ("ape_se2.mean_m", 1.0),
    "APE Sim(2) (m)": ("ape_sim2.mean_m", 1.0),
    "APE median (m)": ("ape.median_m", 1.0),
    "APE p95 (m)": ("ape.p95_m", 1.0),
    "APE max (m)": ("ape.max_m", 1.0),
    "RPE (m)": ("rpe.mean_m", 1.0),
    "RPE 20 m (m)": ("rpe_20m.mean_m", 1.0),
    "CPU (%)": ("cpu_percent", 1.0),
    "Map (MB)": ("map_bytes", MEGA),
    "Peak RSS (MB)": ("peak_rss_bytes", MEGA),
    "Frames": ("camera_frames", 1.0),
    "Keyframes": ("keyframes", 1.0),
    "Vertices": ("vertices", 1.0),
    "Edges": ("edges", 1.0),
    "Latency median (ms)": ("latency_ms.median", 1.0),
    "Latency p99 (ms)": ("latency_ms.p99", 1.0),
}
LOCALIZATION = {
    "Success": ("localization.success", 1.0),
    "Error (m)": ("localization.error_mean_m", 1.0),
    "Error p95 (m)": ("localization.error_p95_m", 1.0),
    "CPU of the first fix (ms)": ("localization.initial_time_ms", 1.0),
    "First fix (s driven)": ("localization.initial_drive_s", 1.0),
    "First fix (m driven)": ("localization.initial_distance_m", 1.0),
    "Localized (%)": ("localization.localized_share", PERCENT),
    "False fixes": ("localization.false_fixes", 1.0),
}


class Node:
    def __init__(self, tag, attributes, parent):
        self.tag, self.attributes, self.parent, self.children = tag, attributes, parent, []

    def all(self, tag=None, **wanted):
        """All below of a tag and with attributes, of which a class may be one of several."""
        for child in self.children:
            if isinstance(child, Node):
                if tag in (None, child.tag) and all(self._has(child, key.rstrip("_"), value) for key, value in wanted.items()):
                    yield child
                yield from child.all(tag, **wanted)

    @staticmethod
    def _has(child, key, value):
        own = child.attributes.get(key.replace("_", "-"))
        return own is not None and (value in own.split() if key == "class" else own == value)

    def text(self):
        parts = [child.text() if isinstance(child, Node) else child for child in self.children]
        return " ".join("".join(parts).replace(NBSP, " ").split())


class Tree(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.root = self.at = Node("", {}, None)
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        node = Node(tag, dict(attrs), self.at)
        self.at.children.append(node)
        if tag not in VOID:
            self.at = node

    def handle_endtag(self, tag):
        self.at = self.at.parent

    def handle_data(self, data):
        self.at.children.append(data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    if named := os.environ.get("HIPPODROME_REPORT"):
        return Path(named).resolve().parent
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def tree(folder):
    return Tree((folder / "report.html").read_text(encoding="utf-8")).root


@pytest.fixture(scope="module")
def scenarios(folder):
    return json.loads((folder / "results.json").read_text())["scenarios"]


def section(tree, place):
    (found,) = tree.all("section", id=f"scenario-{place + 1}")
    return found


def value_at(row, path):
    for key in path.split("."):
        row = None if row is None else row.get(key)
    return row


def is_told(text, value):
    """Whether a text tells a value: to half a unit of its last digit, "-" for none, brackets around a guess."""
    if value is None or text == "-":
        return value is None and text == "-"
    if isinstance(value, bool):
        return text.lower() == ("yes" if value else "no")
    shown = text.strip("()").replace(",", "")
    if shown.startswith("<"):
        return 0 < value < float(shown[1:])
    digits = len(shown.partition(".")[2])
    return abs(float(shown) - value) <= 0.5000001 * 10.0**-digits and (float(shown) != 0.0 or value < 0.001)


def tables(node, label):
    return [box for box in node.all("div", aria_label=label) if list(box.all("table"))]


def lines(box):
    """A table's rows as dictionaries by their heads."""
    head, body = next(box.all("thead")), next(box.all("tbody"))
    heads = [one.text() for one in head.all("th")]
    return [dict(zip(heads, (cell.text() for cell in row.children), strict=True)) for row in body.all("tr")]


@pytest.mark.parametrize(("kind", "columns"), [("mapping", MAPPING), ("localization", LOCALIZATION)])
def test_the_tables_of_each_town(tree, scenarios, kind, columns):
    compared = 0
    for place, scenario in enumerate(scenarios):
        by_method = {row["method"]: row for row in scenario["rows"]}
        (box,) = tables(section(tree, place), f"{scenario['name']}: {kind}")
        shown = [line for line in lines(box) if not line["Method"].endswith("†")]
        wanted = [name for name in reversed(by_method) if kind == "mapping" or by_method[name]["localization"] is not None]
        if kind == "localization" and (printed := scenario["as_printed"]) is not None:
            by_method[printed["method"]] = printed
            wanted.append(printed["method"])
        assert [re.sub(r" \((FAILED|REFUSED)\)$", "", line["Method"]) for line in shown] == wanted
        for line, method in zip(shown, wanted, strict=True):
            for head, text in line.items():
                if head == "Method":
                    continue
                path, factor = columns[head]
                value = value_at(by_method[method], path)
                value = value * factor if factor != 1.0 and value is not None else value
                assert is_told(text, value), f"{method}, {head}: {text!r} for {value}"
                compared += 1
    assert compared > len(scenarios)


def test_the_tiles_and_the_cards_and_the_table_of_all_towns(tree, scenarios):
    (overview,) = tables(tree, "all scenarios")
    rows = [[cell.text() for cell in row.children] for row in next(overview.all("tbody")).all("tr")]
    methods = list(dict.fromkeys(row["method"] for one in scenarios for row in one["rows"]))[::-1]
    for place, (scenario, cells) in enumerate(zip(scenarios, rows, strict=True)):
        by_method = {row["method"]: row for row in scenario["rows"]}
        assert cells[0] == scenario["name"]
        for method, text in zip(methods, cells[1:], strict=False):
            if (ape_m := value_at(by_method.get(method), "ape.mean_m")) is not None:
                assert is_told(text, ape_m), f"{method}: {text}"
        shapes_m = [value_at(by_method.get(method), "ape_sim2.mean_m") for method in methods]
        if any(shape_m is not None for shape_m in shapes_m):
            for text, shape_m in zip(cells[1 + len(methods) :], shapes_m, strict=False):
                assert is_told(text, shape_m), f"Sim(2): {text}"
        assert is_told(cells[-3], scenario["network"]["km"])
        assert is_told(cells[-2], scenario["duration_s"]) and is_told(cells[-1], scenario["frames"])
        for tile in section(tree, place).all("div", class_="figure-tile"):
            row, (figure,) = by_method[next(tile.all("span")).text()], tile.all("strong")
            if row["ape"] is None or row.get("refused"):
                continue
            assert is_told(figure.text().removesuffix(" m"), row["ape"]["mean_m"])
            first, *others = tile.all("small")
            assert first.text() == "mean APE"
            for small in others:
                path = "ape.max_m" if "worst" in small.text() else "localization.error_mean_m"
                assert is_told(re.search(r"[\d.,]+(?= m$)", small.text())[0], value_at(row, path))
    for card in tree.all("a", class_="town"):
        scenario = scenarios[int(card.attributes["data-place"].removeprefix("scenario-")) - 1]
        best = [row for row in scenario["rows"] if row["ape"] is not None][-1]
        found = re.search(r"mean map error \(APE\) ([\d.,]+) m", card.text())
        assert found and is_told(found[1], best["ape"]["mean_m"])
        if found := re.search(r"found its place after ([\d.,]+) s", card.text()):
            assert is_told(found[1], best["localization"]["initial_drive_s"])


def test_times_and_limits_and_what_went_wrong(tree, scenarios):
    for place, scenario in enumerate(scenarios):
        panel = section(tree, place)
        times = [[cell.text() for cell in row.children] for box in tables(panel, "stage times")
                 for row in next(box.all("tbody")).all("tr")]  # fmt: skip
        assert len(times) == len(scenario["timings"])
        for (_, text, _), value in zip(times, scenario["timings"].values(), strict=True):
            assert float(text.split()[0]) == pytest.approx(value, rel=0.006)  # three digits
        for row in scenario["rows"]:
            for words in filter(None, (row["failure"], row.get("refused"))):
                assert " ".join(words.split()) in panel.text()


def test_what_the_player_draws_has_the_errors_of_the_results(folder, scenarios):
    """The curves, the map and the worst places come from map.json: the mean over its vertices is the APE of results.json."""
    if not os.environ.get("HIPPODROME_REPORT"):
        pytest.skip("the small run's map is no run's; HIPPODROME_REPORT names a real one")
    for scenario in scenarios:
        by_method = {row["method"]: row for row in scenario["rows"]}
        for layer in read_map_evidence(folder / scenario["name"] / "map.json").methods:
            errors_m = np.array([one for one in layer.error_m if one is not None])
            wanted = by_method[layer.name]["ape"]
            assert errors_m.mean() == pytest.approx(wanted["mean_m"], abs=0.006), f"{scenario['name']}, {layer.name}"
            assert errors_m.max() == pytest.approx(wanted["max_m"], abs=0.006)


def test_the_worst_places_are_those_of_the_map(tree, folder, scenarios):
    for place, scenario in enumerate(scenarios):
        if not (path := folder / scenario["name"] / "map.json").exists():
            continue
        layers = {layer.name: layer for layer in read_map_evidence(path).methods}
        buttons = list(section(tree, place).all("button", class_="goto"))
        assert buttons
        for button in buttons:
            layer, vertex = layers[button.attributes["data-method"]], int(button.attributes["data-vertex"])
            assert vertex in layer.worst
            assert is_told(next(button.all("strong")).text().removesuffix(" m off"), layer.error_m[vertex])
            assert f"{layer.t_s[vertex]:.1f} s into the drive" in button.text()


def glance(tree):
    """The answers at a glance by their questions."""
    (found,) = tree.all("dl", class_="glance")
    nodes = [child for child in found.children if isinstance(child, Node)]
    return {question.text(): answer.text() for question, answer in zip(nodes[::2], nodes[1::2], strict=True)}


def test_the_answers_at_a_glance(tree, scenarios):
    said = glance(tree)
    best = said["Best method"].partition(" has the smallest")[0]
    rows = [row for one in scenarios for row in one["rows"] if row["method"] == best]
    located = [row["localization"] for row in rows if row["localization"]]
    errors_m = [one["error_mean_m"] for one in located if one["error_mean_m"] is not None]
    for words, values in ((said["Best method"], [row["ape"]["mean_m"] for row in rows if row["ape"]]),
                          (said["Second drive"].partition("it was ")[2], errors_m)):  # fmt: skip
        least, most = re.search(r"([\d.]+)(?: to ([\d.]+))? m\b", words).groups()
        assert is_told(least, min(values)) and is_told(most or least, max(values))
    worst_m = [one["error_max_m"] for one in located if one["error_max_m"] is not None]
    assert not worst_m or is_told(re.search(r"up to ([\d.]+) m", said["Worst place"])[1], max(worst_m))


def test_what_nothing_vouches_for_and_false_fixes_are_counted_as_in_the_results(tree, scenarios):
    said = glance(tree)
    for scenario in scenarios:
        for row in scenario["rows"]:
            breaks = row.get("breaks")
            if isinstance(breaks, list) and breaks:
                count = sum(one["last_vertex"] - one["first_vertex"] + 1 for one in breaks)
                assert f"{scenario['name']}, {row['method']}: {count}" in said["Not vouched for"].replace(",000", "000")
        printed = [scenario["as_printed"]] if scenario["as_printed"] else []
        for row in (*scenario["rows"], *printed):
            if row["localization"] and row["localization"]["false_fixes"]:
                line = said["False fixes"].partition(f"{row['method']}: ")[2]
                assert f"{row['localization']['false_fixes']} in {scenario['name']}" in line


def test_a_figure_that_differs_is_found():
    assert is_told("0.19", 0.190335) and is_told("1,054", 1054) and is_told("<0.001", 0.0004) and is_told("(3.20)", 3.2)
    assert not is_told("0.19", 0.196) and not is_told("-", 0.1) and not is_told("0.00", 0.004) and not is_told("5.6", 560.0)
