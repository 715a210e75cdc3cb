"""Scenarios are found by the name that they have in the package, from any folder."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.eval.files.scenarios import effective_configuration, read_scenario
from hippodrome.eval.files.shipped import names, shipped


@pytest.mark.parametrize("name", ["towns/rural", "towns/rural.yaml", "scenarios/towns/rural.yaml"])
def test_a_scenario_of_the_package_is_found_by_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_scenario(Path(name)).name == "rural"


def test_a_file_of_the_user_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "towns").mkdir()
    (tmp_path / "towns/rural").write_text("name: mine\n")
    assert read_scenario(Path("towns/rural")).name == "mine"


@pytest.mark.parametrize("name", ["towns/absent", "../towns/rural", "/towns/rural", "."])
def test_what_is_no_name_stays_a_path_and_is_an_error(name):
    assert shipped(Path(name)) == Path(name)
    with pytest.raises(HippodromeError):
        read_scenario(Path(name))


def test_the_list_names_all_and_each_can_be_read(capsys):
    assert main(["scenario", "list"]) == 0
    printed = capsys.readouterr().out
    found = dict(names())
    assert {"paper", "towns/rural", "library/village", "gate/blocks"} <= set(found)
    assert all(name in printed for name in found)
    assert read_scenario(Path("towns/grid")).name == "grid"


@pytest.mark.parametrize("name", ["towns/rural", "paper"])
def test_the_scenario_that_a_run_keeps_is_the_scenario(name, tmp_path):
    """``scenario.json`` lies beside the results, and the report's commands run it again; JSON has no infinity."""
    scenario = read_scenario(Path(name))
    kept = tmp_path / "scenario.json"
    kept.write_text(json.dumps(effective_configuration(scenario)))
    assert read_scenario(kept) == scenario
    endless = scenario.refine.paper.__class__(bent_cost=math.inf)
    other = scenario.model_copy(update={"refine": replace(scenario.refine, paper=endless)})
    kept.write_text(json.dumps(effective_configuration(other)))
    assert read_scenario(kept) == other
