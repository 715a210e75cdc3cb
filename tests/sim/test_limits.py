"""No number of a scenario is believed because it is a number, and no YAML is because it is YAML."""

import dataclasses
import math
import os
import time
from pathlib import Path

import pytest
from pydantic import BaseModel, ValidationError

from hippodrome.sim.scenario import Scenario, load_scenario
from hippodrome.sim.yaml_file import MAX_BYTES, ScenarioError, parse_yaml

ROOT = Path(__file__).parents[2]


def keys(value, path=()):
    """Path and value of each key that holds a number, a tuple of numbers, or may hold one."""
    if isinstance(value, BaseModel):
        pairs = [(name, getattr(value, name)) for name in type(value).model_fields]
    elif dataclasses.is_dataclass(value):
        pairs = [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)]
    else:
        if value is None or (isinstance(value, int | float | tuple) and not isinstance(value, bool)):
            yield path, value
        return
    for name, item in pairs:
        yield from keys(item, (*path, name))


NOISE = {"scale": 1.02, "speed_sigma": 0.01, "gyro_bias_radps": 0.001}
NO_NUMBERS = {
    ("town", "network"),
    ("methods",),
    *((drive, name) for drive in ("mapping", "localization") for name in ("recording", "closed")),
}
KEYS = [one for one in keys(Scenario(name="a")) if one[0] not in NO_NUMBERS]


def with_value(path, value):
    data = {"name": "a"}
    if path[0] in ("mapping", "localization"):
        data[path[0]] = {"tour": {} if path[2] == "duration_s" else {"length_m": 500.0}}
    place = data
    for name in path[:-1]:
        place = place.setdefault(name, {})
    place[path[-1]] = value
    return data


def test_there_are_as_many_keys_as_the_reference_lists():
    assert len(KEYS) > 230


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, -1e308, 1e308, 10**400, -(10**400)])
def test_no_key_takes_a_number_that_is_none(number):
    """Only where infinity is a part of the default may it be given: a limit that is not there."""
    taken = []
    for path, usual in KEYS:
        value = [number] * len(usual) if isinstance(usual, tuple) else number
        try:
            Scenario.model_validate(with_value(path, value))
        except ValidationError:
            continue
        taken.append(".".join(path))
    endless = ["refine.route.solver.along_sigma_m", "refine.paper.bent_cost"] if number in (math.inf, 1e308) else []
    assert taken == endless


def test_no_key_below_zero_unless_it_has_a_side():
    sided = {
        "camera.forward_m",
        "camera.yaw_offset_deg",
        "localizer.camera.forward_m",
        "refine.route.confidence.least_score_nats",
    }
    for path, usual in KEYS:
        name = ".".join(path)
        if name in sided or "azimuth" in name:
            continue
        with pytest.raises(ValidationError):
            Scenario.model_validate(with_value(path, [-1] * len(usual) if isinstance(usual, tuple) else -1))


def test_defaults_and_all_scenarios_of_the_project_are_within_the_limits():
    for path, usual in KEYS:
        if usual is not None:
            Scenario.model_validate(with_value(path, list(usual) if isinstance(usual, tuple) else usual))
    for path in sorted((ROOT / "scenarios").rglob("*.yaml")):
        load_scenario(path)


@pytest.mark.parametrize("noise", [math.nan, math.inf, -1e308, 1e308])
def test_noise_of_ones_own_has_limits_too(noise):
    from hippodrome.sim.self_motion import SelfMotionNoise

    for name in SelfMotionNoise.model_fields:
        with pytest.raises(ValidationError):
            Scenario.model_validate({"name": "a", "noise": {name: noise}})


BOMB = "x0: &x0 [1, 2, 3, 4]\n" + "".join(f"x{i}: &x{i} [{', '.join([f'*x{i - 1}'] * 9)}]\n" for i in range(1, 12))
MERGE = "x0: &x0 {k: 1, l: 2}\n" + "".join(f"x{i}: &x{i}\n  <<: [{', '.join([f'*x{i - 1}'] * 9)}]\n" for i in range(1, 12))


