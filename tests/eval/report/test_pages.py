"""Pages of the trials, and of two runs side by side."""

import json

import cv2
import numpy as np
import pytest

from hippodrome.eval.report.evidence import MapEvidence
from hippodrome.eval.report.pages import write_trial_page
from hippodrome.eval.report.versus import Versus, write_versus
from hippodrome.eval.results.markdown import escaped, table
from tests.eval.report.browser import AXE
from tests.eval.report.samples import SVG
from tests.eval.report.test_page import TEXT, UNFROZEN
from tests.eval.report.test_report import HOSTILE, Page, evidence

TEXT_OF_TRIAL = "\n".join([
    "# Localization", "", *table(["condition", "error mean / p95, m", "verdict"],
                                 [["fog", "1.00 / 2.00", "WORSE"], [escaped(HOSTILE, html=True), "-", "held"]]),
    "", "Error: as `defined`", "over two lines.", "", "## Failures", "", f"- start 3: {HOSTILE}; again: `hippodrome --start 3`",
])  # fmt: skip


@pytest.fixture
def trial(tmp_path):
    (tmp_path / "curves.svg").write_text(SVG)
    cv2.imwrite(str(tmp_path / "curves.png"), np.full((60, 90, 3), 200, np.uint8))
    pictures = [tmp_path / "curves.png", tmp_path / "none.png"]
    write_trial_page(tmp_path / "trial.html", "Trial", TEXT_OF_TRIAL, pictures, "hippodrome x", "failed")
    return tmp_path / "trial.html"


def test_a_trial_page_says_what_the_text_says_one_figure_a_column(trial):
    page = Page(trial.read_text(encoding="utf-8"))
    text = page.text()
    assert "error mean (m)" in text and "error p95 (m)" in text and "Error: as defined over two lines." in text
    assert text.count(HOSTILE) == 2
    assert [one.get("class") for one in page.all("span") if one.get("class")] == ["badge bad", "bad", "good"]
    assert len(page.all("img")) == 2  # the one figure that is there, and the place where it is enlarged
    assert len(page.all("script")) == 2  # the figure's SVG, and ours


def test_rows_that_two_names_tell_apart_keep_both_in_sight_on_a_phone(browser, tmp_path):
    heads = ["setting", "method", "runs", "APE mean / p95, m", "CPU, s"]
    rows = [[f"localizer.mode={mode}", method, "1", "1.00 / 2.00", "3"] for mode in ("coupled", "kalman")
            for method in ("topometric (paper)", "dead reckoning")]  # fmt: skip
    write_trial_page(tmp_path / "sweep.html", "Sweep", "\n".join(["# Sweep", "", *table(heads, rows)]))
    tab = browser.open((tmp_path / "sweep.html").as_uri(), width=360)
    tab.run("document.querySelector('.scroll').scrollLeft = 400")
    left, right, head = tab.run("""(() => {
      const edge = document.querySelector('.scroll').getBoundingClientRect().left, row = document.querySelector('tbody tr');
      const cells = [row.cells[0], row.cells[1], document.querySelectorAll('thead th')[1]];
      const [one, two, head] = cells.map((cell) => cell.getBoundingClientRect());
      return [one.left - edge, two.left - one.right, head.left - two.left];
    })()""")
    assert max(abs(left), abs(right), abs(head)) < 2
    look_at(tab)


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (390, True)])
def test_a_trial_page_is_readable(browser, trial, width, dark):
    tab = browser.open(trial.as_uri(), width=width, dark=dark)
    assert tab.run("document.querySelectorAll('.table-tools button').length") == 4
    look_at(tab)


@pytest.fixture
def versus(tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    for folder, more_m in ((before, 0.0), (after, 5.0)):
        (folder / "town").mkdir(parents=True)
        data = evidence().model_dump()
        for one in data["methods"]:
            one["error_m"] = [
                error if error is None or place != 9 else error + more_m for place, error in enumerate(one["error_m"])
            ]
        (folder / "town" / "map.json").write_text(MapEvidence.model_validate(data).model_dump_json())
    page = tmp_path / "compare.html"
    write_versus(
        page, (before, after), ["town", "../town", "elsewhere"], ["scenario", "change"], [["town", HOSTILE]], ["town: lost"]
    )
    return page


def test_both_maps_are_in_the_page_as_they_were(versus):
    found = [
        json.loads(text)
        for parent, text in Page(versus.read_text(encoding="utf-8")).texts
        if parent == "script" and text[0] == "{"
    ]
    both = Versus.model_validate(found[0]).methods[-1]
    assert both.name == "topometric" and both.largest == [8]  # of the vertices with a truth: the first has none
    assert (both.before_m[8], both.after_m[8]) == (9.0, 14.0)


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (390, True)])
def test_a_change_is_shown_and_told(browser, versus, width, dark):
    tab = browser.open(versus.as_uri(), width=width, dark=dark)
    assert tab.run("document.querySelector('.said').textContent") == "0 of 29 vertices better, 1 worse"
    tab.run("document.querySelector('.places button').click()")
    assert tab.run("document.querySelector('.said').textContent").endswith("A 9.00 m, B 14.00 m: 5.00 m worse")
    tab.run("document.querySelector('.choice').focus()")
    tab.press("ArrowUp")
    look_at(tab)


def look_at(tab):
    """What holds for every page."""
    tab.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert tab.run(TEXT.replace("LEAST", "12")) == []
    assert tab.run(UNFROZEN) == []
    assert tab.run("document.documentElement.scrollWidth - innerWidth") <= 0
    if AXE.exists():
        tab.run(AXE.read_text(encoding="utf-8") + "; 0")
        violations = "axe.run().then((found) => found.violations.map((one) => [one.id, one.nodes.map((node) => node.html)]))"
        assert tab.run(violations) == []
    assert tab.complaints() == []
    tab.close()
