from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.lanes import PIECE_M, Beside, beside, cut_lanes
from hippodrome.sim.scene.light import colour, light_of, shade
from hippodrome.sim.scene.mesh import Mesh, Surface, boxes, instances, merge, polygons
from hippodrome.sim.scene.placement import borders, clear_of, paved_area, quilt, spread
from hippodrome.sim.scene.town_mesh import town_mesh
from hippodrome.sim.types import Town

ORIGIN = np.zeros(2)


def network(*lanes, internal=()):
    """Lanes as lists of points; widths 3.2 m; one edge each."""
    count = len(lanes)
    ends = np.cumsum([0, *map(len, lanes)])
    none = np.full(count, -1, np.int32)
    return RoadNetwork(
        lane_ids=tuple(f"l{i}" for i in range(count)),
        edge_ids=tuple(f"e{i}" for i in range(count)),
        lane_edge=np.arange(count, dtype=np.int32),
        is_internal=np.isin(np.arange(count), internal),
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 10.0),
        points_m=np.concatenate([np.array(lane, float) for lane in lanes]),
        point_start=ends.astype(np.int32),
        successor=np.zeros(0, np.int32),
        successor_start=np.zeros(count + 1, np.int32),
        left_lane=none,
        right_lane=none,
    )


def crossing(name="rural", left_hand=False):
    """Two two-way streets of 400 m that cross, with four straight lanes through the junction."""
    a, b, w = 200.0, 8.0, 1.6
    arms, inner = [], []
    for heading in np.radians([0.0, 90.0, 180.0, 270.0]):
        turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        arms += [np.array([[-a, -w], [-b, -w]]) @ turn, np.array([[b, -w], [a, -w]]) @ turn]
        inner.append(np.array([[-b, -w], [b, -w]]) @ turn)
    square = np.array([[b, -b], [b, b], [-b, b], [-b, -b]])
    signals = np.array([[-8.0, -1.6, 0.0], [1.6, -8.0, np.pi / 2]])
    roads = network(*arms, *inner, internal=range(8, 12))
    return Town(name, Path("crossing.net.xml"), roads, (square,), signals, left_hand, (), rural=name == "rural")


@pytest.fixture(scope="module")
def scenes():
    """The same town and seed under several conditions."""
    looks = {
        "day": Conditions(),
        "evening": Conditions(sun_azimuth_deg=20.0, sun_elevation_deg=8.0, dusk=1.0),
        "fog": Conditions(fog_visibility_m=80.0, overcast=1.0),
        "winter": Conditions(season="winter"),
    }
    return {name: build_scene(crossing(), 3, look) for name, look in looks.items()}


def test_conditions_change_colours_and_never_geometry(scenes):
    day = scenes["day"]
    for name, other in scenes.items():
        assert len(day.tiles) == len(other.tiles)
        for one, two in zip(day.tiles, other.tiles, strict=True):
            assert np.array_equal(one.vertices_m, two.vertices_m) and np.array_equal(one.faces, two.faces)
            assert one.bold_faces == two.bold_faces
        same = all(np.array_equal(one.rgb, two.rgb) for one, two in zip(day.tiles, other.tiles, strict=True))
        assert same == (name == "day")


def test_same_seed_same_bytes_and_another_seed_another_town(scenes):
    again, other = build_scene(crossing(), 3, Conditions()), build_scene(crossing(), 4, Conditions())
    for one, two in zip(scenes["day"].tiles, again.tiles, strict=True):
        assert one.vertices_m.tobytes() + one.faces.tobytes() + one.rgb.tobytes() == (
            two.vertices_m.tobytes() + two.faces.tobytes() + two.rgb.tobytes()
        )
    assert sum(len(t.faces) for t in other.tiles) != sum(len(t.faces) for t in again.tiles)


