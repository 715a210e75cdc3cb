"""What a method needs of a drive, and the cause and cure where a drive has it not."""

from types import SimpleNamespace

import pytest

from hippodrome.eval.methods.needs import metres_per_unit, require_met
from hippodrome.eval.methods.protocol import MethodError, Needs
from hippodrome.sim.scenario import Scenario

SIMULATED = SimpleNamespace(manifest={}, frame_count=9)
FOREIGN = SimpleNamespace(manifest={"imported": {}, "camera": {"width": 640, "height": 480}}, frame_count=9)
BARE = SimpleNamespace(manifest={"imported": {}, "camera": {}}, frame_count=0)


def scenario(noise="paper", **camera):
    made = Scenario(name="one", noise=noise)
    return made.model_copy(update={"camera": made.camera.model_copy(update=camera)})


@pytest.mark.parametrize(
    ("needs", "drive", "cause"),
    [
        (Needs(stereo=True), SIMULATED, r"needs stereo pairs.*set camera\.stereo_baseline_m"),
        (Needs(stereo=True), FOREIGN, r"needs stereo pairs.*use a drive of ours"),
        (Needs(size_px=(640, 480)), SIMULATED, r"at least 640x480, and the drive has 160x120; set camera\.width"),
        (Needs(size_px=(640, 600)), FOREIGN, r"at least 640x600, and the drive has 640x480; import"),
        (Needs(grain=True), SIMULATED, r"set camera\.grain: true"),
        (Needs(metric_scale=True), SIMULATED, r"noise\.units_per_metre_spread: 0"),
        (Needs(metric_scale=True), FOREIGN, "--units"),
        (Needs(), BARE, "the drive has none"),
    ],
)
def test_what_a_drive_lacks_is_said_with_the_cure(needs, drive, cause):
    with pytest.raises(MethodError, match=cause):
        require_met(needs, scenario(), drive)


def test_what_a_drive_has_is_enough():
    everything = Needs(stereo=True, size_px=(640, 480), grain=True)
    require_met(everything, scenario(width=640, height=480, stereo_baseline_m=0.5, grain=True), SIMULATED)
    require_met(Needs(grain=True, size_px=(320, 240)), scenario(), FOREIGN)  # what a real camera took has its grain
    require_met(Needs(frames_optional=True), scenario(), BARE)
    require_met(Needs(camera=False), scenario(), BARE)


@pytest.mark.parametrize(
    ("fields", "cause"),
    [({"size_px": "640x480"}, "width and height in pixels"), ({"stereo": True, "camera": False}, "camera=False asks for none")],
)
def test_needs_that_no_drive_can_meet_are_refused(fields, cause):
    with pytest.raises(ValueError, match=cause):
        Needs(**fields)


def test_the_unit_of_the_speeds_is_known_where_it_was_said():
    told = SimpleNamespace(manifest={"imported": {}, "metres_per_unit": 0.5})
    assert metres_per_unit(scenario(), told) == 0.5
    assert metres_per_unit(scenario({"units_per_metre": 2.0, "units_per_metre_spread": 0.0}), SIMULATED) == 0.5
    assert metres_per_unit(scenario(), SIMULATED) is None


def test_the_needs_of_our_methods_are_said_in_the_words_they_had():
    assert Needs().in_words() == "self-motion, frames of one camera"
    words = "self-motion, stereo pairs of at least 640x480 with grain"
    assert Needs(stereo=True, size_px=(640, 480), grain=True).in_words() == words
