"""Towns too large to be drawn as a whole."""

import numpy as np
import pytest
import shapely

from hippodrome.sim.render.camera import FAR_M, CameraSpec
from hippodrome.sim.render.renderer import FrameRenderer
from hippodrome.sim.scene import blocks
from hippodrome.sim.scene.blocks import BLOCK_M, SEEN_M, Block, blocks_seen
from hippodrome.sim.scene.build import TILE_M, build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.land import CELL_M
from hippodrome.sim.scene.placement import clear_of, paved_area
from tests.sim.test_scene import crossing

HERE = np.array([[-150.0, -1.6, 0.0]])
ALONG = np.column_stack([np.linspace(-190.0, 190.0, 20), np.full(20, -1.6), np.zeros(20)])


@pytest.fixture
def everything_is_large(monkeypatch):
    """Also the crossing of two streets of 400 m."""
    monkeypatch.setattr(blocks, "WHOLE_KM", 0.0)


def corners_of(scene):
    return np.concatenate([tile.vertices_m[tile.faces] for tile in scene.tiles]).astype(np.float64)


def test_blocks_reach_as_far_as_any_camera_sees():
    most_ahead_m = next(part.le for part in CameraSpec.model_fields["forward_m"].metadata if hasattr(part, "le"))
    assert FAR_M + most_ahead_m <= SEEN_M
    assert BLOCK_M % TILE_M == 0.0 and BLOCK_M % CELL_M == 0.0
    places = np.random.default_rng(0).uniform(-3000.0, 3000.0, (5, 2))
    found = blocks_seen(places)
    assert len(set(found)) == len(found)
    for place in places:
        for angle in np.linspace(0.0, 2.0 * np.pi, 40):
            seen = place + (SEEN_M - 1e-6) * np.array([np.cos(angle), np.sin(angle)])
            assert any(block.holds(seen[None])[0] for block in found)


def test_a_small_town_is_drawn_whole_wherever_the_drive_goes():
    whole, driven = build_scene(crossing(), 3, Conditions()), build_scene(crossing(), 3, Conditions(), HERE)
    assert all(np.array_equal(a.vertices_m, b.vertices_m) for a, b in zip(whole.tiles, driven.tiles, strict=True))


def test_what_stands_at_a_place_does_not_depend_on_the_drive(everything_is_large):
    frames = []
    for drive in (HERE, ALONG):
        with FrameRenderer(build_scene(crossing("grid"), 3, Conditions(), drive), CameraSpec(width=80, height=60)) as renderer:
            frames.append(renderer.render(HERE[0]))
    assert np.array_equal(*frames) and len(np.unique(frames[0])) > 50


def test_a_single_view_needs_no_more_than_what_it_shows(everything_is_large):
    camera, frames, tiles = CameraSpec(width=80, height=60), [], []
    for half_view_rad in (None, np.radians(45.0)):
        scene = build_scene(crossing("grid"), 3, Conditions(), HERE, half_view_rad)
        tiles.append(len(scene.tiles))
        with FrameRenderer(scene, camera) as renderer:
            frames.append(renderer.render(HERE[0]))
    assert np.array_equal(*frames) and tiles[1] < tiles[0]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_large_town_is_like_a_small_one(everything_is_large, monkeypatch, seed):
    town = crossing("grid")
    corners = corners_of(build_scene(town, seed, Conditions(), ALONG))
    high = (corners[:, :, 2].max(axis=1) > 0.1) & (corners[:, :, 2].min(axis=1) < 4.0)
    hulls = shapely.convex_hull(shapely.multipoints(corners[high][:, :, :2]))
    origin_m = np.zeros(2)
    assert np.all(clear_of(hulls, shapely.buffer(paved_area(town, origin_m)[0], -0.05), 0.0)), "nothing stands on the road"
    monkeypatch.setattr(blocks, "WHOLE_KM", 60.0)
    whole = corners_of(build_scene(town, seed, Conditions()))
    assert 0.6 < len(corners) / len(whole) < 1.5
    for z_m in (0.025, 0.03):  # the asphalt is the same, each face once
        one, two = (
            shapely.area(shapely.polygons(part[np.all(part[:, :, 2] == np.float32(z_m), axis=1)][:, :, :2])).sum()
            for part in (corners, whole)
        )
        assert abs(one - two) < 1e-3 * two


def test_buildings_of_two_blocks_do_not_touch():
    outside = Block(0, 0).outside()
    inside = shapely.points([[1.0, 1.0], [0.1, 100.0]])
    assert list(clear_of(inside, outside, 0.5)) == [True, False]
