"""A class of a method is found by its name, in a process with limits: nothing of it is imported here."""

import sys

import pytest

import hippodrome.eval.contest.apart
from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import entries_of, parse_method, with_methods
from hippodrome.eval.contest.loading import load_class, made_of
from hippodrome.eval.contest.sources import method_sha256
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import Scenario

pytestmark = pytest.mark.usefixtures("entrants")


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
        ("entrants:Mappr", "the module entrants has no 'Mappr'"),
        ("entrants:MODULE", "the module entrants has no 'MODULE'"),
        ("entrants:math", "that is a module, not a class"),
    ],
)
def test_a_class_that_is_not_there_is_named(reference, cause):
    with pytest.raises(HippodromeError, match=cause):
        load_class(reference)


@pytest.mark.parametrize("text", ["raise SystemExit(0)", "raise BaseException", "import", "1 / 0"])
def test_a_module_that_cannot_be_imported_is_a_sentence(tmp_path, text):
    name = f"script_{abs(hash(text))}"
    (tmp_path / f"{name}.py").write_text(text)
    with pytest.raises(HippodromeError, match=r"importing script_\d+ failed: .*line 1"):
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


@pytest.mark.parametrize(
    ("name", "text", "cause"),
    [
        ("package.module", "import time\ntime.sleep(1000)", "hung: no end after 5 s, its limit"),
        ("hanging", "while True: pass", "hung: no end after 5 s, its limit"),
        ("hanging", "import os\nos._exit(0)", "it ended its process with status 0 before it answered"),
        ("package.module", "import os\nos.abort()", "crashed: signal 6 (SIGABRT)"),
    ],
)
def test_a_module_that_hangs_or_dies_when_it_is_imported_is_named_in_time(tmp_path, monkeypatch, name, text, cause):
    monkeypatch.setattr(hippodrome.eval.contest.apart, "IMPORT_LIMIT_S", 5.0 if "hung" in cause else 60.0)
    (tmp_path / "package").mkdir()
    (tmp_path / "package/__init__.py").write_text(text)
    (tmp_path / "hanging.py").write_text(text)
    with pytest.raises(HippodromeError, match=f"method {name}:Mapper: importing its module: ") as caught:
        with_methods(Scenario(name="circle"), [parse_method(f"{name}:Mapper")])
    assert cause in str(caught.value)


def test_nothing_of_a_class_is_imported_here(tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "entrants", raising=False)
    entry = entries_of(with_methods(Scenario(name="circle"), [parse_method("entrants:Localizer")]))[-1]
    assert (entry.method.label, entry.method.frame, entry.does) == ("Localizer", "network", ("map", "localize"))
    assert "entrants" not in sys.modules
    (tmp_path / "package").mkdir()
    (tmp_path / "package/__init__.py").write_text("raise SystemExit")
    (tmp_path / "package/module.py").write_text("1")
    before = method_sha256(MethodSpec.model_validate("package.module:Mapper"))
    (tmp_path / "package/module.py").write_text("2")
    assert method_sha256(MethodSpec.model_validate("package.module:Mapper")) != before
