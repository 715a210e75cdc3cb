"""All figures of a run in one folder, in every format that was drawn."""

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.report.export import export_figures
from hippodrome.eval.results.model import Results, write_results
from tests.eval.report.test_report import HOSTILE, scenario


@pytest.fixture
def run(tmp_path):
    write_results(tmp_path / "results.json", Results(scenarios=(scenario("town"), scenario("../up"), scenario(HOSTILE))))
    (tmp_path / "town").mkdir()
    for name in ("maps.png", "maps.svg", "maps.pdf", "frames.png", "notes.txt"):
        (tmp_path / "town" / name).write_bytes(name.encode())
    return tmp_path


def test_every_figure_is_copied_in_each_of_its_formats(run):
    lines = export_figures(run, run / "figures")
    found = {path.name: path.read_bytes() for path in (run / "figures").iterdir()}
    assert found == {f"town-{name}": name.encode() for name in ("maps.png", "maps.svg", "maps.pdf", "frames.png")}
    assert lines[0].endswith("1 PDF, 1 SVG, 2 PNG of 2 figures")
    assert "PNG only" in lines[1]


def test_a_folder_with_something_in_it_stays_as_it_is(run):
    with pytest.raises(HippodromeError, match="not empty"):
        export_figures(run, run / "town")


def test_a_run_without_figures_says_so(run):
    for path in (run / "town").glob("*.png"):
        path.unlink()
    with pytest.raises(HippodromeError, match="no figures"):
        export_figures(run, run / "figures")
    assert not (run / "figures").exists()
