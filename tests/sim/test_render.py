import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hippodrome.core.types import HippodromeError
from hippodrome.sim.render import flat
from hippodrome.sim.render.camera import CameraSpec, camera_position_m
from hippodrome.sim.render.flat import visible_tiles
from hippodrome.sim.render.renderer import FrameRenderer
from hippodrome.sim.render.vehicles import vehicle_mesh
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.light import light_of, sky_dome
from hippodrome.sim.scene.types import Scene, Tile
from hippodrome.sim.traffic import VEHICLE_SIZES_M

RED, HAZE = (200, 20, 10), (100, 110, 120)
LOOK = Conditions()
NONE = np.zeros((0, 3)), np.zeros(0, np.uint8)


def wall(x_m, half_width_m=2.0, centre_y_m=0.0, rgb=RED, grain=0):
    """A wall across the x axis that faces the origin, 6 m high."""
    y = centre_y_m + half_width_m * np.array([1, -1, -1, 1])
    corners = np.stack([np.full(4, x_m), y, np.array([0, 0, 6, 6])], axis=1)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Tile(corners.astype(np.float32), faces, np.tile(np.uint8(rgb), (4, 1)), np.full(4, grain, np.uint8), 2)


def scene(*tiles, extinction=0.0, origin=(0.0, 0.0)):
    return Scene(tiles, sky_dome(LOOK), np.array(origin), np.uint8(HAZE), extinction, light_of(LOOK))


def camera(**settings):
    return CameraSpec(**{"forward_m": 0.0, "supersample": 1, **settings})


def draw(stage, spec, pose=(0.0, 0.0, 0.0)):
    with FrameRenderer(stage, spec) as renderer:
        return renderer.render(np.array(pose), *NONE)


def is_red(frame):
    return np.all(np.abs(frame.astype(int) - RED) <= 1, axis=-1)


def test_a_wall_appears_where_the_pinhole_model_puts_it():
    frame = draw(scene(wall(10.0)), camera())
    assert frame.shape == (120, 160, 3) and frame.dtype == np.uint8
    red = is_red(frame)
    columns = np.flatnonzero(red[60])  # f = 80 px: 2 m at 10 m is 16 px either side of the middle
    assert columns[0] == 64 and columns[-1] == 95
    rows = np.flatnonzero(red[:, 80])  # from 4.6 m above the eye to 1.4 m below: 36.8 px up, 11.2 px down
    assert rows[0] == 60 - 37 and rows[-1] == 60 + 10


def test_left_in_the_world_is_left_in_the_image():
    columns = np.flatnonzero(is_red(draw(scene(wall(10.0, 1.0, centre_y_m=3.0)), camera()))[60])
    assert columns[0] == 80 - 32 and columns[-1] == 80 - 16 - 1


def test_the_camera_turns_with_the_body_and_its_own_offset():
    stage = scene(wall(10.0))
    assert not is_red(draw(stage, camera(), (0, 0, np.pi))).any()
    ahead = draw(stage, camera())
    turned = draw(stage, camera(yaw_offset_deg=90.0), (0, 0, -np.pi / 2))
    assert np.array_equal(is_red(ahead), is_red(turned))


def test_supersampling_averages_edges():
    frame = draw(scene(wall(10.0, 2.0 + 0.0625)), camera(supersample=4))
    edge = frame[60, 63].astype(int)  # the wall covers half of this pixel
    sky = frame[60, 50].astype(int)
    assert np.all(np.abs(edge - (sky + RED) / 2) <= 2)


def test_haze_follows_koschmieder():
    extinction = 0.02
    frame = draw(scene(wall(50.0, 40.0), extinction=extinction), camera())
    kept = np.exp(-extinction * 50.0)
    assert np.all(np.abs(frame[60, 80] - (kept * np.array(RED) + (1 - kept) * np.array(HAZE))) <= 1.5)
    slant = np.exp(-extinction * 50.0 * np.hypot(1.0, 60.5 / 80.0))  # the ray's length counts, not its depth
    assert np.all(np.abs(frame[60, 140] - (slant * np.array(RED) + (1 - slant) * np.array(HAZE))) <= 1.5)


