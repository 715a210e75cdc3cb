"""A Python class takes part: what it declares, what it is given, and its row."""

import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from hippodrome.eval.contest.apart import CHILD
from hippodrome.eval.contest.entry import BUILT_IN, entries_of
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.programs.containment import can_contain
from hippodrome.sim.scenario import Scenario
from tests.eval.contest.entrants import row_of

pytestmark = pytest.mark.usefixtures("entrants")


def processes():
    """The processes in which a class of a method runs, by their numbers."""
    found = set()
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if entry.name.isdigit() and CHILD.encode() in (entry / "cmdline").read_bytes():
                found.add(int(entry.name))
    return found


def test_a_mapper_has_its_errors_under_every_alignment(materials):
    row = row_of(materials, "Mapper")
    assert (row.failure, row.method) == (None, "mine")
    assert row.ape_sim2.mean_m <= row.ape_se2.mean_m <= row.ape.mean_m < 1.0
    assert row.latency_ms.p99 >= row.latency_ms.median > 0.0


def test_a_method_is_given_what_it_declares_and_nothing_else(materials):
    assert row_of(materials, "Asking").failure is None
    assert row_of(materials, "Blind").failure is None


def test_a_localizer_answers_once_per_observation(materials):
    found = row_of(materials, "Localizer").localization
    assert found.success
    assert found.initial_drive_s == pytest.approx(5.0, abs=0.2)
    assert found.mean_nees is None  # it knows no covariance


def test_a_class_may_read_standard_input_and_save_what_stays_in_its_process(materials):
    assert row_of(materials, "Reads").failure is None
    row = row_of(materials, "Saves")
    assert (row.failure, row.map_bytes) == (None, len("a map"))
    assert (materials.folder / "mine.pbstream").read_text() == "a map"


def test_what_a_class_leaves_running_ends_with_it(materials):
    if not can_contain():
        pytest.skip("this system has no namespaces for users")
    before = processes()
    assert row_of(materials, "Daemon").failure is None
    assert processes() <= before


def test_half_a_drive_is_scored_and_said_to_be_half(materials):
    row = row_of(materials, "Half")
    assert row.failure is None
    assert row.covered == pytest.approx(350 / 600, abs=0.02)


def test_a_class_may_print_and_keep_what_cannot_be_pickled_and_its_memory_is_measured(materials):
    row = row_of(materials, "Prints")
    assert row.failure is None
    assert row.localization is not None
    assert row.peak_rss_bytes > 20e6


def test_ours_are_methods_like_everybody_s():
    entries = entries_of(Scenario(name="town"))
    assert [entry.method for entry in entries] == [cls.card for cls in BUILT_IN]
    assert all("map" in entry.does for entry in entries)
    assert [entry.method.label for entry in entries if "localize" in entry.does] == ["topometric (paper)", "topometric"]
    assert np.unique([entry.method.stem for entry in entries]).size == len(entries)


def test_a_state_goes_to_whoever_builds_on_it_and_is_not_opened_here(materials, monkeypatch):
    monkeypatch.delitem(sys.modules, "entrants", raising=False)
    methods = {"first": "entrants:Remembers", "second": "entrants:OnRemembers"}
    rows = perform(materials, entries_of(Scenario(name="circle", methods=methods))[-2:]).rows
    assert [row.failure for row in rows] == [None, None]
    assert rows[1].localization.success
    assert "entrants" not in sys.modules
