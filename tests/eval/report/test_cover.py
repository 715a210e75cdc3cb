"""The README's picture and table: they show a run, and the README holds what the command would write."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from hippodrome.core.types import HippodromeError
from hippodrome.eval.report.cover import (
    BEGIN,
    END,
    draw_cover,
    with_table,
)
from hippodrome.eval.report.evidence import MapEvidence
from hippodrome.eval.report.film import draw_film
from hippodrome.eval.results.model import (
    ErrorSummary,
    LocalizationSummary,
    Network,
    Results,
    Row,
    ScenarioResult,
    write_results,
)
from hippodrome.eval.results.paper_rows import quoted_rows
from tests.eval.report.samples import write_run

ROOT = Path(__file__).parents[3]
PATH = {"t_s": [0.0, 1.0, 2.0], "x_m": [0.0, 50.0, 50.0], "y_m": [0.0, 0.0, 40.0]}


def result(*methods):
    located = LocalizationSummary(definition="d", success=True, error_mean_m=0.345)
    rows = tuple(Row(method=name, ape=ErrorSummary(definition="a", mean_m=float(i) + 0.25), localization=located)
                 for i, name in enumerate(methods))  # fmt: skip
    network = Network(generator="grid", edges=1, km=1.0)
    return ScenarioResult(name="town", seed=1, network=network, noise="paper", frames=3, duration_s=2.0, rows=rows)


def evidence(*methods):
    layers = [{"name": name, **PATH, "error_m": [0.1, 2.0, None], "worst": []} for name in methods]
    return MapEvidence.model_validate({
        "roads": [[0.0, 0.0, 50.0, 0.0, 50.0, 40.0]], "truth": PATH, "methods": layers, "drives": [],
        "thumbnails": {"t_s": [0.0, 0.5, 1.0, 1.5, 1.8, 2.0], "columns": 3, "width": 16, "height": 12},
        "start": (0.0, 0.0, 0.0), "recordings": {}, "network": "n",
    })  # fmt: skip


@pytest.fixture
def run(tmp_path):
    methods = ("semi-metric", "topometric")
    write_results(tmp_path / "results.json", Results(scenarios=(result(*methods),)))
    (tmp_path / "town").mkdir()
    (tmp_path / "town" / "map.json").write_text(evidence(*methods).model_dump_json())
    cv2.imwrite(str(tmp_path / "town" / "thumbnails.jpg"), np.full((24, 48, 3), (0, 0, 255), np.uint8))
    return tmp_path


def test_shows_frames_and_maps_and_is_the_same_each_time(run):
    for name in ("one.png", "two.png"):
        draw_cover(run, "town", run / name)
    image = cv2.imread(str(run / "one.png")).astype(int)
    red = (image[:, :, 2] > 200) & (image[:, :, 1] < 60)
    assert red[:, : image.shape[1] // 3].sum() > 10_000  # the frames, on the left
    assert (run / "one.png").read_bytes() == (run / "two.png").read_bytes()


def test_a_run_whose_map_failed_makes_no_picture(run):
    write_results(run / "results.json", Results(scenarios=(result("semi-metric"),)))
    with pytest.raises(HippodromeError, match="no map 'topometric', for it failed"):
        draw_cover(run, "town", run / "one.png")


def test_table_holds_measured_and_quoted_rows():
    text = with_table(f"before {BEGIN}old{END} after", result("semi-metric", "topometric"), quoted_rows())
    assert text.startswith("before ") and text.endswith(" after") and "old" not in text
    assert "| topometric | - | 1.25 | - | - | - | 0.34 |" in text
    assert all(f"| {row.method} †" in text for row in quoted_rows())


def test_the_readme_has_both_and_the_picture_is_small():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "| topometric |" in text.split(BEGIN)[1].split(END)[0]
    assert (ROOT / "docs" / "result.png").stat().st_size < 200_000


def test_the_film_tells_the_story_in_eight_seconds_and_is_the_same_each_time(tmp_path):
    write_run(tmp_path)
    for name in ("one.webp", "two.webp"):
        draw_film(tmp_path, "town & co", tmp_path / name)
    with Image.open(tmp_path / "one.webp") as film:
        durations_ms = [(film.seek(number), film.load(), film.info["duration"])[2] for number in range(film.n_frames)]
    assert 7_500 <= sum(durations_ms) <= 8_500 and len(durations_ms) > 40
    assert (tmp_path / "one.webp").read_bytes() == (tmp_path / "two.webp").read_bytes()


def test_a_film_needs_a_map_that_did_not_fail(tmp_path):
    write_run(tmp_path)
    data = evidence("semi-metric")
    (tmp_path / "town & co" / "map.json").write_text(data.model_dump_json())
    with pytest.raises(HippodromeError, match="no map 'topometric', for it failed"):
        draw_film(tmp_path, "town & co", tmp_path / "one.webp")


def test_the_readme_begins_with_the_film_which_is_small():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "(docs/film.webp)" in text[:300]
    assert (ROOT / "docs" / "film.webp").stat().st_size < 3_000_000
