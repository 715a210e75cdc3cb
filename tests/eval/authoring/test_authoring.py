"""Authoring: new, validate, preview, schema, and the reference that is made from the models."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import sumo
import yaml

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.check import check_scenario
from hippodrome.eval.authoring.draft import LOCALIZATION_M, TOUR_M, new_scenario
from hippodrome.eval.authoring.keys import comments, fields_of, models, noise_keys, scenario_keys
from hippodrome.eval.authoring.meanings import MEANINGS
from hippodrome.eval.authoring.preview import visits_of_road
from hippodrome.eval.authoring.reference import reference_markdown, with_tables
from hippodrome.eval.authoring.schema import scenario_schema
from hippodrome.eval.cli import main
from hippodrome.sim.render import probe
from hippodrome.sim.scenario import Scenario, load_scenario
from hippodrome.sim.self_motion import SelfMotionNoise
from hippodrome.sim.town import build_town

ROOT = Path(__file__).parents[3]
NETWORK = Path(sumo.SUMO_HOME) / "tools" / "game" / "fokr_bs_demo" / "fokr_bs.net.xml.gz"


@pytest.fixture
def network(tmp_path):
    path = tmp_path / "nets" / NETWORK.name
    path.parent.mkdir()
    path.write_bytes(NETWORK.read_bytes())
    return path


def test_new_from_a_network_suits_it_and_can_be_used_at_once(tmp_path, network):
    path = tmp_path / "scenarios" / "ring.yaml"
    path.parent.mkdir()
    draft = new_scenario("ring", str(network), path)
    scenario = load_scenario(path)
    assert scenario.town.network == network
    assert "../nets/fokr_bs.net.xml.gz" in path.read_text()
    assert TOUR_M[0] <= scenario.mapping.tour.length_m <= TOUR_M[1]
    assert LOCALIZATION_M[0] <= scenario.localization.tour.length_m <= LOCALIZATION_M[1]
    assert scenario.mapping.tour.length_m == pytest.approx(1300 * draft.drivable_km, abs=51)
    assert scenario.thresholds.ape_mean_m is not None
    assert check_scenario(path).errors == ()


def test_new_moves_with_its_network(tmp_path, network):
    new_scenario("ring", str(network), tmp_path / "ring.yaml")
    moved = tmp_path / "moved"
    moved.mkdir()
    (tmp_path / "nets").rename(moved / "nets")
    (tmp_path / "ring.yaml").rename(moved / "ring.yaml")
    assert check_scenario(moved / "ring.yaml").errors == ()
    shown = load_scenario(moved / "ring.yaml").town.network
    assert shown.is_file()


@pytest.mark.parametrize("kind", ["grid", "rural"])
def test_new_from_a_kind_builds_the_shipped_town(tmp_path, kind):
    path = tmp_path / "a.yaml"
    new_scenario("a", kind, path)
    assert load_scenario(path).town == load_scenario(ROOT / "scenarios" / "towns" / f"{kind}.yaml").town


@pytest.mark.parametrize("name", ["two words", "a: b", "../up", "", "'quoted'", "- x", "yes"])
def test_new_refuses_names_that_no_scenario_may_have_or_quotes_them(tmp_path, name):
    path = tmp_path / "a.yaml"
    if name == "yes":  # allowed, but YAML would read a boolean
        new_scenario(name, "grid", path)
        assert load_scenario(path).name == "yes"
        return
    with pytest.raises(HippodromeError, match="not a scenario's name, which folders are given: letters, digits"):
        new_scenario(name, "grid", path)
    assert not path.exists()


def test_new_overwrites_nothing(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("mine")
    with pytest.raises(HippodromeError, match="exists already"):
        new_scenario("a", "grid", path)
    assert path.read_text() == "mine"


def test_new_says_what_it_takes(tmp_path):
    with pytest.raises(HippodromeError, match=r"neither a kind of town .* nor a file"):
        new_scenario("a", "gird", tmp_path / "a.yaml")


def test_validate_checks_all_files_and_names_line_and_key(tmp_path, capsys):
    good, bad, lost = tmp_path / "good.yaml", tmp_path / "bad.yaml", tmp_path / "lost.yaml"
    good.write_text(
        "name: good\ntown: {kind: grid, width_m: 190, height_m: 190, road_km: 1.3}\nmapping: {tour: {length_m: 300}}\n"
    )
    bad.write_text("name: bad\nmapping:\n  tour: {lenght_m: 300}\n")
    lost.write_text("name: lost\ntown: {network: nowhere.net.xml}\n")
    assert main(["scenario", "validate", str(bad), str(lost), str(good)]) == 2
    said = capsys.readouterr()
    assert f"{bad}:3: mapping.tour.lenght_m: unknown key" in said.err
    assert "nowhere.net.xml" in said.err
    assert f"{good}: ok: good: grid" in said.out
    assert re.search(r"good.yaml: note: the mapping tour sees about \d+% of the drivable roads", said.out)
    assert main(["scenario", "validate", str(good)]) == 0


def test_validate_leaves_nothing_behind(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("name: a\ntown: {kind: grid, width_m: 190, height_m: 190, road_km: 1.3}\n")
    check_scenario(path)
    assert [one.name for one in tmp_path.iterdir()] == ["a.yaml"]


def test_preview_draws_both_drives_without_a_run(tmp_path, capsys):
    shipped = yaml.safe_load((ROOT / "scenarios" / "library" / "village.yaml").read_text(encoding="utf-8"))
    shipped["mapping"]["tour"]["length_m"], shipped["localization"]["tour"]["length_m"] = 500, 200
    path = tmp_path / "a.yaml"
    path.write_text(yaml.safe_dump({**shipped, "camera": {"width": 64, "height": 48, "supersample": 1}}))
    assert main(["scenario", "preview", str(path), "--out", str(tmp_path / "p")]) == 0
    said = capsys.readouterr().out
    assert re.search(r"mapping: (49|5\d)\d m in \d+ s, \d+ frames", said)
    assert "localization drive on mapped roads" in said
    assert {one.name for one in (tmp_path / "p" / "village").iterdir() if one.is_file()} == {"overview.png", "stills.png"}
    assert not (tmp_path / "p" / "village" / "recordings").exists()


def test_preview_says_what_is_wrong_with_the_network_and_else_that_opengl_does_not_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(probe, "_drivers", [])
    monkeypatch.setattr(probe, "TRIAL", (sys.executable, "-c", "raise ImportError('Unable to load EGL library')"))
    drives = "mapping: {tour: {length_m: 300}}\nlocalization: {tour: {length_m: 100}}\n"
    (tmp_path / "broken.net.xml").write_text("<net>")
    for name, town, said in (
        ("broken", "{network: broken.net.xml}", "broken.net.xml: broken network"),
        ("grid", "{kind: grid, width_m: 190, height_m: 190, road_km: 1.3}", "Unable to load EGL library"),
    ):
        path = tmp_path / f"{name}.yaml"
        path.write_text(f"name: {name}\ntown: {town}\n{drives}")
        assert main(["scenario", "preview", str(path), "--out", str(tmp_path / "p")]) == 2
        err = capsys.readouterr().err
        assert said in err and err.count("\n") == 1


def test_visits_count_entries_not_samples(tmp_path):
    spec = load_scenario(ROOT / "scenarios" / "towns" / "grid.yaml").town
    network = build_town(spec, 1, tmp_path).network
    roads = np.flatnonzero(~network.is_internal)[:2]
    inside = np.flatnonzero(network.is_internal)[:1]
    a, b, j = roads[0], roads[1], inside[0]
    visits = visits_of_road(network, np.array([a, a, j, b, j, a, a]))
    same = network.lane_edge[a] == network.lane_edge[b]
    assert not same
    assert visits.tolist() == [2, 2, 1, 1, 1, 2, 2]


def test_every_key_has_a_meaning():
    assert [key.name for key in (*scenario_keys(), *noise_keys()) if not key.meaning] == []


def test_every_meaning_is_of_a_key_that_exists_and_has_no_comment():
    """A comment beside the declaration goes first, so a second meaning would never be shown: remove it from ``MEANINGS``."""
    kinds = (*models(Scenario), *models(SelfMotionNoise))
    fields = {f"{model.__name__}.{name}": comments(model)[name] for model in kinds for name, _, _ in fields_of(model)}
    assert set(MEANINGS) - set(fields) == set()
    assert {name for name in MEANINGS if fields[name]} == set()


def test_keys_are_those_of_the_model():
    def leaves(value, path=()):
        if isinstance(value, dict):
            for name, inner in value.items():
                yield from leaves(inner, (*path, name))
        else:
            yield ".".join(path)

    assert {key.name for key in scenario_keys()} - {"methods", "missions.policies"} == set(
        leaves(Scenario(name="x").model_dump(mode="json"))
    )


def test_reference_is_up_to_date():
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    assert with_tables(text) == text, "docs/scenarios.md: run `make docs`"


def test_reference_names_every_key_of_the_schema():
    text = reference_markdown()
    for key in (*scenario_keys(), *noise_keys()):
        name = key.name.replace("localization.", "mapping.", 1) if key.path[0] == "localization" else key.name
        assert f"| `{name}` |" in text


def test_limits_in_the_reference_are_the_models():
    limits = {key.name: key.limits for key in scenario_keys()}
    assert limits["camera.fov_deg"] == "≥ 20, ≤ 150"
    assert limits["thresholds.ape_mean_m"] == "> 0"
    assert limits["seed"] == "≥ 0, < 2,147,483,648"


def test_schema_describes_what_the_model_takes(capsys):
    assert main(["scenario", "schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema == json.loads(json.dumps(scenario_schema()))
    assert schema["required"] == ["name"]
    assert schema["additionalProperties"] is False
    assert schema["$defs"]["CameraSpec"]["properties"]["height_m"]["description"] == "above the road"
    for reference in re.findall(r'"\$ref": "#/\$defs/(\w+)"', json.dumps(schema)):
        assert reference in schema["$defs"]


def test_commands_of_the_guide_exist():
    """Each line of the guide that calls the program names a command that it has."""
    guide = (ROOT / "docs" / "authoring.md").read_text(encoding="utf-8")
    lines = re.findall(r"^    (hippodrome .+)$", guide, flags=re.MULTILINE)
    assert 1 <= len(lines) <= 9  # six from a map to a gate, and three on the side
    for line in lines:
        words = line.split()
        command = words[1:3] if words[1] == "scenario" else words[1:2]
        with pytest.raises(SystemExit) as ended:
            main([*command, "--help"])
        assert ended.value.code == 0


def test_yaml_in_the_guide_is_valid():
    guide = (ROOT / "docs" / "authoring.md").read_text(encoding="utf-8")
    blocks = [block for block in re.findall(r"(?:^    .+\n)+", guide, flags=re.MULTILINE) if "hippodrome" not in block]
    assert len(blocks) == 3
    for block in blocks:
        Scenario.model_validate({"name": "x", **yaml.safe_load(block)})
