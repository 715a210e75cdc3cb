"""Every error of a scenario at once, with line and key; oddities of its network with place and cure."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sumo

from hippodrome.eval.authoring.check import check_scenario
from hippodrome.eval.authoring.errors import file_errors
from hippodrome.eval.authoring.network_notes import CURES, network_notes
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.town import read_town

BROKEN = """\
name: two words
nose: paper
camera:
  fov_deg: 200
  hight: 100
noise: {gyro_gian: 1, scale_wander: -1}
mapping:
  tour: {lenght_m: 300}
town: grid
localization:
  conditions: {season: spring}
  conditions: {dusk: 2}
thresholds:
  ape_mean_m: five
"""
EXPECTED = [
    "1: name: results are filed under it: letters",
    "2: nose: unknown key; did you mean noise?",
    "4: camera.fov_deg: must be a number of at most 150, not 200",
    "5: camera.hight: unknown key; did you mean camera.height?",
    "6: noise.scale_wander: must be a number of at least 0, not -1",
    "6: noise.gyro_gian: unknown key; did you mean noise.gyro_gain?",
    "8: mapping.tour.lenght_m: unknown key; did you mean mapping.tour.length_m?",
    "9: town: takes keys of its own",
    "10: localization.tour: must be given",
    "12: localization.conditions: given twice, first in line 11; remove one",
    "12: localization.conditions.dusk: must be a number of at most 1, not 2",
    "14: thresholds.ape_mean_m: must be a number, not 'five'",
]


@pytest.fixture
def errors_of(tmp_path):
    def errors(text):
        path = tmp_path / "a.yaml"
        path.write_text(text)
        return [line.removeprefix(f"{path}:") for line in file_errors(path)]

    return errors


def test_all_errors_in_the_order_of_the_file(errors_of):
    found = errors_of(BROKEN)
    assert len(found) == len(EXPECTED)
    for line, start in zip(found, EXPECTED, strict=True):
        assert line.startswith(start), (line, start)


@pytest.mark.parametrize(("text", "expected"), [
    ("name: a\n", []),
    ("seed: 1\n", ["1: name: must be given"]),
    ("name: a\nnoise: worse\n", ["2: noise: must be 'clean', 'paper', 'realistic' or 'harsh', or keys of its own "
                                 "(units_per_metre, units_per_metre_spread, scale_wander, ...), not 'worse'"]),
    ("name: a\nmapping: {tour: {}, closed: 5000}\n",
     ["2: mapping.closed: must be a list, as in [a, b], or a number of at most 100, not 5000"]),
    ("name: a\nmapping: {tour: {}, closed: A0A1}\n",
     ["2: mapping.closed: must be a list, as in [a, b], or a whole number, not 'A0A1'"]),
    ("name: a\nmapping: {tour: {}, closed: [a, 5]}\n",
     ["2: mapping.closed.1: must be text, in quotes where it looks like a number or a word like yes, not 5"]),
    ("name: a\nmissions: {rows: ours}\n", ["2: missions.rows: must be a list, as in [a, b], not 'ours'"]),
    ("name: a\nmissions: {policies: {a: b}}\n",
     ["2: missions.policies.a: must be my_package.my_module:MyPolicy, or exec: or stream: and a command, not 'b'"]),
    ("name: a\nmethods: [a]\n", ["2: methods: must be names with values, as in {a: b}, not a list"]),
    ("name: a\nmethods: {a: 5}\n",
     ["2: methods.a: must be my_package.my_module:MyClass, exec: or stream: and a command, or keys of its own, not 5"]),
    ("name: a\nmethods: {a: b}\n",
     ["2: methods.a: must be my_package.my_module:MyClass, or exec: or stream: and a command, not 'b'"]),
    ("name: a\nmethods: {a!: 'b:C'}\n",
     ["2: methods.a!: a name begins with a letter or digit and has letters, digits, spaces and . _ + ( ) , - , at most 40, "
      "not 'a!'"]),
    ("name: a\nmethods: {a: {stream: b, needs: [c]}}\n",
     ["2: methods.a.needs.0: must be road_network, start_pose, stereo, grain, metric_scale, or a size like 640x480, "
      "not 'c'"]),
    ("name: a\ntown: {network: no}\n", ["2: town.network: must be the path of a file, in quotes where it looks like a "
                                       "number or a word like yes, not false"]),
    ("name: a\nseed: 0x" + 5000 * "f" + "\n", ["2: seed: must be a number below 2147483648"]),
    ("name: a\nseed: yes\n", ["2: seed: must be a whole number, not true"]),
    ("name: a\nseed: 1\nseed: 1\n", ["3: seed: given twice, first in line 2; remove one"]),
    ("name: a\ncamera: {rate_hz: 3}\n", ["1: odometry_rate_hz 10 is not a whole multiple of camera.rate_hz 3"]),
    ("name: a\nmapping: {tour: {}}\nzzzzzz: 1\n",
     ["3: zzzzzz: unknown key; take it out; there are name, description, seed, town, camera, odometry_rate_hz, noise, mapping, "
      "localization, mapper, refine, localizer; docs/scenarios.md lists all"]),
])  # fmt: skip
def test_each_kind_of_error(errors_of, text, expected):
    assert errors_of(text) == expected


@pytest.mark.parametrize("text", ["", "- a", "x: [", "name: &x {b: *x}", "\x00", "{[a]: 1}"])
def test_what_is_no_scenario_is_one_error(errors_of, text):
    assert len(errors_of(text)) == 1


def test_limits_on_a_row_that_is_never_written_are_noted(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("name: a\ntown: {kind: grid, width_m: 190, height_m: 190, road_km: 1.3}\nthresholds: {method: topometrik}\n")
    assert any("thresholds.method 'topometrik' is none of the rows" in note for note in check_scenario(path).notes)


def test_notes_have_a_place_and_a_cure():
    """On a real network that has most kinds of oddities, and with notes of the others."""
    town = read_town(Path(sumo.SUMO_HOME) / "tools" / "game" / "bs3d" / "bs.net.xml")
    coincident = tuple(f"nodes a{i} and b coincide at ({i}.0, 2.0) m but are not connected" for i in range(5))
    others = (
        "1 street(s) have one lane for both directions, for instance a and b",
        "a.net.xml has no lanes inside junctions",
        "streets a and b cross without a junction",
        "the signals of 1 junction(s) wait for a hand",
        "1 road(s) climb or fall by more than 25%, for instance a by 8 m over 4 m",
    )
    notes = network_notes(Scenario(name="a"), SimpleNamespace(network=town.network, notes=(*town.notes, *coincident, *others)))
    for words, cure in CURES.items():
        assert any(words in note and note.endswith(cure) for note in notes), words
    assert any("61734682#1 at (1131, 827) m) cannot be left" in note for note in notes)
    assert sum("coincide" in note for note in notes) == 3 and any(note.startswith("and 2 more") for note in notes)


def test_too_few_frames_for_the_speed_are_noted():
    network = SimpleNamespace(speed_limit_mps=np.array([25.0, 3.0]), is_internal=np.array([False, True]))
    scenario = Scenario.model_validate({"name": "a", "camera": {"rate_hz": 5}})
    assert network_notes(scenario, SimpleNamespace(network=network, notes=())) == (
        "at 25 m/s the camera sees a view every 5.0 m only: raise camera.rate_hz",
    )