def test_stereo_disparity_and_left_is_the_mono_frame():
    stage = scene(wall(8.0))
    with FrameRenderer(stage, camera(stereo_baseline_m=0.5)) as renderer:
        left, right = renderer.render_stereo(np.zeros(3), *NONE)
    assert np.array_equal(left, draw(stage, camera()))
    shift = np.flatnonzero(is_red(left)[60])[0] - np.flatnonzero(is_red(right)[60])[0]
    assert shift == 5  # f b / z = 80 * 0.5 / 8


def test_stereo_without_a_baseline_is_refused():
    with FrameRenderer(scene(wall(8.0)), camera()) as renderer, pytest.raises(HippodromeError, match="stereo_baseline_m"):
        renderer.render_stereo(np.zeros(3), *NONE)


def test_grain_stays_on_its_surface_and_leaves_the_mean_colour():
    stage = scene(wall(8.0, 6.0, grain=60))
    with FrameRenderer(stage, camera(stereo_baseline_m=0.5, grain=True)) as renderer:
        left, right = (image[20:66, 40:120].astype(int) for image in renderer.render_stereo(np.zeros(3), *NONE))
    assert len(np.unique(left[..., 0])) > 50
    assert np.mean(left[:, 5:] == right[:, :-5]) > 0.95  # disparity 5: what is seen moves with the wall
    assert np.all(np.abs(left.mean(axis=(0, 1)) / RED - 1.0) < 0.1)


def test_grain_is_not_drawn_unless_asked_for_nor_on_what_moves():
    assert np.array_equal(draw(scene(wall(8.0, grain=60)), camera()), draw(scene(wall(8.0)), camera()))
    moving = vehicle_mesh(np.zeros((1, 3)), np.zeros(1, np.uint8), np.array([4]), light_of(LOOK))
    assert not moving.grain.any() and len(moving.grain) == len(moving.vertices_m)


def test_the_nearer_wall_hides_the_farther_one():
    blue = wall(20.0, 6.0, rgb=(10, 20, 200))
    for tiles in ((wall(10.0), blue), (blue, wall(10.0))):
        frame = draw(scene(*tiles), camera())
        assert tuple(frame[60, 80]) == RED and tuple(frame[60, 60]) == (10, 20, 200)


def test_same_pose_same_bytes_also_from_another_renderer():
    stage, spec = scene(wall(10.0), extinction=0.01), camera(supersample=2)
    with FrameRenderer(stage, spec) as renderer:
        one = renderer.render(np.array([1.0, 0.5, 0.1]), *NONE)
        renderer.render(np.array([-3.0, 0.5, 2.1]), *NONE)
        two = renderer.render(np.array([1.0, 0.5, 0.1]), *NONE)
    assert one.tobytes() == two.tobytes() == draw(stage, spec, (1.0, 0.5, 0.1)).tobytes()


def test_where_there_is_no_ground_there_is_haze():
    assert np.all(draw(scene(wall(10.0)), camera())[-1, 0] == sky_dome(LOOK).rgb[0])


def test_a_frame_is_not_overwritten_by_the_next():
    with FrameRenderer(scene(wall(10.0)), camera()) as renderer:
        one = renderer.render(np.zeros(3), *NONE)
        before = one.copy()
        renderer.render(np.array([0.0, 0.0, 3.0]), *NONE)
    assert np.array_equal(one, before)


def test_far_networks_are_drawn_as_exactly_as_near_ones():
    far = scene(wall(10.0), origin=(500_000.0, 5_000_000.0))
    assert np.array_equal(draw(far, camera(), (500_000.0, 5_000_000.0, 0.0)), draw(scene(wall(10.0)), camera()))


def test_vehicles_appear_and_keep_their_colour_with_their_identity():
    with FrameRenderer(scene(wall(200.0)), camera()) as renderer:
        empty = renderer.render(np.zeros(3), *NONE)
        poses, kinds = np.array([[12.0, -2.0, 0.0], [12.0, 2.0, 0.0]]), np.array([0, 2], np.uint8)
        both = renderer.render(np.zeros(3), poses, kinds, np.array([7, 9]))
        swapped = renderer.render(np.zeros(3), poses[::-1], kinds[::-1], np.array([9, 7]))
        again = renderer.render(np.zeros(3), *NONE)
    assert np.any(both[:, :80] != empty[:, :80]) and np.any(both[:, 80:] != empty[:, 80:])
    assert np.array_equal(both, swapped) and np.array_equal(empty, again)


