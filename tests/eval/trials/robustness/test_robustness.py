"""The robustness matrix: its conditions change one thing each, its figures come out by hand."""

import json

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.metrics.mapped_road import OnMap
from hippodrome.eval.trials.robustness.conditions import CONDITIONS, SAME, chosen
from hippodrome.eval.trials.robustness.findings import Findings, merged
from hippodrome.eval.trials.robustness.kidnapping import AFTER_M, BEFORE_M, JUMP_M, Kidnapping, jumps, kidnapping_summary
from hippodrome.eval.trials.robustness.localize import SEQUENCE_M, sequence_steps
from hippodrome.eval.trials.robustness.paper_lengths import PaperSequence, paper_summary
from hippodrome.eval.trials.robustness.place_recognition import Answers
from hippodrome.eval.trials.robustness.recall import PlaceResult
from hippodrome.eval.trials.robustness.report import report_town, report_towns
from hippodrome.eval.trials.robustness.run import elsewhere
from hippodrome.eval.trials.robustness.sequences import ELSEWHERE, ConditionResult, SequenceResult
from hippodrome.eval.trials.robustness.tables import conditions_markdown
from hippodrome.eval.trials.robustness.targets import Target
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.self_motion import SelfMotionNoise
from hippodrome.sim.tour_spec import TourSpec

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


def test_visual_self_motion_changes_the_localizer_alone():
    found = differences(changed(SAME), changed("self-motion-visual"))
    assert "localizer.self_motion" in found
    assert all(name.startswith(("localizer.self_motion", "localizer.motion.")) for name in found)


def test_every_condition_differs_from_same_and_is_a_valid_scenario():
    for name in CONDITIONS:
        assert name == SAME or differences(changed(SAME), changed(name))
        Scenario.model_validate(changed(name))


def test_another_level_of_noise_leaves_the_unit_of_the_speeds():
    metres = SCENARIO.model_copy(update={"noise": SelfMotionNoise(units_per_metre=1.0, units_per_metre_spread=0.0)})
    for name in (name for name in CONDITIONS if name.startswith("self-motion")):
        noise = CONDITIONS[name](metres).self_motion_noise
        assert (noise.units_per_metre, noise.units_per_metre_spread) == (1.0, 0.0)


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
    assert sequence_steps(straight_drive(tmp_path, 701), 3) == [slice(0, 301), slice(200, 501), slice(400, 701)]
    with pytest.raises(HippodromeError, match="length_m"):
        sequence_steps(straight_drive(tmp_path, SEQUENCE_M - 1), 2)


def sequence(after_m=10.0, errors_m=(1.0, 3.0), false_fixes=0, nees=1.0, number=1, way_m=300.0):
    steps = 0 if after_m is None else len(errors_m) + 1
    on_map = OnMap(after_m, np.array(errors_m), np.zeros(0), steps, way_m)
    return SequenceResult(number, (0.0, 0.0, 0.0), on_map, false_fixes, 0.0, len(errors_m), nees, 0.2, 0.8)


def findings(*results):
    right = np.array([True, True, False])
    answers = Answers("sequence of views", np.array([3.0, 2.0, 1.0]), right, right, right)
    paper = PaperSequence(1, 372.7, "the localization drive is 300 m long, the sequence 372.7 m")
    places = [PlaceResult(results[0].name, (answers,))]
    return Findings(results, places, {results[0].name: (Kidnapping(30.0, 5.0),)}, (paper,), 8340, 10)


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
    assert len(result.failures) == 2
    assert ConditionResult(ELSEWHERE, (sequence(None, (), nees=None),)).failures == []


def test_a_start_without_mapped_road_is_not_judged():
    result = ConditionResult("fog", (sequence(), sequence(None, (), nees=None, way_m=40.0)))
    assert (result.summary()["success_share"], result.summary()["judged"], result.failures) == (1.0, 1, [])


def test_a_condition_without_any_fix_is_a_row_all_the_same(tmp_path, capsys):
    results = [ConditionResult("same", (sequence(), sequence())), ConditionResult("night", (sequence(None, (), nees=None),) * 2)]
    assert "| night | 0 % of 2 | - / - / - | - / - | - | - | 0 of 2 | - |" in conditions_markdown("town", results)
    report_town(tmp_path, "town", findings(*results))
    written = json.loads((tmp_path / "robustness.json").read_text())
    assert written["conditions"][1]["error_mean_m"] is None
    files = ("robustness.png", "places.png", "robustness.json", "robustness.md")
    first = [(tmp_path / name).read_bytes() for name in files]
    assert all(len(content) > 500 for content in first)
    report_town(tmp_path, "town", findings(*results))
    assert [(tmp_path / name).read_bytes() for name in files] == first
    assert "night" in capsys.readouterr().out