@pytest.mark.parametrize(("text", "reason"), [
    ("seed: 2001-99-99", r":2: '2001-99-99' is no timestamp \(ValueError\); quote it"),
    ("seed: " + "9" * 5000, r":2: '9+\.\.\. \(5000 characters\)' is no int"),
    ("seed: 0x" + "f" * 5000, r":2: seed: |:2: seed:"),
    ("seed: !!bool x", r":2: 'x' is no bool"),
    ("seed: !!float x", r":2: 'x' is no float"),
    ("seed: !!int x", r":2: 'x' is no int"),
    ("seed: !!timestamp x", r":2: 'x' is no timestamp"),
    ("seed: !!binary é", r":2: "),
    ("seed: !!python/object/apply:os.system [ls]", r":2: not valid YAML"),
    ("seed: !mine 1", r":2: not valid YAML"),
    ("description: a\0b", r"not valid YAML: unacceptable character"),
    (BOMB, r"its aliases and merge keys make \d+ values, the limit is"),
    (MERGE, r"its aliases and merge keys make \d+ values, the limit is"),
    ("town: &a [*a]", r"an alias stands for what it is a part of"),
    ("town: &a {<<: *a}", r"an alias stands for what it is a part of"),
    ("? [a, b]\n: 1", r"unhashable|found unhashable|not valid YAML"),
    ("1: 2", r":\d: "),
    ("null: 2", r":\d: "),
    ("2001-01-01: 2", r":\d: "),
    ("<<: 3", r"expected a mapping"),
    ("town: " + "[" * 5000, r"nested too deeply|not valid YAML"),
    ("town: " + "{a: " * 3000, r"nested too deeply|not valid YAML"),
    ("a: *b", r":2: not valid YAML: found undefined alias"),
    ("--- 1\n--- 2", r"not valid YAML"),
    ("seed: 1e400", r":2: seed"),
    ("seed: 1:2:3:4:5:6:7:8:9:10:11:12:13:14", r":2: '1:2:3.*' is another number for YAML than it looks"),
    ("seed: 010", r":2: '010' is another number for YAML"),
    ("mapping: {tour: {length_m: 1:30}}", r":2: '1:30' is another number for YAML"),
    ("seed: yes", r":2: seed: must be a whole number, not true"),
    ("mapping: {tour: {length_m: on}}", r":2: mapping.tour.length_m: must be a number, not true"),
    ("refine: {route: {solver: {along_sigma_m: [no, 1]}}}", r":2: refine.route.solver.along_sigma_m"),
    ("seed: 1\nseed: 2", r":3: seed: given twice, first in line 2; remove one"),
    ("missions: {rows: [ours], rows: [truth]}", r":2: missions.rows: given twice"),
    ("description: [{a: 1, a: 2}]", r":2: description.0.a: given twice"),
])  # fmt: skip
def test_every_yaml_is_a_scenario_or_one_sentence(tmp_path, text, reason):
    path = tmp_path / "a.yaml"
    path.write_text(f"name: a\n{text}\n", encoding="utf-8")
    began = time.monotonic()
    with pytest.raises(ScenarioError, match=reason) as caught:
        load_scenario(path)
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(path)) and len(str(caught.value)) < 1000
    assert time.monotonic() - began < 10.0


def test_files_that_never_end_or_begin_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "long").write_bytes(b" " * (MAX_BYTES + 1))
    (tmp_path / "latin").write_bytes("name: grün".encode("latin-1"))
    for path, reason in ((Path("/dev/zero"), "not a regular file"), (tmp_path / "pipe", "not a regular file"),
                         (tmp_path, "cannot be read"), (tmp_path / "none", "No such file"), (tmp_path / "long", "more than"),
                         (tmp_path / "latin", "not UTF-8")):  # fmt: skip
        with pytest.raises(ScenarioError, match=reason):
            load_scenario(path)


def test_aliases_and_merge_keys_that_are_no_bombs_go_on_working(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("name: a\nmapping: &drive\n  tour: {length_m: 500}\nlocalization:\n  <<: *drive\n  traffic: {vehicles: 1}\n")
    scenario = load_scenario(path)
    assert scenario.localization.tour.length_m == 500.0 and scenario.localization.traffic.vehicles == 1
    path.write_bytes(b"\xef\xbb\xbfname: a\n")
    assert load_scenario(path).name == "a"
    assert parse_yaml("", "a.yaml") == (None, None)