@pytest.mark.parametrize("kind", range(len(VEHICLE_SIZES_M)))
def test_a_vehicle_has_its_size_and_place(kind):
    tile = vehicle_mesh(np.array([[30.0, -7.0, np.pi / 2]]), np.array([kind], np.uint8), np.array([4]), light_of(LOOK))
    length, width, height = VEHICLE_SIZES_M[kind]
    low, high = tile.vertices_m.min(axis=0), tile.vertices_m.max(axis=0)
    assert np.allclose((low + high)[:2] / 2, [30.0, -7.0], atol=1e-3)
    assert np.allclose(high - low, [width, length, height], atol=0.25)


def test_two_renderers_at_once_are_refused_and_a_closed_one_can_be_replaced():
    with FrameRenderer(scene(wall(10.0)), camera()), pytest.raises(HippodromeError, match="close it first"):
        FrameRenderer(scene(wall(10.0)), camera())
    assert is_red(draw(scene(wall(10.0)), camera())).any()


@pytest.mark.parametrize(
    "broken", ["#version 330 core\nnonsense", flat.FRAGMENT_SHADER.replace("haze, grained", "base.rgb, grained")]
)
def test_a_broken_shader_is_loud_and_leaves_no_renderer_behind(monkeypatch, broken):
    monkeypatch.setattr(flat, "FRAGMENT_SHADER", broken)
    with pytest.raises(Exception, match=r"nonsense|haze|compile"):
        FrameRenderer(scene(wall(10.0)), camera())
    monkeypatch.undo()
    assert is_red(draw(scene(wall(10.0)), camera())).any()


@given(
    eye=st.tuples(st.floats(-300, 300), st.floats(-300, 300)),
    heading=st.floats(-np.pi, np.pi),
    bearing=st.floats(-0.99, 0.99),
    distance=st.floats(1.0, 400.0),
)
def test_no_tile_in_view_is_culled(eye, heading, bearing, distance):
    corners = 80.0 * np.stack(np.meshgrid(np.arange(-10, 10), np.arange(-10, 10)), -1).reshape(-1, 2)
    bounds = np.hstack([corners, corners + 80.0])
    half_fov = np.pi / 4
    point = np.array(eye) + distance * np.array([np.cos(heading + bearing * half_fov), np.sin(heading + bearing * half_fov)])
    holder = np.flatnonzero(np.all((bounds[:, :2] <= point) & (point <= bounds[:, 2:]), axis=1))
    ahead = np.array([np.cos(heading), np.sin(heading)])
    seen, distance_m = visible_tiles(bounds, np.array(eye), ahead, half_fov, 450.0)
    assert set(holder) <= set(seen)
    assert np.all(np.diff(distance_m) >= 0.0)
    assert len(seen) < len(bounds) / 2


def test_tiles_behind_the_camera_are_culled():
    bounds = np.array([[-90.0, -40.0, -10.0, 40.0], [10.0, -40.0, 90.0, 40.0], [500.0, 0.0, 580.0, 80.0]])
    assert visible_tiles(bounds, np.zeros(2), np.array([1.0, 0.0]), np.pi / 4, 450.0)[0].tolist() == [1]


def test_the_second_camera_is_to_the_right():
    position, yaw = camera_position_m(camera(forward_m=2.0, height_m=1.2), np.array([5.0, 6.0, np.pi / 2]), right_m=0.3)
    assert np.allclose(position, [5.3, 8.0, 1.2]) and yaw == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    "bad", [{"width": 0}, {"fov_deg": 180.0}, {"supersample": 0}, {"stereo_baseline_m": -1.0}, {"lens": "fish"}]
)
def test_bad_cameras_are_rejected(bad):
    with pytest.raises(ValidationError):
        CameraSpec(**bad)
