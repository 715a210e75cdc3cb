"""Rows of missions in the report: beside those of maps, or alone."""

from hippodrome.eval.report.report import report_html
from hippodrome.eval.results.model import Results, Row
from tests.eval.drive.samples import MISSION, drive_figures
from tests.eval.report.test_report import HOSTILE, scenario


def driven(**changed):
    return Row(method=f"mine {HOSTILE}", drive=drive_figures(**changed))


def test_missions_stand_below_the_maps_with_the_causes_of_those_that_failed(tmp_path):
    whole = scenario("town")
    lost = {**MISSION, "success": False, "cause": f"stands: halted, {HOSTILE}"}
    both = whole.model_copy(update={"rows": (*whole.rows, driven(missions_detail=[lost]))})
    bare, text = (report_html(Results(scenarios=(one,)), tmp_path) for one in (whole, both))
    assert "Missions" not in bare and "stands: halted" in text and "collisions at fault" in text
    assert "share that stood within 3 m" in text and "right of way 0.33" in text and "drive.html" not in text
    assert HOSTILE not in text and text.count("topometric (paper)") == bare.count("topometric (paper)")


def test_a_report_of_missions_alone_has_no_empty_tables(tmp_path):
    (tmp_path / "drive.html").write_text("")
    alone = scenario("town", rows=(driven(),), configuration={"thresholds": {"drive": {"row": "mine", "spl": 0.95}}})
    text = report_html(Results(scenarios=(alone, scenario("maps"))), tmp_path)
    assert 'href="drive.html"' in text and text.count("Mapping (Table I)") == 1
    assert "no row &#x27;mine&#x27; of missions" in text and 'href="#scenario-2"' in text
    assert "Mapping (Table I)" not in report_html(Results(scenarios=(alone,)), tmp_path)
