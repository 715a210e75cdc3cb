from io import StringIO

import pytest
from rich.console import Console

from hippodrome.eval.results.model import (
    ErrorSummary,
    LocalizationSummary,
    Network,
    Results,
    Row,
    ScenarioResult,
)
from hippodrome.eval.results.paper_rows import quoted_rows
from hippodrome.eval.results.tables import QUOTED_MARK, print_table_one, table_one_markdown
from hippodrome.eval.results.terminal import wrapped_title


def error(mean_m, definition="APE, no alignment"):
    return ErrorSummary(definition=definition, mean_m=mean_m, median_m=0.2, p95_m=0.9, max_m=12.345, count=3)


def results():
    localization = LocalizationSummary(definition="x", success=False, false_fixes=2, localized_share=0.125)
    rows = (
        Row(
            method="topometric",
            ape=error(0.31415),
            cpu_percent=0.00123,
            map_bytes=1_234_567,
            vertices=1400,
            localization=localization,
        ),
        Row(method="ORB-SLAM3 (live)", failure="lost | after frame 3"),
    )
    network = Network(generator="rural", edges=10, km=7.2)
    scenario = ScenarioResult(name="rural", seed=4, network=network, noise="paper", frames=14717, duration_s=1315.0, rows=rows)
    return Results(scenarios=(scenario,))


def cells(markdown, method):
    line = next(line for line in markdown.splitlines() if line.startswith(f"| {method}"))
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_cells_by_hand():
    markdown = table_one_markdown(results(), quoted_rows())
    header = cells(markdown, "Method")
    row = dict(zip(header, cells(markdown, "topometric |"), strict=True))
    assert row["CPU (%)"] == "0.001"
    assert row["Map (MB)"] == "1.23"
    assert row["Vertices"] == "1,400"
    assert row["APE (m)"] == "0.31"
    assert row["APE median / p95 / max"] == "0.20 / 0.90 / 12.35"
    assert row["RPE (m)"] == "-"


def test_quoted_rows_are_marked_and_explained():
    markdown = table_one_markdown(results(), quoted_rows())
    assert cells(markdown, "Topometric map (Mono, ours)")[0].endswith(QUOTED_MARK)
    assert f"- {QUOTED_MARK} quoted from the paper" in markdown
    assert QUOTED_MARK not in table_one_markdown(results())


def test_a_failure_is_a_row_with_its_reason():
    markdown = table_one_markdown(results())
    assert cells(markdown, "ORB-SLAM3")[0] == "ORB-SLAM3 (live) (FAILED)"
    assert "- ORB-SLAM3 (live): FAILED: lost \\| after frame 3" in markdown


def test_a_failed_localization_is_visible():
    table = table_one_markdown(results()).partition("### Localization")[2]
    assert cells(table, "topometric") == ["topometric", "NO", "12.5", "2"]


def test_every_definition_is_printed_once():
    markdown = table_one_markdown(results(), quoted_rows())
    assert markdown.count("APE, no alignment") == 1
    assert "APE (topometric): APE, no alignment" in markdown


def test_columns_are_as_many_in_every_line():
    for block in table_one_markdown(results(), quoted_rows()).split("\n\n"):
        if block.startswith("|"):
            assert len({line.replace("\\|", "").count("|") for line in block.splitlines()}) == 1


@pytest.mark.parametrize("width", [80, 200])
def test_the_terminal_shows_the_same(width):
    stream = StringIO()
    print_table_one(results(), quoted_rows(), Console(file=stream, width=width))
    text = stream.getvalue()
    assert "lost | after frame 3" in text
    assert "rural: generated, rural, 7.2 km of road, seed 4, noise paper, 14,717 frames" in " ".join(text.split())
    assert "12.3" in text  # the worst error
    assert "…" not in text


def refused_results():
    rows = (
        Row(method="semi-metric", ape=error(90.0), ape_sim2=error(1.5)),
        Row(method="topometric", ape=error(761.0), ape_sim2=error(2.5), refused="all of its 3 vertices; drive farther"),
        Row(method="topometric (paper)", ape=error(3.0), ape_sim2=error(2.0)),
    )
    return Results(scenarios=(results().scenarios[0].model_copy(update={"rows": rows}),))


def test_a_refused_map_is_seen_to_be_refused():
    markdown = table_one_markdown(refused_results())
    row = dict(zip(cells(markdown, "Method"), cells(markdown, "topometric (REFUSED)"), strict=True))
    assert row["APE (m)"] == "(761.00)"
    assert "- topometric: REFUSED: all of its 3 vertices; drive farther" in markdown
    stream = StringIO()
    print_table_one(refused_results(), (), Console(file=stream, width=80))
    assert "topometric REFUSED" in stream.getvalue()
    assert "(761)" in stream.getvalue()
    assert "topometric: REFUSED: all of its 3 vertices; drive farther" in stream.getvalue()


def test_where_an_aligned_rival_is_better_a_sentence_says_so():
    sentence = "semi-metric is better here than any map on the roads: 1.50 m, topometric (paper) 2.00 m."
    assert sentence in table_one_markdown(refused_results())
    assert "similarity fit, " not in table_one_markdown(results())


def test_why_a_drive_without_truth_has_no_errors_is_said_once_for_all_its_methods():
    scenario = results().scenarios[0]
    rows = tuple(Row(method=name, unscored="the truth is not known", cpu_percent=1.0) for name in ("semi-metric", "topometric"))
    markdown = table_one_markdown(Results(scenarios=(scenario.model_copy(update={"rows": rows}),)), [])
    assert markdown.count("not scored (semi-metric, topometric): the truth is not known") == 1


def test_a_title_parts_no_figure_from_its_unit():
    title = "radial: generated, radial, 2.9 km of road, seed 1, noise paper, 2,694 frames, 539 s"
    lines = wrapped_title(title).splitlines()
    assert lines[-1] == "539 s" and " ".join(lines) == title
    assert max(map(len, lines)) < 80
