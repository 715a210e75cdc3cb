"""Dead ends: the ego turns round on paving, and nothing stands on it."""

import numpy as np
import pytest
import shapely

from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M, EgoSpec
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.placement import clear_of, paved_area, rectangles, turning_places
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import read_town
from hippodrome.sim.traffic_spec import TrafficSpec

NODES = {"a": (0, 0), "b": (100, 0), "c": (100, 100), "d": (0, 100), "m": (50, 0), "e": (50, -60), "x": (160, 20)}
STREETS = ("am", "mb", "bc", "cd", "da", "me", "bx")


@pytest.fixture(scope="module", params=["right", "left"])
def town(request, tmp_path_factory):
    """A ring with two dead ends, one of them askew."""
    folder = tmp_path_factory.mktemp("ends")
    nodes, edges, net = (folder / f"ends.{part}.xml" for part in ("nod", "edg", "net"))
    nodes.write_text("<nodes>" + "".join(f'<node id="{n}" x="{x}" y="{y}"/>' for n, (x, y) in NODES.items()) + "</nodes>")
    both = [*STREETS, *(street[::-1] for street in STREETS)]
    edges.write_text("<edges>" + "".join(f'<edge id="{s}" from="{s[0]}" to="{s[1]}"/>' for s in both) + "</edges>")
    files = f"--node-files={nodes}", f"--edge-files={edges}", f"--output-file={net}"
    side = ("--lefthand=true",) if request.param == "left" else ()
    run_tool("netconvert", *files, "--no-turnarounds.except-deadend=true", "--offset.disable-normalization=true", *side)
    return read_town(net)


def test_the_ego_turns_round_without_leaving_the_paving(town):
    assert len(town.turning_places_m) == 2
    drive = simulate_drive(town, TourSpec(length_m=1500.0), TrafficSpec(vehicles=0), EgoSpec(), 1)
    paved = shapely.union_all(paved_area(town, np.zeros(2))[0]).buffer(0.05)
    seen = 0
    for end in ("e", "x"):
        poses = drive.poses_m[np.linalg.norm(drive.poses_m[:, :2] - NODES[end], axis=1) < 20.0]
        ahead_m = REAR_AXLE_TO_FRONT_M - 0.5 * LENGTH_M
        centre = poses[:, :2] + ahead_m * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        cars = rectangles(centre, poses[:, 2], np.full(len(poses), LENGTH_M), np.full(len(poses), 1.8))
        assert np.all(shapely.area(shapely.difference(cars, paved)) < 0.02), end
        seen += len(cars)
    assert seen > 100


def test_nothing_stands_where_cars_turn_round(town):
    scene = build_scene(town, 1, Conditions())
    corners = np.concatenate([tile.vertices_m[tile.faces] for tile in scene.tiles]).astype(np.float64)
    high = (corners[:, :, 2].max(axis=1) > 0.1) & (corners[:, :, 2].min(axis=1) < 4.0)
    hulls = shapely.convex_hull(shapely.multipoints(corners[high][:, :, :2]))
    places = shapely.buffer(turning_places(town, scene.origin_m), -2.0)  # a kerb may begin at the rim
    assert np.all(clear_of(hulls, places, 0.0))
