"""Lamps of signals in the frames show what SUMO's traffic lights show; recorded drives know nothing of them."""

import numpy as np
import pytest

from hippodrome.core.navigation.types import Lamp
from hippodrome.sim.loop.lamps import LIT, Lamps, head_tile
from hippodrome.sim.loop.types import LanePlace
from hippodrome.sim.loop.world import World
from hippodrome.sim.render.renderer import FrameRenderer
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from tests.sim.loop import small


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder = tmp_path_factory.mktemp("signals")
    with World(small.scenario(town=small.crossing(folder, "traffic_light")), folder) as opened:
        yield opened


def pixels_of(frame, lamp):
    return int((np.abs(frame.astype(int) - LIT[lamp].astype(int)).max(axis=-1) < 30).sum())


def test_the_lamp_of_the_own_lane_is_seen_and_told(world):
    said = set()
    for arm in "ws":
        sensed = world.reset(1, LanePlace(f"{arm}-c_0", 104.0))
        shown = {Lamp.RED: 0, Lamp.GREEN: 2}[sensed.radar.lamp]
        assert pixels_of(sensed.observation.frame, shown) > 8
        said.add(sensed.radar.lamp)
    assert said == {Lamp.RED, Lamp.GREEN}


def test_lamps_change_with_sumo(world):
    sensed = world.reset(1, LanePlace("w-c_0", 104.0))
    seen = []
    for _ in range(600):
        sensed = world.step(0.0, 0.0)
        seen.append(sensed.radar.lamp)
    assert set(seen) == {Lamp.GREEN, Lamp.YELLOW, Lamp.RED}
    assert pixels_of(sensed.observation.frame, 0 if seen[-1] == Lamp.RED else 2) > 8


def test_each_approach_has_a_head_at_the_line_and_one_beyond_the_junction(world):
    heads = world.heads
    assert len(heads.signal) == 8
    paved = [world.ground.is_paved(place[:2]) for place in heads.place_m]
    assert not any(paved)


def test_the_tile_is_made_anew_only_where_something_changed(world):
    lamps = Lamps(world.heads, np.zeros(2), build_scene(world.town, 3, Conditions()).light)
    states = dict.fromkeys(lamps.signals(), "G" * 12)
    assert len(lamps.tile(0.0, 0.0, states).faces)
    assert lamps.tile(1.0, 0.0, states) is None
    assert lamps.tile(1.0, 0.0, dict.fromkeys(states, "r" * 12)) is not None
    assert len(lamps.tile(9e3, 0.0, states).faces) == 0


def test_a_renderer_draws_lamps_only_where_they_were_added(world):
    world.close()
    scene = build_scene(world.town, 3, Conditions())
    pose = np.array([-20.0, -1.6, 0.0])
    with FrameRenderer(scene, world.scenario.camera) as renderer:
        plain = renderer.render(pose)
        heads = np.arange(len(world.heads.signal), dtype=np.int32)
        primitive = renderer.add_moving(head_tile(world.heads, heads, ["g"] * len(heads), scene.origin_m, scene.light))
        lit = renderer.render(pose)
        primitive.replace(head_tile(world.heads, heads[:0], [], scene.origin_m, scene.light))
        again = renderer.render(pose)
    assert pixels_of(lit, 2) > pixels_of(plain, 2)
    np.testing.assert_array_equal(plain, again)
