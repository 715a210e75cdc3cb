"""Table II as JSON and as Markdown, with the published figures below ours."""

import json

from hippodrome.eval.results.model import LocalizationSummary
from hippodrome.eval.results.table_two import SequenceRow, table_two_markdown, write_table_two


def test_figures_reach_both_files(tmp_path):
    found = LocalizationSummary(
        definition="d", success=True, initial_time_ms=1.25, initial_distance_m=9.5, error_mean_m=0.44, false_fixes=0
    )
    write_table_two(
        tmp_path, "town", [SequenceRow(method="topometric", number=3, length_m=170.0, first_step=7, localization=found)]
    )
    assert "| topometric | 3 | 170 | yes | 1.25 | 9.50 | 0.44 | 0 |" in (tmp_path / "table2.md").read_text()
    (row,) = json.loads((tmp_path / "town" / "table2.json").read_text())
    assert row["localization"]["initial_time_ms"] == 1.25


def test_published_figures_stand_beside_ours_and_are_marked():
    text = table_two_markdown([])
    assert text.count("†") == 21
    assert "| ORB-SLAM3 (Binocular) † | 3 | 170 | - | 1077 | - | 3.69 | - |" in text
