"""Networks with a third dimension: ramps, bridges, what passes below them."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.sim.drive import drive_pitch_rad, simulate_drive
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M, EgoSpec
from hippodrome.sim.net_heights import pitch_rad
from hippodrome.sim.render.camera import CameraSpec, camera_position_m, camera_to_world
from hippodrome.sim.render.renderer import FrameRenderer
from hippodrome.sim.render.vehicles import vehicle_mesh
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.lanes import cut_lanes
from hippodrome.sim.scene.light import light_of
from hippodrome.sim.scene.placement import rectangles
from hippodrome.sim.scene.relief import relief_of
from hippodrome.sim.self_motion import SelfMotionNoise, sense_self_motion
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town, read_town
from hippodrome.sim.traffic import VEHICLE_SIZES_M, traffic_at
from hippodrome.sim.traffic_spec import TrafficSpec

NODES = {"a": (0, 0), "b": (300, 0), "s": (150, -120), "n": (150, 120)}
OVER = "0,0,0 60,0,0 120,0,6 180,0,6 240,0,0 300,0,0"  # a slope of one in ten, above the street from s to n
DECK_M = 6.0
CAR_HEIGHT_M = 1.5
SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios" / "library").glob("*.yaml"))


def overpass(folder, with_heights=True):
    """Four streets round a square, and two that cross in its middle, one of them on a bridge."""

    def shape(text):
        return text if with_heights else " ".join(point.rpartition(",")[0] for point in text.split())

    nodes, edges, net = (folder / f"overpass.{part}.xml" for part in ("nod", "edg", "net"))
    nodes.write_text("<nodes>" + "".join(f'<node id="{n}" x="{x}" y="{y}"/>' for n, (x, y) in NODES.items()) + "</nodes>")
    rows = [
        f'<edge id="{one}{two}" from="{one}" to="{two}"/>'
        for one, two in ("as", "sa", "sb", "bs", "an", "na", "nb", "bn", "sn", "ns")
    ]
    back = " ".join(OVER.split()[::-1])
    rows += [f'<edge id="{n}" from="{n[0]}" to="{n[1]}" shape="{shape(line)}"/>' for n, line in (("ab", OVER), ("ba", back))]
    edges.write_text("<edges>" + "".join(rows) + "</edges>")
    files = f"--node-files={nodes}", f"--edge-files={edges}", f"--output-file={net}"
    run_tool("netconvert", *files, "--offset.disable-normalization=true")
    return read_town(net)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    return overpass(tmp_path_factory.mktemp("overpass"))


@pytest.fixture(scope="module")
def drive(town):
    return simulate_drive(town, TourSpec(length_m=2500.0), TrafficSpec(vehicles=12), EgoSpec(), 1)


def test_heights_are_those_of_the_file_and_bridges_are_not_crossings(town, tmp_path):
    assert town.heights_m.max() == DECK_M and town.heights_m.min() == 0.0
    assert len(town.heights_m) == len(town.network.points_m) and len(town.junction_heights_m) == len(town.junction_polygons_m)
    assert not any("cross without a junction" in note for note in town.notes)
    flat = overpass(tmp_path, with_heights=False)
    assert flat.heights_m is None
    notes = [note for note in flat.notes if "cross without a junction" in note]
    assert len(notes) == 1 and "4 pair(s)" in notes[0] and "for instance ab and ns at" in notes[0]


def test_the_ego_climbs_and_its_speed_is_that_along_the_slope(town, drive):
    assert drive.heights_m.max() == pytest.approx(DECK_M) and drive.heights_m.min() == 0.0
    steps = np.diff(np.column_stack([drive.poses_m[:, :2], drive.heights_m]), axis=0)
    slope = np.abs(np.diff(drive.heights_m)) / np.maximum(np.linalg.norm(steps[:, :2], axis=1), 1e-9)
    steady = (slope > 0.09) & (slope < 0.11) & (drive.speed_mps[1:] > 4.0)
    assert steady.sum() > 100
    speed = np.linalg.norm(steps, axis=1) / np.diff(drive.t_s)
    assert np.allclose(speed[steady], drive.speed_mps[1:][steady], rtol=0.02)
    exact = SelfMotionNoise(units_per_metre=1.0, units_per_metre_spread=0.0)
    sensed = sense_self_motion(drive, 10.0, exact, np.random.default_rng(0))
    assert float(sensed.speed.sum() * sensed.dt_s) == pytest.approx(float(np.linalg.norm(steps, axis=1).sum()), rel=1e-3)


def test_a_car_is_pitched_by_the_slope_under_its_wheels():
    along = np.linspace(0.0, 100.0, 401)
    heights = np.clip(0.1 * (along - 30.0), 0.0, 4.0)
    pitch = pitch_rad(along, heights, 2.7)
    assert np.allclose(pitch[along < 27.0], 0.0) and np.allclose(
        pitch[(along > 31.0) & (along < 66.0)], np.arctan(0.1), atol=1e-9
    )
    assert np.allclose(pitch_rad(np.zeros(5), np.ones(5), 2.7), 0.0), "a car that stands is level"


def test_the_camera_rises_and_looks_along_the_road():
    spec = CameraSpec()
    flat, yaw = camera_position_m(spec, np.array([3.0, 4.0, 0.7]))
    same, _ = camera_position_m(spec, np.array([3.0, 4.0, 0.7, 0.0, 0.0]))
    assert np.allclose(flat, same)
    up, _ = camera_position_m(spec, np.array([3.0, 4.0, 0.7, 6.0, 0.1]))
    assert up[2] == pytest.approx(6.0 + spec.height_m * np.cos(0.1) + spec.forward_m * np.sin(0.1))
    pose = camera_to_world(up, yaw, 0.1)
    assert np.allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3)) and np.linalg.det(pose[:3, :3]) > 0.0
    assert -pose[2, 2] == pytest.approx(np.sin(0.1)), "the view goes up with the nose"


def test_vehicles_stand_on_the_slope():
    poses = np.array([[10.0, 0.0, 0.0, 5.0, 0.1]])
    tile = vehicle_mesh(poses, np.zeros(1, np.uint8), np.zeros(1, np.int32), light_of(Conditions()))
    front = tile.vertices_m[tile.vertices_m[:, 0] > 11.9]
    back = tile.vertices_m[tile.vertices_m[:, 0] < 8.1]
    assert front[:, 2].min() - back[:, 2].min() == pytest.approx(0.1 * 4.0, abs=0.15)
    assert 4.7 < tile.vertices_m[:, 2].min() < 5.1


def test_what_is_above_is_drawn_above_and_the_ground_below_all_roads(town):
    pieces = cut_lanes(town.network, np.zeros(2), town.heights_m)
    relief = relief_of(pieces)
    assert np.all(relief.at_m(pieces.middle_m()) < pieces.middle_z_m()), "no road is buried"
    assert relief.at_m(np.array([[150.0, 0.0]]))[0] < 1.0, "the street below the bridge is not filled up"
    scene = build_scene(town, 1, Conditions())
    corners = np.concatenate([tile.vertices_m[tile.faces] for tile in scene.tiles]).astype(np.float64)
    middle = corners.mean(axis=1)
    here = np.linalg.norm(middle[:, :2] + scene.origin_m - [150.0, 0.0], axis=1) < 4.0
    levels = np.round(middle[here & (np.ptp(corners[:, :, 2], axis=1) < 1e-3), 2], 2)
    assert {0.03, 6.03} <= set(levels.tolist()), "asphalt lies on the bridge and below it"
    assert not np.any((levels > 0.3) & (levels < DECK_M - 1.0)), "and one can drive through in between"


def test_frames_differ_on_the_bridge_and_below_it(town):
    scene = build_scene(town, 1, Conditions())
    with FrameRenderer(scene, CameraSpec(width=80, height=60)) as renderer:
        above, below = (renderer.render(np.array([150.0, -1.6, 0.0, z_m, 0.0])) for z_m in (DECK_M, 0.0))
    assert np.abs(above.astype(int) - below).mean() > 10.0


def inside_the_ego(drive, shrink_m=0.4):
    """How often a vehicle is within the ego's outline and at its height; boxes are made a little smaller."""
    count = 0
    ego_ahead_m = REAR_AXLE_TO_FRONT_M - 0.5 * LENGTH_M
    for i in range(0, len(drive.t_s), 4):
        poses, kinds, _ = traffic_at(drive.traffic, float(drive.t_s[i]))
        if len(poses) == 0:
            continue
        x, y, heading = drive.poses_m[i]
        centre = np.array([[x + ego_ahead_m * np.cos(heading), y + ego_ahead_m * np.sin(heading)]])
        ego = rectangles(centre, np.array([heading]), np.array([LENGTH_M - shrink_m]), np.array([1.8 - shrink_m]))[0]
        size = VEHICLE_SIZES_M[kinds] - shrink_m
        hit = shapely.intersects(rectangles(poses[:, :2], poses[:, 2], size[:, 0], size[:, 1]), ego)
        if drive.heights_m is not None:
            hit &= np.abs(poses[:, 3] - drive.heights_m[i]) < CAR_HEIGHT_M
        count += int(np.count_nonzero(hit))
    return count


def test_vehicles_above_and_below_pass_without_touching(town, drive):
    assert drive.traffic.poses_m.shape[1] == 5
    assert inside_the_ego(drive) == 0
    assert np.abs(drive_pitch_rad(drive.poses_m, drive.heights_m)).max() < 0.11


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_no_vehicle_is_ever_inside_the_ego(path, tmp_path):
    scenario = read_scenario(path)
    town = build_town(scenario.town, scenario.seed, tmp_path)
    drive = simulate_drive(town, TourSpec(length_m=500.0), scenario.mapping.traffic, scenario.mapping.ego, 3)
    assert inside_the_ego(drive) == 0
