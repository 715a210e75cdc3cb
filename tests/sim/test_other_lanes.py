"""Lanes that are closed to cars, and what scenery must not depend on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.furniture import furniture_mesh
from hippodrome.sim.scene.placement import Border, clear_of, other_lanes
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import read_town

NODES = {"a": (0, 0), "b": (400, 0), "c": (400, 150), "d": (0, 150), "p": (0, -14), "q": (400, -14), "t": (0, 17), "u": (400, 17)}


def town_with_tram(folder):
    """A ring of streets, one with a pavement, a cycleway and a tram beside it."""
    nodes, edges, net = (folder / f"tram.{part}.xml" for part in ("nod", "edg", "net"))
    nodes.write_text("<nodes>" + "".join(f'<node id="{n}" x="{x}" y="{y}"/>' for n, (x, y) in NODES.items()) + "</nodes>")
    rows = [f'<edge id="{one}{two}" from="{one}" to="{two}"/>' for one, two in ("ab", "ba", "bc", "cb", "cd", "dc", "da")]
    rows.append('<edge id="ad" from="a" to="d" sidewalkWidth="2"/>')
    rows.append('<edge id="cycle" from="p" to="q" allow="bicycle" width="2.5"/><edge id="tram" from="t" to="u" allow="tram"/>')
    edges.write_text("<edges>" + "".join(rows) + "</edges>")
    files = f"--node-files={nodes}", f"--edge-files={edges}", f"--output-file={net}"
    run_tool("netconvert", *files, "--offset.disable-normalization=true")
    return net


def standing(town, seed):
    """Hulls (k,) of all faces that stand up from the ground, below the height of a lamp."""
    scene = build_scene(town, seed, Conditions())
    corners = np.concatenate([tile.vertices_m[tile.faces] for tile in scene.tiles]).astype(np.float64)
    high = (corners[:, :, 2].max(axis=1) > 0.2) & (corners[:, :, 2].min(axis=1) < 4.0)
    return shapely.convex_hull(shapely.multipoints(corners[high][:, :, :2])), scene.origin_m


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_stands_on_any_lane(tmp_path, seed):
    town = read_town(town_with_tram(tmp_path))
    assert len(town.other_lanes_m) == 3
    hulls, origin_m = standing(town, seed)
    assert len(hulls) > 1000
    lanes = shapely.buffer(other_lanes(town, origin_m), -0.05)
    assert np.all(clear_of(hulls, lanes, 0.0))
    before, _ = standing(replace(town, other_lanes_m=()), seed)
    assert not np.all(clear_of(before, lanes, 0.0)), "without them something would stand there"


def test_scenery_does_not_depend_on_the_files_name(tmp_path):
    net = town_with_tram(tmp_path)
    tiles = []
    for name in ("rural.net.xml", "city.net.xml"):
        tiles.append(build_scene(read_town(Path(net.rename(net.with_name(name)))), 1, Conditions()).tiles)
        net = net.with_name(name)
    assert all(np.array_equal(one.vertices_m, two.vertices_m) for one, two in zip(*tiles, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_no_board_reaches_over_the_road_behind_it(seed):
    """Signs are up to 1.8 m wide and turned across the road; a second road lies 1.5 m beside the one that they stand at."""
    k = 1000
    border = Border(np.stack([2.0 * np.arange(k), np.zeros(k)], axis=1), np.tile([0.0, 1.0], (k, 1)), np.full(k, 2.0))
    here, behind = shapely.box(0.0, -6.0, 2.0 * k, 0.0), shapely.box(0.0, 1.5, 2.0 * k, 5.0)
    nothing = np.zeros(0, dtype=object)

    def boards(roads):
        mesh = furniture_mesh(border, np.zeros(k), np.zeros((0, 3)), False, np.array(roads), nothing, np.random.default_rng(seed))
        corners = mesh.vertices_m[mesh.faces]
        return shapely.convex_hull(shapely.multipoints(corners[corners[:, :, 2].min(axis=1) < 4.0][:, :, :2]))

    lanes = shapely.buffer(np.array([here, behind]), -0.06)
    assert len(boards([here, behind])) > 20
    assert np.all(clear_of(boards([here, behind]), lanes, 0.0))
    assert not np.all(clear_of(boards([here]), lanes, 0.0)), "there would be some if nobody looked"
