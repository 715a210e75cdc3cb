"""The page of missions: figures, causes and definitions, and a mission that plays in the browser."""

import numpy as np
import pytest

from hippodrome.eval.drive.flight import TRACE
from hippodrome.eval.drive.page import write_page
from hippodrome.eval.drive.rows import row_named
from hippodrome.eval.drive.task import MissionTask
from hippodrome.eval.results.model import Network, Results, Row, ScenarioResult
from tests.eval.drive.samples import MISSION, drive_figures
from tests.eval.report.test_pages import look_at
from tests.eval.report.test_report import HOSTILE


@pytest.fixture
def page(hamlet, tmp_path):
    out = tmp_path / "out"
    hamlet.request(out)
    mission, rows = hamlet.mission(), (row_named("ours"), row_named("truth"))
    tasks = [MissionTask(hamlet.scenario, row, mission, hamlet.map_file, out, "") for row in rows]
    for task in tasks:
        trace = np.zeros((101, len(TRACE)))
        at = {name: k for k, name in enumerate(TRACE)}
        trace[:, at["x_m"]], trace[:, at["y_m"]] = np.linspace(10.0, 60.0, 101), 20.0
        trace[50:, at["localized"]] = 1.0
        trace[:50, at["estimate_x_m"]] = np.nan
        trace[:, at["state"]], trace[:, at["speed_mps"]] = 1.0, 5.0
        task.trace_file().parent.mkdir(exist_ok=True)
        np.savez_compressed(task.trace_file(), columns=np.array(TRACE), trace=trace.astype(np.float32))
    lost = {**MISSION, "number": 0, "success": False, "cause": f"stands: {HOSTILE}", "events": {"wrong way": 2}}
    found = tuple(Row(method=row.label, drive=drive_figures(missions_detail=[lost])) for row in rows)
    result = ScenarioResult(name="hamlet", seed=5, network=Network(edges=1, km=1.0), noise="paper", frames=0, duration_s=0.0,
                            rows=found)  # fmt: skip
    write_page(Results(scenarios=(result,)), tasks, out)
    return out / "drive.html"


def test_figures_causes_and_definitions_are_in_the_page(page):
    text = page.read_text(encoding="utf-8")
    assert "2 x wrong way" in text and "right of way 0.33" in text and "share that stood within 3 m" in text
    assert HOSTILE not in text and text.count('class="way lost"') == 2 and "ours, pose from truth, mission 0" in text
    assert "a_0 20.0\N{NO-BREAK SPACE}m" in text and "from a hidden start to a goal" in text


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (360, True)])
def test_a_mission_plays_and_the_page_is_readable(browser, page, width, dark):
    tab = browser.open(page.as_uri(), width=width, dark=dark)
    tab.run("window.of = (name) => document.querySelector('.drive-controls ' + name); 0")
    said = "of('output').textContent"
    assert tab.run(said) == "0 s, 18 km/h, driving"
    shown = "[...document.querySelectorAll('.ways')].map((one) => one.style.display)"
    assert tab.run(shown) == ["", "none"]
    tab.run("document.querySelectorAll('button.show')[1].click()")
    assert tab.run(shown) == ["none", ""] and tab.run("of('button').textContent").endswith("Pause")
    tab.run("of('input').value = 12; of('input').dispatchEvent(new Event('input')); 0")
    assert tab.run(said).startswith("6 s") and tab.run("document.querySelector('.belief').style.display") == ""
    look_at(tab)
