"""Table II's sequences are as long as published, spread over the drive, and a missing map or a short drive is a named failure."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.results.model import LocalizationSummary
from hippodrome.eval.results.table_two import SequenceRow, table_two_markdown, write_table_two
from hippodrome.eval.rivals import sequences
from hippodrome.eval.rivals.sequences import localize_sequences

STEPS = 2001
STRAIGHT = SimpleNamespace(
    samples=SimpleNamespace(poses_m=np.column_stack([np.arange(STEPS) * 0.8, np.zeros((STEPS, 2))]), t_s=0.1 * np.arange(STEPS))
)


@pytest.mark.parametrize("length_m", [170.0, 804.3, 1485.3])
def test_sequences_have_their_length_and_lie_on_the_drive(length_m):
    pieces = [cut(STRAIGHT, number, 10, length_m) for number in range(1, 11)]
    for first, end in pieces:
        assert 0 <= first < end <= STEPS
        assert (end - first) * 0.8 == pytest.approx(length_m, abs=0.81)
    starts = [first for first, _ in pieces]
    assert starts[0] == 0
    assert starts == sorted(starts)
    assert np.ptp(np.diff(starts)) <= 1


def test_a_short_drive_is_named():
    with pytest.raises(HippodromeError, match="1600 m long, the sequence 1700 m"):
        cut(STRAIGHT, 1, 10, 1700.0)


def test_a_missing_map_gives_rows_that_say_so(monkeypatch, tmp_path):
    monkeypatch.setattr(sequences, "warm_up", lambda: None)
    rows = [one.row for one in localize_sequences(SimpleNamespace(folder=tmp_path), (100.0, 200.0))]
    assert len(rows) == 4
    assert all("no map" in row.failure for row in rows)
    assert table_two_markdown(rows).count("FAILED") == 8  # in the table and beneath it


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
