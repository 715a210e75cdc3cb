"""Our localizer on Table II's sequences: a map that is missing is a named failure."""

from types import SimpleNamespace

from hippodrome.eval.results.table_two import table_two_markdown
from hippodrome.eval.rivals import sequences
from hippodrome.eval.rivals.sequences import localize_sequences


def test_a_missing_map_gives_rows_that_say_so(monkeypatch, tmp_path):
    monkeypatch.setattr(sequences, "warm_up", lambda: None)
    rows = [one.row for one in localize_sequences(SimpleNamespace(folder=tmp_path), (100.0, 200.0))]
    assert len(rows) == 4
    assert all("no map" in row.failure for row in rows)
    assert table_two_markdown(rows).count("FAILED") == 8  # in the table and beneath it
