"""Old names of keys and values go on working."""

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.sweep.grid import with_value
from hippodrome.sim.renamed import _tell_removed, present_key
from hippodrome.sim.scenario import Scenario, load_scenario

OLD = """name: old
refine: {mode: default, default: {search: {bin_m: 2.0}}}
localizer: {mode: default, head: {mode: default}, paper: {head: {mode: paper}}}
mapper: {attractor: {grid: {mode: default}}}
"""


def test_a_scenario_with_old_names_is_the_one_with_the_new(tmp_path):
    path = tmp_path / "old.yaml"
    path.write_text(OLD)
    new = OLD.replace("mode: default, default:", "mode: route, route:").replace("{mode: default, head", "{mode: coupled, head")
    (tmp_path / "new.yaml").write_text(new.replace("mode: default", "mode: bounded"))
    scenario = load_scenario(path)
    assert scenario == load_scenario(tmp_path / "new.yaml")
    assert (scenario.refine.mode, scenario.refine.route.search.bin_m) == ("route", 2.0)


def test_old_and_new_side_by_side_are_refused(tmp_path):
    path = tmp_path / "both.yaml"
    path.write_text("name: both\nrefine: {default: {}, route: {}}\n")
    with pytest.raises(HippodromeError, match=r"refine\.default: unknown key"):
        load_scenario(path)


def test_a_removed_key_is_ignored_and_said_once(tmp_path, capsys):
    path = tmp_path / "old.yaml"
    path.write_text("name: old\nrefine: {default: {confidence: {turning_nats: 5.0, window: 30}}}\n")
    _tell_removed.cache_clear()
    assert [load_scenario(path).refine.route.confidence.window for _ in range(2)] == [30, 30]
    said = capsys.readouterr().err
    assert said.count("refine.route.confidence.turning_nats has no effect any more and is ignored: a route is now held") == 1


def test_a_removed_key_cannot_be_swept():
    with pytest.raises(HippodromeError, match="has no effect any more"):
        with_value(Scenario(name="x"), "refine.default.confidence.turning_nats", 5.0)


def test_only_the_renamed_key_is_translated():
    assert present_key("refine.default.search.bin_m") == "refine.route.search.bin_m"
    assert present_key("refine.defaults") == "refine.defaults"
    with pytest.raises(ValueError, match="mode"):
        Scenario.model_validate({"name": "x", "localizer": {"mode": "route"}})
