"""Markdown tables: the bytes that every table of the project is written with."""

import pytest

from hippodrome.eval.results.markdown import escaped, table


def test_the_first_column_stands_to_the_left():
    assert table(["a", "b", "c"], [["1", "", "3"]]) == ["| a | b | c |", "|---|---:|---:|", "| 1 |  | 3 |"]


def test_alignment_by_column_and_spaced_rule():
    assert table(["a", ""], [], align="left") == ["| a | |", "|---|---|"]
    assert table(["a", "b", "c"], [], align="llr")[1] == "|---|---|---:|"
    assert table(["a", "b"], [], spaced=True)[1] == "| --- | ---: |"


def test_a_row_of_another_length_is_refused():
    with pytest.raises(ValueError, match="3 cells in a table of 2 columns"):
        table(["a", "b"], [["1", "2", "3"]])
    with pytest.raises(ValueError, match=r"shorter|longer"):
        table(["a", "b"], [], align="l")


def test_text_stays_in_its_cell():
    assert escaped("a|b\nc<d") == "a\\|b c<d"
    assert escaped("a|b\nc<d", html=True) == "a\\|b c&lt;d"