def test_tiles_are_well_formed_and_local(scenes):
    for tile in scenes["day"].tiles:
        assert tile.vertices_m.dtype == np.float32 and tile.faces.dtype == np.int32 and tile.rgb.dtype == np.uint8
        assert tile.rgb.shape == tile.vertices_m.shape
        assert np.array_equal(np.unique(tile.faces), np.arange(len(tile.vertices_m)))
        assert 0 <= tile.bold_faces <= len(tile.faces)
        assert np.ptp(tile.vertices_m[:, :2], axis=0).max() < 80.0 + 90.0  # a large face may reach beyond its tile


@pytest.mark.parametrize(("name", "seed"), [("rural", 0), ("rural", 1), ("grid", 0), ("grid", 1)])
def test_nothing_stands_on_the_road(name, seed):
    town = crossing(name)
    mesh = merge(town_mesh(town, seed, ORIGIN))
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    high = (corners[:, :, 2].max(axis=1) > 0.1) & (corners[:, :, 2].min(axis=1) < 4.0)  # a lamp may hang over the road
    hulls = shapely.convex_hull(shapely.multipoints(corners[high][:, :, :2]))
    paved = shapely.buffer(paved_area(town, ORIGIN)[0], -0.05)  # a kerb's face touches the asphalt
    assert high.sum() > 1000
    assert np.all(clear_of(hulls, paved, 0.0))


def test_the_road_is_covered_and_marked():
    mesh = merge(town_mesh(crossing(), 0, ORIGIN))
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    flat = np.ptp(corners[:, :, 2], axis=1) == 0.0
    asphalt = shapely.union_all(shapely.polygons(corners[flat & np.isin(corners[:, 0, 2], np.float32([0.025, 0.03]))][:, :, :2]))
    assert shapely.union_all(paved_area(crossing(), ORIGIN)[0]).difference(asphalt.buffer(0.01)).area < 0.1
    paint = corners[flat & (corners[:, 0, 2] == np.float32(0.05))][:, :, :2].mean(axis=1)
    along = paint[(np.abs(paint[:, 0]) > 20.0) & (np.abs(paint[:, 1]) < 4.0)]
    assert set(np.round(np.abs(along[:, 1]))) == {0.0, 3.0}  # centre line at 0, edge lines at 3.2 - 0.2


def test_every_stretch_of_road_has_something_to_recognise():
    mesh = town_mesh(crossing(), 0, ORIGIN)[0]
    centre = mesh.vertices_m[mesh.faces].mean(axis=1)
    tall = centre[centre[:, 2] > 1.5]
    for x in np.arange(-180.0, 140.0, 30.0):
        ahead = (tall[:, 0] > x + 3.0) & (tall[:, 0] < x + 60.0) & (np.abs(tall[:, 1]) < tall[:, 0] - x)
        assert ahead.sum() >= 12, x  # a house with its roof has about that many faces above the eye


def test_faces_look_outwards():
    for mesh in town_mesh(crossing(), 0, ORIGIN):
        a, b, c = (mesh.vertices_m[mesh.faces[:, i]].astype(np.float64) for i in range(3))
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].sum(axis=1))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        assert np.all(facing[area > 1e-6] > 0.0)


def test_signals_stand_on_the_drivers_side():
    for left_hand, side in ((False, -1.0), (True, 1.0)):
        fine = town_mesh(crossing(left_hand=left_hand), 0, ORIGIN)[1]
        near = fine.vertices_m[(np.abs(fine.vertices_m[:, 0] + 8.0) < 0.4) & (np.abs(fine.vertices_m[:, 1]) < 10.0)]
        post = near[near[:, 2] > 1.5]
        assert len(post) > 0
        assert np.all(np.sign(post[:, 1]) == side)


