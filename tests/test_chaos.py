"""A command that is killed leaves nothing, and its rerun has the same results; ``make chaos`` does it more often."""

import signal
import sys
import time
from collections import Counter

import pytest

from tests.chaos import SIGNALS, TARGETS, attempt_of, carried_out
from tests.disturbed import USUAL, Attempt, Chaos, _right_words
from tests.families import session
from tests.machine_faults import KINDS, fault_of
from tests.same_files import differences, extra

ENOUGH_S = 30.0  # a slow machine leaves the pair to ``make chaos``
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")


def test_a_killed_command_and_a_pair_in_one_folder(tmp_path):
    """A kill, and more of what the campaign does as far as half a minute reaches."""
    chaos = Chaos(tmp_path, twice=False)
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
    attempts = [attempt_of(3, number, True) for number in range(42)]
    assert attempts == [attempt_of(3, number, True) for number in range(42)]
    assert attempts != [attempt_of(4, number, True) for number in range(42)]
    found = {(one.command, one.target, one.number) for one in attempts}
    everything = {(command, target, number) for command in USUAL for target in TARGETS for number in SIGNALS}
    assert found == everything | {("sweep", "dask", "SIGTERM"), ("sweep", "dask", "SIGKILL")}
    more = [attempt_of(3, number, True, baselines=True) for number in range(54)]
    assert sum(one.command == "baselines" for one in more) == 12


def test_faults_are_those_of_the_seed():
    faults = [fault_of(3, number) for number in range(20)]
    assert faults == [fault_of(3, number) for number in range(20)] and {one.kind for one in faults} == set(KINDS)
    assert len({(one.command, one.kind) for one in faults}) == 15


def test_a_signal_that_meets_nobody_is_not_counted_and_faults_are(capsys):
    answers = iter([None, ["ended: a", "ended: b", "orphan: c"], [], None, []])
    tally = Counter()
    assert carried_out((("kill", lambda: next(answers)) for _ in range(9)), 3, time.monotonic() + 9.0, tally) == 3
    assert (tally["fell"], tally["nobody"], tally["ended"], tally["orphan"]) == (1, 2, 1, 1)
    assert carried_out(iter([("kill", lambda: None)] * 4), 2, time.monotonic() + 9.0, tally) == 0
    assert "it met nobody" in capsys.readouterr().out


@pytest.mark.parametrize(("status", "told", "right"), [
    (143, ["hippodrome: ended by SIGTERM; what was finished is kept, the same command resumes"], True),
    (130, ["hippodrome: interrupted; what was finished is kept, the same command resumes"], True),
    (129, [], False),
    (2, ["hippodrome: simulate: a worker process died"], True),
    (2, ["hippodrome: one thing", "and another"], False),
    (-9, [], True),
    (-9, ["resource_tracker: There appear to be 5 leaked semaphore objects"], False),
    (0, [], True),
])  # fmt: skip
def test_the_words_go_with_the_status(status, told, right):
    assert _right_words(status, told) is right


def test_files_are_compared_byte_by_byte_but_for_times(tmp_path):
    whole, out = tmp_path / "whole", tmp_path / "out"
    texts = {
        "results.json": '{"ape": 1, "cpu_percent": 2}',
        "table1.md": "| 1.5 | <0.1 % |",
        "map.npz": "a",
        "orb-slam3.json": "1",
    }
    for folder in (whole, out):
        folder.mkdir()
        for name, text in texts.items():
            (folder / name).write_text(text)
    assert differences(whole, out) == extra(whole, out) == []
    (out / "results.json").write_text('{"ape": 1, "cpu_percent": 3}')
    (out / "table1.md").write_text("| 1.5 | 3 % |")
    (out / "orb-slam3.json").write_text("2")
    assert differences(whole, out) == []
    (out / "results.json").write_text('{"ape": 2, "cpu_percent": 3}')
    (out / "table1.md").write_text("| 1.5 | no |")
    (out / "map.npz").unlink()
    (out / "map.npy").write_text("")
    assert differences(whole, out) == ["map.npz is lost", "results.json has other bytes", "table1.md has other bytes"]
    assert extra(whole, out) == ["map.npy"]
