"""Broken inputs of every reader end in a sentence: no traceback, no hang, no mountain of memory. Whole ones are read."""

import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from hippodrome.eval.cli import main
from tests.broken import run_case
from tests.eval.exchange.subjects import SUBJECTS

CASES = 12  # of each; python -m tests.broken --cases 3000 runs more


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda one: one.name)
def test_broken_inputs_end_in_a_sentence(tmp_path, subject):
    whole = tmp_path / "whole"
    whole.mkdir()
    subject.write(whole)
    (tmp_path / "first").mkdir()
    assert main(subject.command(whole, tmp_path / "first" / "out")) == 0
    outcomes = [run_case(subject, whole, seed, tmp_path / "case") for seed in range(CASES)]
    assert [one.detail for one in outcomes if one.fault] == []
