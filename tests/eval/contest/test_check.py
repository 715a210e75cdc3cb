"""The verdict on a method: what it keeps to, and what not, in words that say what to do."""

import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.contest.check import findings, list_lines
from hippodrome.eval.contest.entry import BUILT_IN, entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform
from tests.eval.contest.entrants import MAPPER

MODULE = f"""\
import os
from hippodrome.eval.methods.protocol import Answer
{MAPPER}
class Moved(Mapper):
    frame = "network"
    def map(self, observations, given):
        return [(t, x + 500.0, y, h) for t, x, y, h in super().map(observations, given)]

class Scaled(Mapper):
    frame = "metric"
    def map(self, observations, given):
        return [(t, 3.0 * x, 3.0 * y, h) for t, x, y, h in super().map(observations, given)]

class Chance(Mapper):
    def map(self, observations, given):
        shift = int.from_bytes(os.urandom(4)) * 1e-12
        return [(t, x + shift, y, h) for t, x, y, h in super().map(observations, given)]

class Degrees(Mapper):
    def map(self, observations, given):
        return [(t, x, y, 57.3 * h) for t, x, y, h in super().map(observations, given)]

class Askew(Mapper):
    frame = "metric"
    def map(self, observations, given):
        return [(t, x, y, h + 1.57) for t, x, y, h in super().map(observations, given)]

class Still:
    frame = "metric"
    def map(self, observations, given):
        return [(one.t_s, 0.0, 0.0, 0.0) for one in observations]

class Lost(Mapper):
    frame = "network"
    def localize(self, observations, given):
        return [Answer(one.t_s, 0.0, 0.0, 0.0, localized=False) for one in observations]

class Broken(Mapper):
    frame = "network"
    def localize(self, observations, given):
        raise RuntimeError("no map")
"""


@pytest.fixture
def verdict(materials, tmp_path, monkeypatch):
    (tmp_path / "checked.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)

    def find(name):
        entry = entries_of(with_methods(materials.scenario, [parse_method(f"checked:{name}")]))[-1]
        once, again = (perform(materials, [entry]) for _ in range(2))
        return [str(finding) for finding in findings(entry, materials, once, again)]

    return find


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("Mapper", "ok   again: the same bytes"),
        ("Mapper", "ok   map: 600 poses from 0.1 s to 60.0 s of 60.0 s"),
        ("Moved", "FAIL frame: it lies 499.8 m off and a rigid fit leaves 0."),
        ("Scaled", "FAIL frame: it is 3.00 times too large to be in metres; declare frame 'own'"),
        ("Degrees", "FAIL heading: it is "),
        ("Askew", "ok   note: heading: it is "),
        ("Chance", "ok   again: not deterministic: two runs are up to"),
        ("Still", "FAIL map: "),
        ("Lost", "ok   localize: localized in 0 % of the steps, never within 20 m"),
        ("Broken", "FAIL localization: crashed: RuntimeError: no map"),
    ],
)
def test_what_a_method_does_is_said_in_words(verdict, name, line):
    assert [found for found in verdict(name) if found.startswith(line)], verdict(name)


def test_the_list_has_ours():
    keys = {names.split()[0] for names, _ in list_lines()}
    assert keys >= {cls.card.key for cls in BUILT_IN}


def test_a_method_that_is_not_there_is_bad_input(capsys):
    assert main(["method", "check", "nowhere:Mapper"]) == 2
    assert "there is no module 'nowhere'" in capsys.readouterr().err
    assert main(["method", "check", "nowhere"]) == 2
    assert "neither module:Class" in capsys.readouterr().err