def test_a_box_has_the_size_asked_for():
    box = boxes(np.array([[10.0, 5.0]]), np.array([np.pi / 2]), np.array([[4.0, 2.0, 3.0]]), np.array([0.5, 0.5, 0.5]))
    assert np.allclose(box.vertices_m.min(axis=0), [9.0, 3.0, 0.0], atol=1e-5)
    assert np.allclose(box.vertices_m.max(axis=0), [11.0, 7.0, 3.0], atol=1e-5)
    a, b, c = (box.vertices_m[box.faces[:, i]].astype(float) for i in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(2 * 4 * 3 + 2 * 2 * 3 + 4 * 2, rel=1e-5)


def test_instances_are_scaled_then_turned_then_moved():
    quad = polygons(np.array([[[1, 0, 0], [2, 0, 0], [2, 0, 1], [1, 0, 1]]]), np.array([0.5, 0.5, 0.5]))
    copy = instances(quad, np.array([[10.0, 20.0]]), np.array([np.pi / 2]), np.array([[2.0, 1.0, 3.0]]), np.ones((1, 3)))
    assert np.allclose(copy.vertices_m, [[10, 22, 0], [10, 24, 0], [10, 24, 3], [10, 22, 3]], atol=1e-5)
    assert np.allclose(copy.normals, [1.0, 0.0, 0.0], atol=1e-6)


def test_shading_by_hand():
    light = light_of(Conditions(sun_elevation_deg=90.0))
    up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    grey = np.full((1, 3), 0.5)
    assert np.all(shade(grey, up, light) == np.rint(255 * np.clip(0.5**2.2 * (light.sun + light.sky), 0, 1) ** (1 / 2.2)))
    assert np.all(shade(grey, down, light) == np.rint(255 * (0.5**2.2 * light.ground) ** (1 / 2.2)))


def test_the_sunny_side_is_brighter_and_clouds_level_it():
    east, west = np.array([[1.0, 0, 0]]), np.array([[-1.0, 0, 0]])
    grey = np.full((1, 3), 0.5)
    sunny, closed = light_of(Conditions(sun_azimuth_deg=0.0)), light_of(Conditions(sun_azimuth_deg=0.0, overcast=1.0))
    assert np.all(shade(grey, east, sunny) > shade(grey, west, sunny))
    assert np.array_equal(shade(grey, east, closed), shade(grey, west, closed))


def test_seasons_tint_leaves_and_leave_walls_alone():
    quad = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]])
    rgb = {}
    for season in ("summer", "autumn", "winter"):
        look = Conditions(season=season)
        for surface in (Surface.LEAF, Surface.MINERAL):
            rgb[season, surface] = colour(polygons(quad, np.array([0.3, 0.5, 0.2]), surface), look, light_of(look))[0].astype(int)
    assert rgb["summer", Surface.LEAF][1] > rgb["summer", Surface.LEAF][0]
    assert rgb["autumn", Surface.LEAF][0] > rgb["autumn", Surface.LEAF][1]
    assert np.ptp(rgb["winter", Surface.LEAF]) < np.ptp(rgb["summer", Surface.LEAF])
    assert np.array_equal(rgb["summer", Surface.MINERAL], rgb["winter", Surface.MINERAL])


def test_windows_are_lit_at_dusk_only(scenes):
    lamp = np.rint(255 * np.array([1.0, 0.78, 0.42])).astype(np.uint8)
    lit = {name: sum(int(np.all(t.rgb == lamp, axis=1).sum()) for t in scene.tiles) for name, scene in scenes.items()}
    assert lit["day"] == 0 and lit["evening"] > 20


def test_visibility_is_where_two_percent_of_the_contrast_is_left(scenes):
    assert np.exp(-scenes["fog"].extinction_per_m * 80.0) == pytest.approx(0.02, rel=1e-3)


