"""Heads of tables are explained in plain English, in the page's tables and when they are tapped."""

from pathlib import Path

from hippodrome.eval.report.meanings import meaning_of, meanings
from hippodrome.eval.report.player import COLOURS
from hippodrome.eval.report.tables import SPLIT
from hippodrome.eval.results.tables import LOCALIZATION_COLUMNS, MAPPING_COLUMNS
from tests.eval.report.test_report import Page

REPORT = Path(__file__).parents[3] / "eval" / "report"


def test_every_head_of_a_towns_tables_is_explained():
    titles = [column.title for column in (*MAPPING_COLUMNS[1:], *LOCALIZATION_COLUMNS[1:])]
    heads = [head for title in titles for head in SPLIT.get(title, (title,))]
    assert [head for head in heads if meaning_of(head) is None] == []
    assert meaning_of("APE (m)") != meaning_of("APE SE(2) (m)") != meaning_of("APE median (m)")


def test_a_head_that_speaks_for_itself_has_no_line():
    lines = Page(meanings(["Method", "RPE (m)", "RPE (m)"]))
    assert [one.get("data-head") for one in lines.all("li")] == ["RPE (m)"]


def test_methods_have_the_same_colours_in_tables_and_on_maps():
    script = (REPORT / "basics.js").read_text(encoding="utf-8")
    assert ", ".join(f'"{colour}"' for colour in COLOURS) in script
