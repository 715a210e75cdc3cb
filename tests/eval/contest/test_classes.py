"""A Python class takes part: what it declares, what it is given, and a row with the cause for whatever it does."""

import textwrap
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import hippodrome.eval.contest.perform
from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.apart import CHILD
from hippodrome.eval.contest.entry import BUILT_IN, entries_of, parse_method, with_methods
from hippodrome.eval.contest.loading import load_class, made_of
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.programs.containment import can_contain
from hippodrome.sim.scenario import Scenario
from tests.eval.contest.entrants import MAPPER

MODULE = f"""\
import os, sys, time
from dataclasses import replace
import numpy as np
from pydantic import BaseModel
from hippodrome.core.types import Trajectory
from hippodrome.eval.methods.protocol import Answer, Mapped, Needs
{MAPPER}
class Configured(Mapper):
    class Config(BaseModel):
        factor: float = 1.0
    def __init__(self, config):
        self.factor = config.factor

class Asking(Mapper):
    needs = Needs(camera=False, road_network=True, start_pose=True)
    def map(self, observations, given):
        assert given.roads == "the roads" and given.start.x_m < 1.0
        observations = list(observations)
        assert all(one.frame is None for one in observations)
        return Mapper.map(self, observations, given)

class Blind(Mapper):
    def map(self, observations, given):
        assert given.roads is None and given.start is None
        return super().map(observations, given)

class Localizer(Mapper):
    frame = "network"
    def localize(self, observations, given):
        for one, pose in zip(observations, given.mapped.trajectory.poses):
            yield Answer(one.t_s, *pose, localized=one.t_s > 5.0)

class Silent(Mapper):
    frame = "network"
    def localize(self, observations, given):
        return []

class Crash:
    def map(self, observations, given):
        raise ValueError("wrong thing")

class Leaves:
    def map(self, observations, given):
        raise SystemExit(3)

class Nan:
    def map(self, observations, given):
        return ((one.t_s, math.nan, 0.0, 0.0) for one in observations)

class Backwards:
    def map(self, observations, given):
        return [(-one.t_s, 0.0, 0.0, 0.0) for one in observations]

class Nothing:
    def map(self, observations, given):
        return None

class Words:
    def map(self, observations, given):
        return ["a", "b"]

class Odd(Mapper):  # what comes of it is found out when it is scored, not before
    def map(self, observations, given):
        poses = np.array(list(super().map(observations, given)))
        return Mapped(Trajectory(poses[:, 0], poses[:, 1:]), figures=dict(ape="good"))

class Saves(Mapper):
    def map(self, observations, given):
        poses = np.array(list(super().map(observations, given)))
        self.text = "a map"
        return Mapped(Trajectory(poses[:, 0], poses[:, 1:]), save=lambda path: path.write_text(self.text))

class SavesNot(Saves):
    def map(self, observations, given):
        return replace(super().map(observations, given), save=lambda path: 1 / 0)

class Reads(Mapper):  # standard input, which is not its own
    def map(self, observations, given):
        sys.stdin.read()
        return super().map(observations, given)

class Asks(Mapper):
    def map(self, observations, given):
        input("which way?")

class Scribbles(Mapper):
    def map(self, observations, given):
        for number in range(3, 30):
            try:
                os.write(number, bytes([255]) * 1000)
            except OSError:
                pass
        return super().map(observations, given)

class Speechless:
    def map(self, observations, given):
        class Silence(Exception):
            def __str__(self):
                raise ValueError
        raise Silence

class Gibberish:
    def map(self, observations, given):
        raise ValueError("\\udcff\\x1b[31m")

class Lambda(Mapper):
    def map(self, observations, given):
        return Mapped(Trajectory(np.zeros(1), np.zeros((1, 3))), figures=dict(mine=lambda: 1))

class Daemon(Mapper):
    def map(self, observations, given):
        if os.fork() == 0:
            os.setsid()
            time.sleep(1000.0 + given.seed)
        (given.folder.parent / "forked").touch()
        return super().map(observations, given)

class Half(Mapper):
    def map(self, observations, given):
        return list(super().map(observations, given))[:350]

class Little(Mapper):
    def map(self, observations, given):
        return list(super().map(observations, given))[:50]

class Empty: ...

class Endless:
    def map(self, observations, given):
        while True:
            pass

class Sleeps:
    needs = Needs(camera=False)
    def describe(self, frame):
        import time
        time.sleep(1000.0)

class Hungry:
    def map(self, observations, given):
        return [np.ones(100_000_000) for _ in range(300)]

class Aborts:
    def map(self, observations, given):
        import os
        os.abort()

class Prints(Mapper):
    def __init__(self):
        self.lock = __import__("threading").Lock()  # cannot be pickled
    def map(self, observations, given):
        print("a line on standard output")
        return super().map(observations, given)
    def localize(self, observations, given):
        with self.lock:
            for one in observations:
                yield Answer(one.t_s, 0.0, 0.0, 0.0)
"""


@pytest.fixture(autouse=True)
def module(tmp_path, monkeypatch):
    (tmp_path / "entrants.py").write_text(textwrap.dedent(MODULE))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


def processes():
    """The processes in which a class of a method runs, by their numbers."""
    found = set()
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if entry.name.isdigit() and CHILD.encode() in (entry / "cmdline").read_bytes():
                found.add(int(entry.name))
    return found