def test_failures_say_how_to_run_them_again_and_the_yardsticks_have_rows(tmp_path, capsys):
    bad = sequence(40.0, (25.0,), false_fixes=1, number=7)
    report_town(tmp_path, "town", findings(ConditionResult("same", (sequence(), bad)), ConditionResult("same", (bad,), "kalman")))
    text = (tmp_path / "robustness.md").read_text()
    assert "start 7: 1 false fixes; again: `--conditions same --start 7`" in text
    assert text.count("--start") == 1  # a yardstick's failures are its own
    assert "| kalman | 100 % of 1 | 25.00 / 25.00 / 25.00 |" in text
    assert "| 1 | 372.7 | - | - | - | - | - | - |" in text
    assert "- sequence 1: the localization drive is 300 m long" in text
    capsys.readouterr()


def test_targets_are_reached_held_or_missed():
    verdicts = [Target("error", value, 1.5, 0.7, True, "m").verdict for value in (0.7, 1.0, 2.0, None)]
    assert verdicts == ["aim reached", "held", "MISSED", "not measured"]
    assert [Target("recall", value, 90, 97, False, "%").verdict for value in (98, 91, 80)] == ["aim reached", "held", "MISSED"]


def test_a_false_fix_in_another_town_counts():
    found = findings(
        ConditionResult("same", (sequence(),)), ConditionResult(ELSEWHERE, (sequence(None, (), false_fixes=1, nees=None),))
    )
    false = next(target for target in found.targets() if "false fix" in target.item)
    assert (false.value, false.verdict) == (50.0, "MISSED")
    assert [result.name for result in found.conditions] == ["same"]


def test_another_town_has_other_streets():
    away = elsewhere(SCENARIO)
    assert (away.town, away.seed != SCENARIO.seed, away.name) == (SCENARIO.town, True, "town-elsewhere")
    assert away.localization.conditions == SCENARIO.mapping.conditions


def test_kidnappings_jump_far_and_leave_room_to_recover(tmp_path):
    drive = straight_drive(tmp_path, 701)
    way_m = drive.samples.poses_m[:, 0]
    found = jumps(drive.samples.poses_m, way_m, 5)
    assert len(found) == 5
    for jump in found:
        assert jump.leap - jump.first == BEFORE_M
        assert jump.end - jump.landing == AFTER_M
        assert abs(jump.landing - jump.leap) > JUMP_M
    assert jumps(drive.samples.poses_m[:150], way_m[:150], 5) == []


def test_kidnappings_without_recovery_count_as_infinitely_far():
    row = kidnapping_summary([Kidnapping(20.0, 4.0), Kidnapping(None, 150.0), Kidnapping(40.0, 0.0)])
    assert (row["recovered"], row["recovered_after_median_m"], row["wrong_until_max_m"]) == (2, 40.0, 150.0)
    assert kidnapping_summary([Kidnapping(None, 9.0)])["recovered_after_median_m"] is None
    assert paper_summary([PaperSequence(1, 372.7, "too short")])["error_mean_m"] is None


def test_towns_are_pooled_from_samples_and_the_worst_is_seen(tmp_path, capsys):
    good = findings(ConditionResult("same", (sequence(errors_m=(0.5, 0.5, 0.5)),)))
    bad = findings(ConditionResult("same", (sequence(errors_m=(4.5,)), sequence(None, ()))))
    pooled = merged([good, bad])
    row = pooled.conditions[0].summary()
    assert row["error_mean_m"] == 1.5  # of four samples, not of two means
    assert row["sequences"] == 3
    assert pooled.places[0].summary()["looks"] == 6
    assert pooled.bytes_per_view == 834.0
    assert len(pooled.kidnapped["same"]) == 2
    report_towns(tmp_path, {"grid": good, "rural": bad})
    said = capsys.readouterr().out
    assert "| success within 200 m, same condition | 100 | 50 | 66.7 % | 95 | 99 | MISSED | MISSED |" in said
    assert "| recovery after kidnapping, median of all | 30 | 30 | 30 m | 100 | 40 | aim reached | aim reached |" in said
    assert json.loads((tmp_path / "robustness.json").read_text())["towns"]["rural"]["success within 200 m, same condition"] == 50
    assert (tmp_path / "robustness.png").stat().st_size > 500