def test_what_lies_beside_a_lane():
    roads = network([[0, 0], [30, 0]], [[0, 3.2], [30, 3.2]], [[30, 6.4], [0, 6.4]])  # two eastbound, one westbound
    pieces = cut_lanes(roads, ORIGIN)
    assert np.allclose(np.linalg.norm(pieces.end_m - pieces.start_m, axis=1), PIECE_M)
    left, left_lane = beside(pieces, roads.is_internal, 1)
    right, _ = beside(pieces, roads.is_internal, -1)
    expected_left = {0: (Beside.SAME_DIRECTION, 1), 1: (Beside.OPPOSITE, 2), 2: (Beside.NOTHING, -1)}
    expected_left[2] = (Beside.OPPOSITE, 1)  # westbound: its left is south
    for lane, (kind, other) in expected_left.items():
        assert np.all(left[pieces.lane == lane] == kind) and np.all(left_lane[pieces.lane == lane] == other)
    assert np.all(right[pieces.lane == 0] == Beside.NOTHING)
    assert np.all(right[pieces.lane == 1] == Beside.SAME_DIRECTION)
    assert np.all(right[pieces.lane == 2] == Beside.NOTHING)
    border = borders(pieces, roads.is_internal)
    assert set(np.round(border.point_m[:, 1], 6)) == {-1.6, 8.0}
    assert border.length_m.sum() == pytest.approx(60.0)


def test_a_bend_keeps_the_lanes_width():
    roads = network([[0, 0], [10, 0], [10, 10]])
    pieces = cut_lanes(roads, ORIGIN)
    joint = np.flatnonzero(np.all(np.isclose(pieces.end_m, [10, 0]), axis=1))[0]
    assert np.allclose(pieces.end_normal[joint], [-1, 1])  # mitred: 1 m from both arms
    assert np.allclose(pieces.end_normal[joint], pieces.start_normal[joint + 1])


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(0, 50), st.floats(0, 50)), min_size=1, max_size=40), st.floats(0.5, 15.0))
def test_spread_keeps_a_maximal_set_and_the_earlier_one_wins(xy, distance_m):
    shapes = shapely.points(np.array(xy))
    stays = spread(shapes, distance_m)
    apart = shapely.distance(shapes[:, None], shapes[None])
    kept = np.flatnonzero(stays)
    assert np.all(apart[np.ix_(kept, kept)][~np.eye(len(kept), dtype=bool)] > distance_m)
    for lost in np.flatnonzero(~stays):
        assert np.any(apart[lost, kept[kept < lost]] <= distance_m)


def test_quilt_is_uniform_and_smooth():
    rng = np.random.default_rng(1)
    fields = [quilt(rng.uniform(0, 5000, (400, 2)), 50.0, np.random.default_rng(seed)) for seed in range(20)]
    values = np.concatenate(fields)
    assert values.min() >= 0.0 and values.max() <= 1.0
    assert np.allclose(np.histogram(values, bins=4, range=(0, 1))[0] / len(values), 0.25, atol=0.04)
    here = rng.uniform(0, 500, (300, 2))
    step = quilt(here + np.array([0.5, 0.0]), 50.0, np.random.default_rng(2)) - quilt(here, 50.0, np.random.default_rng(2))
    assert np.abs(step).max() < 0.1


def test_merging_nothing_is_an_empty_mesh():
    empty = merge([])
    assert isinstance(empty, Mesh) and len(empty.faces) == 0


def test_a_town_far_from_its_networks_zero_looks_the_same():
    near = crossing()
    shift = np.array([512_000.0, 5_400_000.0])
    moved = network(*(near.network.lane_points_m(i) + shift for i in range(near.network.lane_count)), internal=range(8, 12))
    signals = near.signals_m + np.array([*shift, 0.0])
    far = Town("rural", near.net_file, moved, (near.junction_polygons_m[0] + shift,), signals, False, (), rural=True)
    one, two = build_scene(near, 0, Conditions()), build_scene(far, 0, Conditions())
    assert np.allclose(two.origin_m - one.origin_m, shift)
    assert len(one.tiles) == len(two.tiles)
    assert np.allclose(one.tiles[5].vertices_m, two.tiles[5].vertices_m, atol=1e-3)


def test_edge_lines_do_not_cross_a_junctions_middle():
    mesh = merge(town_mesh(crossing(), 0, ORIGIN))
    paint = mesh.vertices_m[mesh.faces].astype(np.float64)
    paint = paint[np.all(paint[:, :, 2] == np.float32(0.05), axis=1)][:, :, :2].mean(axis=1)
    assert not np.any(np.all(np.abs(paint) < 6.0, axis=1))
