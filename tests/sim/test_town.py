from itertools import combinations
from pathlib import Path

import libsumo
import numpy as np
import pytest
import sumo
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely import LineString

from hippodrome.core.types import HippodromeError
from hippodrome.sim.generators import grid_plan, radial_plan, through_nodes
from hippodrome.sim.network import drivable_edges, edge_lengths_m
from hippodrome.sim.rural import MIN_RADIUS_M, rural_plan
from hippodrome.sim.sumo_run import sumo_run
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec

KINDS = ["rural", "grid", "radial", "random"]
PLANS = {
    "rural": lambda rng: rural_plan(287.0, 370.0, 2200.0, rng),
    "grid": lambda rng: grid_plan(300.0, 300.0, 9, rng),
    "radial": lambda rng: radial_plan(300.0, 300.0, 3, 6, rng),
}


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_same_bytes_and_another_seed_another_town(tmp_path, kind):
    spec = TownSpec(kind=kind, road_km=1.5, width_m=200.0, height_m=200.0)
    towns = [build_town(spec, seed, tmp_path / folder) for seed, folder in ((3, "a"), (3, "b"), (4, "c"))]
    one, same, other = (town.net_file.read_bytes() for town in towns)
    assert one == same and one != other
    assert b"<!--" not in one  # netconvert's header holds the date


@pytest.mark.parametrize(("kind", "seed"), [("rural", 0), ("rural", 1), ("grid", 2), ("radial", 3), ("random", 4)])
def test_every_road_can_be_driven_and_left_again(tmp_path, kind, seed):
    town = build_town(TownSpec(kind=kind), seed, tmp_path)
    length = edge_lengths_m(town.network)
    assert set(drivable_edges(town.network)) == set(np.flatnonzero(length))
    assert 0.75 * 4390.0 < length.sum() < 1.25 * 4390.0
    assert len(town.junction_polygons_m) > 5
    assert not town.left_hand


def test_rural_default_resembles_town07(tmp_path):
    """119 edges, 51 junctions, 4.39 km, 287 m by 370 m; each within a fifth on average over seeds."""
    towns = [build_town(TownSpec(), seed, tmp_path) for seed in range(4)]
    edges = np.mean([np.count_nonzero(edge_lengths_m(town.network)) for town in towns])
    junctions = np.mean([len(town.junction_polygons_m) for town in towns])
    metres = np.mean([edge_lengths_m(town.network).sum() for town in towns])
    box = np.mean([np.ptp(town.network.points_m, axis=0) for town in towns], axis=0)
    assert edges == pytest.approx(119, rel=0.2)
    assert junctions == pytest.approx(51, rel=0.2)
    assert metres == pytest.approx(4390, rel=0.2)
    assert box == pytest.approx([287, 370], rel=0.2)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), kind=st.sampled_from(sorted(PLANS)))
def test_plans_have_no_dead_ends_and_no_crossing_streets(seed, kind):
    plan = PLANS[kind](np.random.default_rng(seed))
    arms = np.bincount(np.array(plan.streets).ravel())
    assert arms.min() >= 2
    lines = [LineString(shape) for shape in plan.shapes_m]
    for (i, one), (j, other) in combinations(enumerate(lines), 2):
        shared = set(plan.streets[i]) & set(plan.streets[j])
        if not shared:
            assert not one.intersects(other), (seed, plan.streets[i], plan.streets[j])
    for (a, b), shape in zip(plan.streets, plan.shapes_m, strict=True):
        np.testing.assert_allclose(shape[[0, -1]], plan.nodes_m[[a, b]], atol=1e-6)


def test_rural_roads_are_curvy_but_not_too_tight():
    plan = rural_plan(287.0, 370.0, 2200.0, np.random.default_rng(5))
    bent = 0.0
    for shape in plan.shapes_m:
        step = np.diff(shape, axis=0)
        turn = np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0]))))
        length = np.linalg.norm(step, axis=1)
        assert (turn / (0.5 * (length[1:] + length[:-1]))).max(initial=0.0) < 1.3 / MIN_RADIUS_M
        bent += turn.sum()
    assert bent / plan.length_m() > 0.005  # rad/m: half a turn and more on each kilometre
    assert sum(through_nodes(plan)) > 0.4 * len(plan.nodes_m)


def test_lanes_and_speed_limit_are_what_was_asked_for(tmp_path):
    spec = TownSpec(kind="grid", lanes=2, speed_limit_mps=11.0, road_km=2.0, width_m=200.0, height_m=200.0)
    network = build_town(spec, 0, tmp_path).network
    roads = ~network.is_internal
    assert set(network.speed_limit_mps[roads]) == {11.0}
    assert np.count_nonzero(roads) == 2 * len(drivable_edges(network))
    assert np.count_nonzero(network.left_lane >= 0) == len(drivable_edges(network))


def test_imported_network_overrides_the_kind_and_keeps_its_file(tmp_path):
    file = Path(sumo.SUMO_HOME) / "tools" / "game" / "bs3d" / "bs.net.xml"
    town = build_town(TownSpec(network=file), 0, tmp_path)
    assert town.net_file == file and town.name == "bs"
    assert len(town.signals_m) > 0
    assert any("switch" in note for note in town.notes)


def test_openstreetmap_is_converted_once(tmp_path):
    rows = [(1, 52.0, 13.0), (2, 52.002, 13.0), (3, 52.002, 13.003), (4, 52.0, 13.003)]
    nodes = "".join(f'<node id="{i}" lat="{lat}" lon="{lon}" version="1"/>' for i, lat, lon in rows)
    ways = '<way id="9" version="1">' + "".join(f'<nd ref="{i}"/>' for i in (1, 2, 3, 4, 1))
    osm = tmp_path / "block.osm"
    osm.write_text(f'<osm version="0.6">{nodes}{ways}<tag k="highway" v="residential"/></way></osm>')
    town = build_town(TownSpec(network=osm), 0, tmp_path / "work")
    written = town.net_file.stat().st_mtime_ns
    assert 1300 < edge_lengths_m(town.network).sum() < 2000
    assert build_town(TownSpec(network=osm), 0, tmp_path / "work").net_file.stat().st_mtime_ns == written


def test_tools_complaints_become_the_error(tmp_path):
    with pytest.raises(HippodromeError, match="netconvert failed") as caught:
        run_tool("netconvert", f"--node-files={tmp_path / 'none.nod.xml'}", f"--output-file={tmp_path / 'x.net.xml'}")
    assert "none.nod.xml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("bad", [{"kind": "moon"}, {"road_km": 0.0}, {"lanes": 3}, {"speed_limit_mps": -1.0}, {"size": 3}])
def test_bad_specs_are_rejected(bad):
    with pytest.raises(ValidationError):
        TownSpec(**bad)


def test_a_comma_in_a_folder_separates_no_files(tmp_path):
    """SUMO and netconvert take a comma in a path for the end of one file's name."""
    folder = tmp_path / "towns, mine"
    town = build_town(TownSpec(kind="grid", width_m=150, height_m=150, road_km=0.8), 1, folder)
    assert town.net_file.parent == folder and [path.name for path in folder.iterdir()] == [town.net_file.name]
    with sumo_run(town.net_file, "<additional/>", 1):
        assert libsumo.edge.getIDCount() > 0
