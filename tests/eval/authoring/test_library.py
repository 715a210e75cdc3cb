"""The scenarios that come with the package: each can be driven, and together they show every noise level and condition."""

from pathlib import Path

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.check import check_scenario
from hippodrome.eval.files.scenarios import PACKAGE, portable, read_scenario
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.self_motion import NOISE_LEVELS

ROOT = Path(__file__).parents[3] / "scenarios"
MISSIONS = sorted((ROOT / "missions").glob("*.yaml"))  # in towns like those of the others
FILES = sorted(set(ROOT.rglob("*.yaml")) - set(MISSIONS))
SCENARIOS = {path.stem: read_scenario(path) for path in FILES}


def test_missions_are_in_five_towns():
    missions = [read_scenario(path) for path in MISSIONS]
    assert [scenario.name for scenario in missions] == [f"missions-{path.stem}" for path in MISSIONS]
    assert len({scenario.town.model_dump_json() for scenario in missions}) == 5


def test_is_a_library():
    towns = {name: scenario.town.model_dump_json() for name, scenario in SCENARIOS.items()}
    assert towns.pop("city") == towns["berlin"]  # one sees all of it, the other its middle
    assert len(set(towns.values())) == len(FILES) - 1 >= 12 + 5
    assert sum(SCENARIOS[name].town.network is not None for name in towns) == 3
    assert [scenario.name for scenario in SCENARIOS.values()] == [path.stem for path in FILES]
    assert len(list((ROOT / "towns").glob("*.yaml"))) == 4  # what `make eval` runs


def test_every_noise_level_and_condition_occurs():
    assert {scenario.noise for scenario in SCENARIOS.values()} == set(NOISE_LEVELS)
    seen = [getattr(scenario, role).conditions for scenario in SCENARIOS.values() for role in ("mapping", "localization")]
    for name, field in Conditions.model_fields.items():
        assert any(getattr(one, name) != field.default for one in seen), f"no scenario changes {name}"
    assert {one.season for one in seen} == {"summer", "autumn", "winter"}
    assert any(scenario.camera.yaw_offset_deg for scenario in SCENARIOS.values())
    assert any(scenario.localization.ego.lateral_wander_m for scenario in SCENARIOS.values())
    vehicles = [scenario.localization.traffic.vehicles for scenario in SCENARIOS.values()]
    assert min(vehicles) <= 3 and max(vehicles) >= 40


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_can_be_driven(path):
    finding = check_scenario(path)
    assert finding.errors == ()
    assert not any("see it in netedit" in note for note in finding.notes)  # the cure for what has none of its own


def test_a_packaged_network_is_found_wherever_the_package_lies(tmp_path):
    found = SCENARIOS["braunschweig"].town.network
    assert found.is_file() and found.is_absolute()
    assert portable(found) == "package:sumo/tools/game/bs3d/bs.net.xml"
    other = tmp_path / "own.net.xml"
    assert portable(other) == "own.net.xml"
    (tmp_path / "again.yaml").write_text(f"name: again\ntown: {{network: '{portable(found)}'}}\n")
    assert read_scenario(tmp_path / "again.yaml").town.network == found


@pytest.mark.parametrize(("network", "reason"), [
    ("no_such_package/a.net.xml", "the Python package 'no_such_package' is not installed; install it"),
    ("sumo/nowhere.net.xml", "the installed package 'sumo' has no file nowhere.net.xml; another version may"),
    ("sumo.tools/a.net.xml", "the Python package 'sumo.tools' is not installed"),
])  # fmt: skip
def test_a_packaged_network_that_is_missing_is_said_so(tmp_path, network, reason):
    path = tmp_path / "a.yaml"
    path.write_text(f"name: a\ntown: {{network: '{PACKAGE}{network}'}}\n")
    with pytest.raises(HippodromeError, match=rf"a\.yaml: town\.network: {reason}"):
        read_scenario(path)
