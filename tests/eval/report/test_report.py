"""The report: structure, escaping, and, where chromium is installed, a real browser."""

import html
import json
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hippodrome.eval.report.evidence import MapEvidence, read_map_evidence, worst_places
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.report import report_html, write_report
from hippodrome.eval.results.model import (
    ErrorSummary,
    LocalizationSummary,
    Network,
    Results,
    ResultsError,
    Row,
    ScenarioResult,
    write_results,
)
from hippodrome.eval.results.paper_rows import quoted_rows

HOSTILE = "</script><script>alert('\"&x')</script><img src=x onerror=alert(1)>"
VERTICES = 30
VOID = {"img", "meta", "input", "br"}


def row(method, mean_m, **fields):
    error = ErrorSummary(definition=f"APE {method}", mean_m=mean_m, median_m=mean_m, p95_m=mean_m, max_m=2 * mean_m)
    return Row(method=method, ape=error, rpe=error, **fields)


def scenario(name, **fields):
    rows = (
        row("dead reckoning", 50.0),
        row("semi-metric", 40.0, vertices=VERTICES),
        Row(method="topometric (paper)", failure=f"no route {HOSTILE}"),
        row("topometric", 0.5, localization=LocalizationSummary(definition="d", success=True, error_mean_m=0.25, error_max_m=1.5,
                                                                initial_drive_s=12.4, false_fixes=0),
            breaks=[{"first_vertex": 3, "last_vertex": 5, "status": "NO_ROUTE", "cause": HOSTILE}]),
    )  # fmt: skip
    extra = {"configuration": {"note": HOSTILE, "thresholds": {"method": "topometric", "ape_mean_m": 0.4}},
             "timings": {"mapping_cpu_s": 2.0, "topometric: refinement_cpu_s": 1.0}}  # fmt: skip
    whole = {"name": name, "seed": 7, "network": Network(generator="rural", edges=10, km=2.0), "noise": "paper", "frames": 100,
             "duration_s": 60.0, "rows": rows, **extra, **fields}  # fmt: skip
    return ScenarioResult(**whole)


def evidence():
    angle = np.linspace(0.0, 2.0 * np.pi, VERTICES)
    x, y, t = (100.0 * np.cos(angle)).tolist(), (80.0 * np.sin(angle)).tolist(), np.linspace(0.0, 60.0, VERTICES).tolist()
    path = {"t_s": t, "x_m": x, "y_m": y}
    methods = [
        {"name": name, **path, "error_m": [None, *[float(i) for i in range(1, VERTICES)]], "worst": [29, 3]}
        for name in ("dead reckoning", "semi-metric", f"topometric {HOSTILE}", "topometric")
    ]
    return MapEvidence.model_validate({
        "roads": [[0.0, 0.0, 50.0, 50.0]], "truth": path, "methods": methods,
        "drives": [{"name": "topometric", **path, "error_m": [1.0] * VERTICES, "localized": [True] * VERTICES}],
        "thumbnails": {"t_s": [0.0, 30.0, 60.0], "columns": 2, "width": 16, "height": 12},
        "start": (1.0, 2.0, 90.0), "recordings": {"mapping": "town-mapping-1", "localization": "town-localization-2"},
        "network": "rural-1.net.xml",
    })  # fmt: skip


@pytest.fixture
def out(tmp_path):
    write_results(tmp_path / "results.json", Results(scenarios=(scenario("town"), scenario(HOSTILE))))
    folder = tmp_path / "town"
    folder.mkdir()
    picture = np.full((60, 90, 3), 200, np.uint8)
    for name in ("maps", "topometric-paper-ape", "unheard-of"):
        cv2.imwrite(str(folder / f"{name}.png"), picture)
    cv2.imwrite(str(folder / "thumbnails.jpg"), np.zeros((24, 32, 3), np.uint8))
    (folder / "map.json").write_text(evidence().model_dump_json())
    return tmp_path


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.texts = [], [], []
        self.feed(text)
        self.close()
        assert self.open == [], f"left open: {self.open}"

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]

    def text(self):
        return " ".join(" ".join(data for parent, data in self.texts if parent not in ("script", "style")).split())


@pytest.fixture
def page(out):
    return Page(write_report(out).read_text(encoding="utf-8"))


def test_a_name_that_turns_the_direction_of_writing_turns_nothing_else():
    assert element("p", "a\u202ename, and our words") == "<p>a\\u202ename, and our words</p>"
    assert element("p", "מדינה") == "<p>מדינה</p>", "names in other scripts are left alone"


def test_is_one_file_that_asks_the_network_for_nothing(page):
    assert len(page.all("h1")) == 1
    assert all(attributes["src"].startswith("data:") for attributes in page.all("img") if "src" in attributes)
    assert not any("src" in attributes for attributes in page.all("script"))
    assert page.all("link") == []
    assert any("default-src 'none'" in attributes.get("content", "") for attributes in page.all("meta"))


def test_links_lead_somewhere_and_ids_are_unique(page):
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids)) == 3
    places = {attributes["href"].removeprefix("#") for attributes in page.all("a")}
    assert {place for place in places if "=" not in place} == set(ids)
    assert all(place.startswith("town=town&drive=1&t=") for place in places if "=" in place)


