"""What a Python class does wrong is in its row, with the cause, and touches no other."""

import pytest

import hippodrome.eval.contest.perform
from hippodrome.eval.contest.entry import entries_of
from hippodrome.eval.contest.perform import perform
from hippodrome.sim.scenario import Scenario
from tests.eval.contest.entrants import row_of

pytestmark = pytest.mark.usefixtures("entrants")


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Crash", "crashed: ValueError: wrong thing (entrants.py, line"),
        ("Leaves", "it left the process with status 3"),
        ("Nan", "not finite"),
        ("Backwards", "does not increase"),
        ("Nothing", "map() gave None, as a function does that has no return"),
        ("Words", "map() gave no trajectory"),
        ("Little", "cover"),
        ("Odd", "'ape', which is measured here"),
        ("SavesNot", "ZeroDivisionError"),
        ("Asks", "EOFError"),
        ("Scribbles", "it wrote to a file that it did not open"),
        ("Speechless", "Silence: it cannot say why"),
        ("Gibberish", "ValueError: ??[31m"),
        ("Lambda", "cannot be handed over"),
        ("Strange", "cannot be handed over: it holds a entrants.Memory"),
    ],
)
def test_whatever_it_does_wrong_is_in_its_row(materials, name, cause):
    row = row_of(materials, name)
    assert cause in row.failure
    assert row.ape is None


def test_what_cannot_be_scored_falls_in_its_own_row(materials, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(hippodrome.eval.contest.perform, "row_of", broken)
    assert "crashed: ZeroDivisionError: by chance" in row_of(materials, "Mapper").failure


def test_a_method_that_maps_well_and_answers_nothing_keeps_its_errors(materials):
    row = row_of(materials, "Silent")
    assert "0 answers to 600 observations" in row.failure
    assert row.ape is not None


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Endless", "hung: no end after 3 s, its limit"),
        ("Hungry", "more than its limit of 3000 MB"),
        ("Aborts", "crashed: signal 6 (SIGABRT)"),
    ],
)
def test_a_class_that_never_ends_or_takes_too_much_is_contained(materials, name, cause):
    spec = {"class": f"entrants:{name}", "time_limit_s": 3.0 if name == "Endless" else 100.0, "memory_limit_mb": 3000}
    entry = entries_of(Scenario(name="circle", methods={"mine": spec}))[-1]
    assert cause in perform(materials, [entry]).rows[0].failure


@pytest.mark.parametrize("name", ["Fills", "FillsTemporary"])
def test_a_class_that_fills_the_disk_is_stopped(materials, name):
    spec = {"class": f"entrants:{name}", "disk_limit_mb": 20.0, "time_limit_s": 60.0}
    entry = entries_of(Scenario(name="circle", methods={"mine": spec}))[-1]
    assert "MB on disk, more than its limit of 20 MB, disk_limit_mb" in perform(materials, [entry]).rows[0].failure
