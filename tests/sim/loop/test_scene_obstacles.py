"""Buildings as obstacles: where the scene draws them, and nowhere else."""

import numpy as np
import pytest
import shapely

from hippodrome.sim.loop.types import EventKind, LanePlace
from hippodrome.sim.loop.walls import Walls
from hippodrome.sim.loop.world import World
from hippodrome.sim.scene.blocks import Block
from hippodrome.sim.scene.build import scene_origin_m
from hippodrome.sim.scene.placement import paved_area
from hippodrome.sim.scene.town_mesh import block_mesh, building_footprints, land_of, town_mesh
from tests.sim.loop import small


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with World(small.scenario(), tmp_path_factory.mktemp("town"), draw=False) as opened:
        yield opened


def inside(mesh, footprint):
    return shapely.contains_xy(footprint, mesh.vertices_m[:, 0], mesh.vertices_m[:, 1]).any()


@pytest.mark.parametrize("block", [None, Block(0, 0)])
def test_footprints_are_those_of_what_is_drawn(world, block):
    origin = scene_origin_m(world.town)
    land = land_of(world.town, origin)
    footprints = building_footprints(land, 3, origin, block)
    bold, _ = town_mesh(world.town, 3, origin) if block is None else block_mesh(land, 3, origin, block)
    assert len(footprints) > 3
    assert all(inside(bold, footprint.buffer(0.1)) for footprint in footprints)
    roads = shapely.union_all(paved_area(world.town, origin)[0])
    assert min(roads.distance(footprint) for footprint in footprints) >= 2.0 - 1e-6


def test_driving_into_a_house_is_one_event_and_the_end_of_the_drive(world):
    origin = scene_origin_m(world.town)
    house = building_footprints(land_of(world.town, origin), 3, origin)[0]
    x, y = np.array(house.centroid.coords[0]) + origin
    reach = 12.0 + 0.5 * house.length
    world.reset(1, LanePlace(world.network.lane_ids[int(np.flatnonzero(~world.network.is_internal)[0])], 5.0))
    world.teleport((x - reach, y, 0.0))
    found, speeds = [], []
    for _ in range(150):
        sensed = world.step(2.0, 0.0)
        found += [event for event in sensed.events if event.kind == EventKind.BUILDING]
        speeds.append(sensed.truth.speed_mps)
        if found:
            break
    assert found
    assert found[0].at_fault
    assert max(speeds) > 1.0
    assert Walls(world.town, 3, origin).touch((x, y, 0.0))
    assert not Walls(world.town, 3, origin).touch((x + 5e3, y, 0.0))
