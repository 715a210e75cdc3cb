"""The robustness matrix: its conditions change one thing each, its figures come out by hand."""

import json

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.robustness import SEQUENCE_M, cuts
from hippodrome.eval.robustness_conditions import CONDITIONS, SAME, chosen
from hippodrome.eval.robustness_report import ConditionResult, SequenceResult, markdown, report
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.scene.conditions import Conditions
from hippodrome.sim.tour import TourSpec

SCENARIO = Scenario(
    name="town", localization=DriveSpec(tour=TourSpec(length_m=900), conditions=Conditions(sun_azimuth_deg=10.0, gain=2.0))
)


def differences(one, other, path=()):
    if isinstance(one, dict):
        return [found for key in one for found in differences(one[key], other[key], (*path, key))]
    return [] if one == other else [".".join(path)]


def changed(name):
    return CONDITIONS[name](SCENARIO).model_dump(mode="json")


def test_same_sees_the_light_of_the_mapping_drive_on_the_localization_route():
    same = CONDITIONS[SAME](SCENARIO)
    assert same.localization.conditions == SCENARIO.mapping.conditions
    assert same.localization.tour == SCENARIO.localization.tour
    assert same.mapping == SCENARIO.mapping


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("sun-opposite", ["localization.conditions.sun_azimuth_deg"]),
        ("sun-opposite-fog-80m", ["localization.conditions.sun_azimuth_deg", "localization.conditions.fog_visibility_m"]),
        ("winter", ["localization.conditions.season"]),
        ("traffic-30", ["localization.traffic.vehicles"]),
        ("wander-0.5m", ["localization.ego.lateral_wander_m"]),
        ("yaw-5deg", ["camera.yaw_offset_deg"]),
        ("self-motion-harsh", ["noise"]),
    ],
)
def test_a_condition_changes_what_its_name_says_and_nothing_else(name, fields):
    assert sorted(differences(changed(SAME), changed(name))) == sorted(fields)


def test_every_condition_differs_from_same_and_is_a_valid_scenario():
    for name in CONDITIONS:
        assert name == SAME or differences(changed(SAME), changed(name))
        Scenario.model_validate(changed(name))


def test_unknown_conditions_are_refused():
    assert chosen(["winter", "same"]) == ["same", "winter"]
    with pytest.raises(HippodromeError, match="no condition 'rain'"):
        chosen(["rain"])


def straight_drive(tmp_path, length_m):
    steps = np.arange(0.0, length_m)
    zeros = np.zeros(len(steps))
    poses = np.stack([steps, zeros, zeros], axis=1)
    samples = Samples(
        steps + 1, zeros + 1, zeros, zeros, zeros.astype(np.int32), poses, zeros, zeros.astype(np.int32), zeros, ("a",)
    )
    return Recording(tmp_path, {}, samples)


def test_sequences_are_spread_evenly_over_the_drive(tmp_path):
    assert cuts(straight_drive(tmp_path, 701), 3) == [(0, 301), (200, 501), (400, 701)]
    with pytest.raises(HippodromeError, match="length_m"):
        cuts(straight_drive(tmp_path, SEQUENCE_M - 1), 2)


def sequence(after_m=10.0, errors_m=(1.0, 3.0), false_fixes=0, nees=1.0):
    steps = 0 if after_m is None else len(errors_m) + 1
    return SequenceResult((0.0, 0.0, 0.0), after_m, np.array(errors_m), false_fixes, 0.0, steps, len(errors_m), nees)


def test_summary_by_hand():
    result = ConditionResult("fog", (sequence(), sequence(250.0, (8.0,), 2, 4.0), sequence(None, (), nees=None)))
    row = result.summary()
    assert row["success_share"] == pytest.approx(1 / 3)
    assert row["error_mean_m"] == 4.0
    assert row["worst_sequence_mean_m"] == 8.0
    assert row["localized_after_median_m"] == 130.0
    assert row["false_sequences"] == 1
    assert row["localized_share"] == pytest.approx(3 / 5)  # pooled over steps
    assert row["nees"] == pytest.approx(2.0)


def test_a_condition_without_any_fix_is_a_row_all_the_same(tmp_path, capsys):
    results = [ConditionResult("same", (sequence(), sequence())), ConditionResult("night", (sequence(None, (), nees=None),) * 2)]
    assert "| night | 0 % | - / - / - | - / - | 0 of 2 | - |" in markdown("town", results)
    report(tmp_path, "town", results)
    written = json.loads((tmp_path / "robustness.json").read_text())
    assert written["conditions"][1]["error_mean_m"] is None
    assert (tmp_path / "robustness.png").stat().st_size > 5_000
    first = (tmp_path / "robustness.png").read_bytes()
    report(tmp_path, "town", results)
    assert (tmp_path / "robustness.png").read_bytes() == first
    assert "night" in capsys.readouterr().out
