"""A command that is killed leaves nothing, and its rerun has the same results; ``make chaos`` does it more often."""

import signal
import sys
import time

import pytest

from tests.chaos import Attempt, Chaos, attempt_of
from tests.families import session
from tests.machine_faults import KINDS, fault_of

ENOUGH_S = 30.0  # a slow machine leaves the pair to ``make chaos``
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")


def test_a_killed_command_and_a_pair_in_one_folder(tmp_path):
    """A kill, and more of what the campaign does as far as half a minute reaches."""
    chaos = Chaos(tmp_path)
    began = time.monotonic()
    assert chaos.killed("kill", Attempt("cell", "main", "SIGKILL", 0.6)) == []
    if time.monotonic() - began < ENOUGH_S:
        assert chaos.pair("kill", "cell", 0.0) == []  # what is done by now is kept


def test_what_falls_is_told(tmp_path):
    """Results that differ, files that are lost or left, and a rerun that fails."""
    chaos = Chaos(tmp_path)
    whole, out = tmp_path / "whole", tmp_path / "out"
    for folder, text in ((whole, "{}"), (out, "{}")):
        (folder / "town").mkdir(parents=True)
        (folder / "town" / "map.json").write_text(text)
    assert chaos.faults_of_rerun(0, "", whole, out) == []
    (whole / "table1.md").write_text("")
    (out / "town" / ".a.json.abcdefgh.part").write_text("")
    (chaos.temporary / "hippodrome-x").mkdir()
    faults = chaos.faults_of_rerun(0, "", whole, out)
    assert [one.partition(":")[0] for one in faults] == ["changed", "leftover", "leftover"]
    assert chaos.faults_of_rerun(2, "no", whole, out)[0].startswith("ended") and session(signal.SIGKILL + 2**22) == []


def test_attempts_are_those_of_the_seed():
    attempts = [attempt_of(3, number, True) for number in range(60)]
    assert attempts == [attempt_of(3, number, True) for number in range(60)]
    assert {one.target for one in attempts} == {"main", "worker", "all", "dask"}
    assert {one.number for one in attempts} == {"SIGTERM", "SIGHUP", "SIGINT", "SIGKILL"}
    assert {one.command for one in attempts} == {"eval", "sweep", "drive"}
    assert "baselines" in {attempt_of(3, number, True, baselines=True).command for number in range(12)}


def test_faults_are_those_of_the_seed():
    faults = [fault_of(3, number) for number in range(20)]
    assert faults == [fault_of(3, number) for number in range(20)] and {one.kind for one in faults} == set(KINDS)
    assert len({(one.command, one.kind) for one in faults}) == 15
