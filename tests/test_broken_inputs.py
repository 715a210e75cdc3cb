"""Broken inputs of all readers but those of import end in a sentence; those are in tests/eval/exchange/. ``make fuzz``: more."""

import pytest

from hippodrome.eval.cli import main
from tests.broken import TooLong, _run, campaign, run_case
from tests.subjects import MORE

CASES = 5  # of each: some 20 seconds in all
FAST = [one for one in MORE if not one.slow]


@pytest.mark.parametrize("subject", FAST, ids=lambda one: one.name)
def test_broken_inputs_end_in_a_sentence(tmp_path, subject):
    whole = tmp_path / "whole"
    whole.mkdir()
    subject.write(whole)
    (tmp_path / "first").mkdir()
    assert main(subject.command(whole, tmp_path / "first" / "out")) == 0
    outcomes = [run_case(subject, whole, seed, tmp_path / "case") for seed in range(CASES)]
    assert [one.detail for one in outcomes if one.fault] == []


def test_the_campaign_tells_what_falls(tmp_path, monkeypatch):
    """A reader with each fault there is; the same seed breaks the same inputs."""
    (subject,) = [one for one in MORE if one.name == "results-compare"]
    faults = iter([TooLong(), KeyError("x"), None, 70])

    def reader(_command):
        fault = next(faults)
        if isinstance(fault, BaseException):
            raise fault
        return fault or 0

    monkeypatch.setattr("tests.broken.main", reader)
    assert [_run(subject, [], "").fault for _ in range(4)] == ["hang", "traceback", "", "no sentence"]
    monkeypatch.setattr("tests.broken.main", lambda _command: 0)
    one, other = (campaign([subject], 4, 7, tmp_path / name, 60.0) for name in ("a", "b"))
    assert one == other and len(one) == 4 and all(outcome.accepted for outcome in one)
