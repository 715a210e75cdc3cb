"""Many results on one page: pooled over seeds, told apart by definition and by drive, and nothing of them runs in the page."""

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.board.entries import drive_of, read_folders, tables
from hippodrome.eval.board.page import write_board
from hippodrome.eval.cli import main
from hippodrome.eval.results.model import ErrorSummary, Network, Results, Row, ScenarioResult, write_results


def scenario(rows, name="town", seed=1, **asked):
    return ScenarioResult(name=name, seed=seed, network=Network(edges=4, km=1.0), noise="paper", frames=9, duration_s=9.0,
                          rows=tuple(rows), configuration={"seed": seed, "mapper": {}, **asked})  # fmt: skip


def ape(mean_m, definition="APE, alignment none"):
    return ErrorSummary(definition=definition, mean_m=mean_m)


@pytest.fixture
def folder(tmp_path):
    def write(name, *scenarios):
        (tmp_path / name).mkdir()
        write_results(tmp_path / name / "results.json", Results(scenarios=scenarios))
        return tmp_path / name

    return write


def test_seeds_of_one_drive_are_one_cell_with_its_spread(folder):
    one = folder("a", scenario([Row(method="mine", ape=ape(1.0))]))
    other = folder("b", scenario([Row(method="mine", ape=ape(3.0))], seed=2))
    (table,) = tables(read_folders([one, other]))
    ((_, cells),) = table.lines.items()
    (cell,) = cells.values()
    assert (cell.values, cell.seeds) == ([1.0, 3.0], [1, 2])
    page = write_board([one, other], one / "board.html").read_text()
    assert "2.00 (1.00 to 3.00, 2 runs)" in page


def test_a_figure_that_is_small_is_not_nothing(folder):
    one = folder("a", scenario([Row(method="mine", cpu_percent=0.0031), Row(method="none", cpu_percent=0.0)]))
    page = write_board([one], one / "board.html").read_text()
    assert ">0.003<" in page and ">0.00<" in page


def test_other_definitions_and_other_drives_of_one_name_are_told_apart(folder):
    rows = [Row(method="mine", ape=ape(1.0))]
    one, other = scenario(rows), scenario(rows, camera={"width": 80})
    assert drive_of(one) != drive_of(other)
    assert drive_of(one) == drive_of(scenario(rows, seed=9))
    aligned = scenario([Row(method="mine", ape=ape(0.5, "APE, alignment SE(2)"))])
    page = write_board([folder("a", one, other), folder("b", aligned)], folder("c", one) / "board.html").read_text()
    assert "mine [1]" in page and "mine [2]" in page
    assert page.count(">town<small>") == 2


def test_failures_and_refusals_are_cells(folder):
    rows = [Row(method="mine", failure="hung"), Row(method="ours", ape=ape(761.0), refused="drive farther")]
    place = folder("a", scenario(rows), scenario([Row(method="mine", ape=ape(1.0))], name="other"))
    page = write_board([place], place / "board.html").read_text()
    assert "1 FAILED" in page and "failed: hung" in page
    assert "761.00 1 REFUSED" in page


def test_nothing_of_a_foreign_file_is_markup(folder):
    place = folder("a", scenario([Row(method="<script>alert(1)</script>", ape=ape(1.0, "</td><img src=x>"))], name="<b>"))
    page = write_board([place], place / "board.html").read_text()
    assert "<script>alert" not in page and "<img" not in page and "<b>" not in page


def test_the_command_writes_the_page_and_names_what_is_missing(folder, tmp_path, capsys):
    place = folder("a", scenario([Row(method="mine", ape=ape(1.0))]))
    assert main(["board", str(place), "--out", str(tmp_path / "out.html")]) == 0
    assert (tmp_path / "out.html").exists()
    assert main(["board", str(tmp_path / "absent")]) == 2
    assert "no results.json there" in capsys.readouterr().err
    with pytest.raises(HippodromeError):
        read_folders([tmp_path])