def row_of(materials, name, scenario=None):
    entry = entries_of(with_methods(scenario or materials.scenario, [parse_method(f"mine=entrants:{name}")]))[-1]
    return perform(materials, [entry]).rows[0]


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


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Crash", "crashed: ValueError: wrong thing (entrants.py, line"),
        ("Leaves", "it left the process with status 3"),
        ("Nan", "not finite"),
        ("Backwards", "does not increase"),
        ("Nothing", "map() gave a NoneType"),
        ("Words", "map() gave no trajectory"),
        ("Little", "cover"),
        ("Odd", "'ape', which is measured here"),
        ("SavesNot", "ZeroDivisionError"),
        ("Asks", "EOFError"),
        ("Scribbles", "it wrote to a file that it did not open"),
        ("Speechless", "Silence: it cannot say why"),
        ("Gibberish", "ValueError: ??[31m"),
        ("Lambda", "cannot be handed over"),
    ],
)
def test_whatever_it_does_wrong_is_in_its_row(materials, name, cause):
    row = row_of(materials, name)
    assert cause in row.failure
    assert row.ape is None


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


def test_what_cannot_be_scored_falls_in_its_own_row(materials, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(hippodrome.eval.contest.perform, "row_of", broken)
    assert "crashed: ZeroDivisionError: by chance" in row_of(materials, "Mapper").failure


def test_a_method_that_maps_well_and_answers_nothing_keeps_its_errors(materials):
    row = row_of(materials, "Silent")
    assert "0 answers to 600 observations" in row.failure
    assert row.ape is not None


def test_half_a_drive_is_scored_and_said_to_be_half(materials):
    row = row_of(materials, "Half")
    assert row.failure is None
    assert row.covered == pytest.approx(350 / 600, abs=0.02)


def test_a_configuration_is_checked_by_the_method_s_own_model(materials):
    def scenario(**config):
        return Scenario(name="circle", methods={"set": {"class": "entrants:Configured", "config": config}})

    assert made_of(load_class("entrants:Configured"), {"factor": 2.0}, None, "set").factor == 2.0
    with pytest.raises(HippodromeError, match=r"method set: config\.factor: "):
        entries_of(scenario(factor="many"))


@pytest.mark.parametrize(
    ("reference", "cause"),
    [
        ("nowhere:Mapper", "there is no module 'nowhere'"),
        ("entrants:Mappr", "the module has no 'Mappr'"),
        ("entrants:MODULE", "the module has no 'MODULE'"),
        ("entrants:math", "is a module, not a class"),
    ],
)
def test_a_class_that_is_not_there_is_named(reference, cause):
    with pytest.raises(HippodromeError, match=cause):
        load_class(reference)


@pytest.mark.parametrize("text", ["raise SystemExit(0)", "raise BaseException", "import", "1 / 0"])
def test_a_module_that_cannot_be_imported_is_a_sentence(tmp_path, text):
    name = f"script_{abs(hash(text))}"
    (tmp_path / f"{name}.py").write_text(text)
    with pytest.raises(HippodromeError, match=r"importing it failed: .*line 1"):
        load_class(f"{name}:Mapper")


def test_a_class_without_any_of_the_functions_is_refused(materials):
    with pytest.raises(HippodromeError, match="none of the functions map, localize and describe"):
        entries_of(with_methods(materials.scenario, [parse_method("entrants:Empty")]))


def test_two_methods_of_one_name_are_refused(materials):
    twice = [parse_method("entrants:Mapper"), parse_method("entrants:Mapper")]
    for added in (twice, [parse_method("topometric=entrants:Mapper")], [parse_method("ORB-SLAM3=entrants:Mapper")]):
        with pytest.raises(HippodromeError, match="one of this name already"):
            entries_of(with_methods(materials.scenario, added))


@pytest.mark.parametrize("text", ["absent", "exec:./run.sh", "a:b:c", "=x", "mine=", "exec:"])
def test_what_names_no_method_is_refused(text):
    with pytest.raises(ValueError):
        parse_method(text)


def test_ours_are_methods_like_everybody_s():
    entries = entries_of(Scenario(name="town"))
    assert [entry.method for entry in entries] == [cls.card for cls in BUILT_IN]
    assert all("map" in entry.does for entry in entries)
    assert [entry.method.label for entry in entries if "localize" in entry.does] == ["topometric (paper)", "topometric"]
    assert np.unique([entry.method.stem for entry in entries]).size == len(entries)


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Endless", "hung: no end after 3 s, its limit"),
        ("Hungry", "MemoryError"),
        ("Aborts", "crashed: signal 6 (SIGABRT)"),
    ],
)
def test_a_class_that_never_ends_or_takes_too_much_is_contained(materials, name, cause):
    spec = {"class": f"entrants:{name}", "time_limit_s": 3.0 if name == "Endless" else 100.0, "memory_limit_mb": 3000}
    entry = entries_of(Scenario(name="circle", methods={"mine": spec}))[-1]
    assert cause in perform(materials, [entry]).rows[0].failure


def test_a_class_may_print_and_keep_what_cannot_be_pickled_and_its_memory_is_measured(materials):
    row = row_of(materials, "Prints")
    assert row.failure is None
    assert row.localization is not None
    assert row.peak_rss_bytes > 20e6
