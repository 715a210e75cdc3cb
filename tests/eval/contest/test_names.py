"""Names of methods: whatever somebody calls theirs, no row and no file is taken for another's, or that is said."""

from importlib.metadata import EntryPoint

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest import entry as module
from hippodrome.eval.contest.entry import BUILT_IN, entries_of, parse_method, with_methods
from hippodrome.eval.methods.method import METHODS
from hippodrome.sim.scenario import Scenario

COMMAND = "exec:./run.sh {sequence} {out}"


def entries(*names):
    return entries_of(with_methods(Scenario(name="a"), [parse_method(f"{name}={COMMAND}") for name in names]))


@pytest.mark.parametrize("name", sorted({*(m.key for m in METHODS), *(m.stem for m in METHODS), *(m.label for m in METHODS)}))
def test_a_name_of_ours_in_any_form_is_taken(name):
    if name == "orbslam3" or name.startswith("orbslam3_"):  # a key that only rows of ORB-SLAM3 have, which is no file
        return
    with pytest.raises(HippodromeError, match="there is one of this name already; give it another name, NAME="):
        entries(name)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("a b", "a-b"), "there is one of this name already"),
        (("a (b)", "a-b"), "there is one of this name already"),
        (("ground-truth",), "its file ground-truth.tum would be that of the truth"),
        (("localization-ground-truth",), "its file localization-ground-truth.tum would be that of the truth"),
        (("topometric-default",), "its file topometric-default.pbstream would be that of 'topometric'"),
        (("mine", "mine-localization"), "its file mine-localization.tum would be that of 'mine'"),
        (("mine-localization", "mine"), "its file mine-localization.tum would be that of 'mine-localization'"),
    ],
)
def test_no_file_is_written_twice(names, words):
    with pytest.raises(HippodromeError, match=words):
        entries(*names)


def test_other_names_take_part():
    found = entries("mine", "Mine", "a.b", "x_1+2", "results", "scenario", "program (v2)")
    assert len(found) == len(BUILT_IN) + 7
    assert len({entry.method.key for entry in found}) == len(found)


@pytest.mark.parametrize("name", ["a/b", "../x", "grün", "a\n", "", " a", "x" * 41, "a\tb", "a'b", "☃"])
def test_what_is_no_name_is_told_as_one(name):
    with pytest.raises(ValueError, match=r"is no name of a method: a name begins with a letter or digit"):
        parse_method(f"{name}={COMMAND}")


def test_an_equals_sign_of_a_command_makes_no_name():
    assert parse_method("exec:env A=1 ./x {sequence} {out}").spec.command == "env A=1 ./x {sequence} {out}"
    assert parse_method("m=exec:./x --a=b {sequence} {out}").name == "m"


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (
            [("mine", "package.module:Mine"), ("mine", "other.module:Mine")],
            "several installed methods.*other.module:Mine, package",
        ),
        ([("mine", "package.module")], "makes 'package.module' known as a method, which is no my_package.my_module:MyClass"),
        ([("other", "package.module:Mine")], r"nor an installed method \(ORB-SLAM3, other\)"),
        ([("ORB-SLAM3", "package.module:Mine"), ("mine", "a:B"), ("mine", "a:B")], None),
    ],
)
def test_entry_points_of_packages_are_classes_of_one_name_each(monkeypatch, points, words):
    known = [EntryPoint(name, value, module.GROUP) for name, value in points]
    monkeypatch.setattr(module, "entry_points", lambda group: known)
    if words is None:
        assert parse_method("mine").spec.class_ == "a:B"
        with pytest.raises(ValueError, match="several installed methods"):
            parse_method("ORB-SLAM3")
        return
    with pytest.raises(ValueError, match=words):
        parse_method("mine")