def test_every_picture_and_button_has_a_name(page):
    assert all("alt" in attributes for attributes in page.all("img"))
    assert [attributes["aria-label"] for attributes in page.all("button") if attributes.get("class") == "enlarge"] == [
        "Enlarge: Maps over ground truth (Fig. 3 B)",
        "Enlarge: APE on the map, topometric (paper) (Fig. 3 C)",
        "Enlarge: unheard of",
    ]


def test_says_what_was_measured_quoted_failed_and_how_to_run_it_again(page):
    text = page.text()
    for quoted in quoted_rows():
        assert f"{quoted.method} †" in text
    assert "topometric (paper) (FAILED)" in text
    assert "limits failed" in text
    assert "APE mean, m is 0.5, the limit is 0.4" in text
    assert "3–5" in text and "no route" in text
    assert "hippodrome eval town/scenario.json --out again" in text
    assert "hippodrome localize town/topometric-default.pbstream recordings/town-localization-2" in text
    assert "--mode paper --start=1.000000,2.000000,90.000000" in text
    assert "Made again by the first command only: dead reckoning." in text


def test_hostile_text_stays_text(page):
    scripts = page.all("script")
    assert [script.get("type") for script in scripts] == [None, "application/json", None]
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert page.text().count(HOSTILE) >= 5
    data = next(data for parent, data in page.texts if parent == "script" and data.startswith("{"))
    assert json.loads(data)["methods"][2]["name"] == f"topometric {HOSTILE}"


def test_same_files_same_bytes(out):
    assert write_report(out).read_bytes() == write_report(out).read_bytes()


def test_a_name_that_is_a_path_reads_nothing(out):
    (out / "inside").mkdir()
    results = Results(scenarios=(scenario("../town"),))
    assert ";base64,/" not in report_html(results, out / "inside")  # as JPEG begins
    assert "data:image/webp" not in report_html(results, out / "inside")


def test_needs_results_only(tmp_path):
    write_results(tmp_path / "results.json", Results(scenarios=(scenario("town", timings={}, configuration={}),)))
    Page(write_report(tmp_path).read_text(encoding="utf-8"))


@pytest.mark.parametrize("extra", ["text", 3, [1], {"thresholds": {"method": 1}}, {"thresholds": "x"}, None])
def test_fields_beside_the_agreed_ones_may_be_anything(tmp_path, extra):
    rows = (row("topometric", 1.0, breaks=extra),)
    write_results(tmp_path / "results.json", Results(scenarios=(scenario("a", timings=extra, configuration=extra, rows=rows),)))
    Page(write_report(tmp_path).read_text(encoding="utf-8"))


@pytest.mark.parametrize("content", ["", "[]", "{", '{"roads": [[NaN]]}'])
def test_a_broken_map_is_an_error_that_names_the_file(out, content):
    (out / "town" / "map.json").write_text(content)
    with pytest.raises(ResultsError, match=r"town/map\.json: .*run `hippodrome eval` again"):
        write_report(out)


def test_columns_that_do_not_fit_are_refused(out):
    data = evidence().model_dump()
    data["methods"][0]["worst"] = [VERTICES]
    (out / "town" / "map.json").write_text(json.dumps(data))
    with pytest.raises(ResultsError, match="'dead reckoning' do not fit"):
        read_map_evidence(out / "town" / "map.json")


@given(st.lists(st.floats(0, 100) | st.just(float("nan")), max_size=60))
def test_worst_places_are_apart_and_in_order(errors):
    errors_m = np.array(errors)
    places = worst_places(errors_m, count=4, apart=5)
    assert places == [] if not np.any(np.isfinite(errors_m)) else errors_m[places[0]] == np.nanmax(errors_m)
    assert list(errors_m[places]) == sorted(errors_m[places], reverse=True)
    assert all(abs(a - b) >= 5 for i, a in enumerate(places) for b in places[:i])


@given(st.text())
def test_text_survives_markup(text):
    made = element("p", text, title=text)
    assert isinstance(made, Html)
    assert made.count("<") == 2
    assert html.unescape(made) == f'<p title="{text}">{text}</p>'
    assert joined(made) == made


def test_runs_in_a_browser_without_a_word_on_the_console(browser, out):
    tab = browser.open(f"{write_report(out).as_uri()}#scenario-1")
    tab.run("document.querySelectorAll('.goto')[0].click()")
    said = tab.until(
        "document.querySelector('.vertex').textContent.startsWith('topometric') && document.querySelector('.vertex').textContent"
    )
    drawn = """(() => { const canvas = document.querySelector(".map canvas"), pen = canvas.getContext("2d");
        const levels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
        return levels.filter((level, i) => i % 4 === 3 && level > 0).length > 1000; })()"""
    tab.until(drawn)  # pixels of the map
    assert tab.complaints() == []
    assert said.splitlines() == ["topometric", "vertex 29 at 60.0 s", "APE 29.00 m", "camera frame at 60.0 s"]
    assert tab.run("document.querySelector('.map').dataset.ready") == "yes"
    assert tab.run("document.documentElement.scrollWidth - innerWidth") <= 0
    tab.close()


def test_an_error_in_a_page_is_heard(browser, tmp_path):
    (tmp_path / "page.html").write_text("<!doctype html><title>broken</title><script>nothing.here;</script>")
    tab = browser.open((tmp_path / "page.html").as_uri())
    assert len(complaints := tab.complaints()) == 1 and "nothing is not defined" in str(complaints)
    tab.close()
