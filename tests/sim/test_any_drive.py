"""Drives on networks that give SUMO freedoms: lanes changed inside junctions, one lane for both ways, no room at the entrance."""

import re

import numpy as np
import pytest

from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.lane_log import LaneLog, lane_pieces
from hippodrome.sim.network import edge_links, read_network
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import read_town
from hippodrome.sim.traffic_spec import TrafficSpec

TWO_LANES = """<net version="1.20">
<edge id=":J_1" function="internal">
<lane id=":J_1_0" index="0" speed="9" length="20" shape="100,0 120,0"/>
<lane id=":J_1_1" index="1" speed="9" length="20" shape="100,3 120,3"/></edge>
<edge id="a" from="A" to="J"><lane id="a_0" index="0" speed="9" length="100" shape="0,0 100,0"/>
<lane id="a_1" index="1" speed="9" length="100" shape="0,3 100,3"/></edge>
<edge id="b" from="J" to="B"><lane id="b_0" index="0" speed="9" length="100" shape="120,0 220,0"/></edge>
<edge id="c" from="J" to="C"><lane id="c_0" index="0" speed="9" length="100" shape="120,3 220,9"/></edge>
<junction id="A" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape=""/>
<junction id="B" type="dead_end" x="220" y="0" incLanes="b_0" intLanes="" shape=""/>
<junction id="C" type="dead_end" x="220" y="9" incLanes="c_0" intLanes="" shape=""/>
<junction id="J" type="priority" x="110" y="0" incLanes="a_0 a_1" intLanes=":J_1_0 :J_1_1" shape=""/>
<connection from="a" to="b" fromLane="0" toLane="0" via=":J_1_0" dir="s" state="M"/>
<connection from="a" to="c" fromLane="1" toLane="0" via=":J_1_1" dir="s" state="M"/>
<connection from=":J_1" to="b" fromLane="0" toLane="0" dir="s" state="M"/>
<connection from=":J_1" to="c" fromLane="1" toLane="0" dir="s" state="M"/>
</net>"""


def driven(network, names, positions_m):
    lanes = np.array([network.lane_ids.index(name) for name in names])
    return lane_pieces(network, LaneLog(lanes, np.array(positions_m, dtype=float), np.full(len(lanes), 9.0)))[0]


@pytest.mark.parametrize("names", [
    ("a_1", ":J_1_1", ":J_1_0", "b_0"),
    ("a_1", ":J_1_1", "b_0", "b_0"),  # the change falls between two steps
    ("a_1", "b_0", "b_0", "b_0"),
])  # fmt: skip
def test_a_lane_may_be_changed_inside_a_junction(tmp_path, names):
    file = tmp_path / "two.net.xml"
    file.write_text(TWO_LANES)
    network = read_network(file)
    pieces = driven(network, names, [90.0, 5.0, 12.0, 15.0])
    assert [piece.side_step for piece in pieces].count(True) == 1
    assert network.lane_ids[pieces[-1].lane] == "b_0"
    assert (network.left_lane[network.is_internal] == -1).all()  # what the matching sees has no such neighbours


def town(folder, nodes, edges, *options):
    """A town made by netconvert of plain XML."""
    (folder / "a.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "a.edg.xml").write_text(f"<edges>{edges}</edges>")
    net_file = folder / "a.net.xml"
    run_tool("netconvert", f"-n={folder}/a.nod.xml", f"-e={folder}/a.edg.xml", f"-o={net_file}", "--no-warnings", *options)
    return read_town(net_file)


def length_m(drive):
    return np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum()


@pytest.mark.parametrize("vehicles", [0, 20])
def test_the_ego_gets_its_place_on_a_road_that_is_full(tmp_path, vehicles):
    """SUMO forgets a vehicle that finds no room for five seconds; the ego was waited for in vain then."""
    nodes = '<node id="A" x="0" y="0"/><node id="B" x="250" y="0"/>'
    edges = '<edge id="ab" from="A" to="B" speed="14"/><edge id="ba" from="B" to="A" speed="14"/>'
    one_road = town(tmp_path, nodes, edges)
    for seed in range(3):
        drive = simulate_drive(one_road, TourSpec(length_m=600), TrafficSpec(vehicles=vehicles), EgoSpec(), seed)
        assert length_m(drive) == pytest.approx(600, abs=15)


SQUARE = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, x, y in (
    ("A", 0, 0), ("B", 120, 0), ("C", 120, 120), ("D", 0, 120)))  # fmt: skip


def test_nobody_meets_the_ego_on_a_lane_for_both_ways(tmp_path):
    ways = "".join(
        f'<edge id="{a}{b}" from="{a}" to="{b}" speed="9"/>' for a, b in ("BC", "CB", "CD", "DC", "DA", "AD", "BD", "DB")
    )
    lane = "".join(f'<edge id="{a}{b}" from="{a}" to="{b}" speed="9" spreadType="center"/>' for a, b in ("AB", "BA"))
    square = town(tmp_path, SQUARE, ways + lane, "--edges.join-tram-dist=-1", "--geometry.remove=false")
    text = square.net_file.read_text()
    for one, other in ("AB", "BA"), ("BA", "AB"):
        text = text.replace(f'<edge id="{one}"', f'<edge id="{one}" bidi="{other}"')
    square.net_file.write_text(text)
    square = read_town(square.net_file)
    assert any("AB and BA share one lane" in note for note in square.notes)
    for seed in range(3):
        drive = simulate_drive(square, TourSpec(length_m=1500), TrafficSpec(vehicles=8), EgoSpec(), seed)
        assert length_m(drive) == pytest.approx(1500, abs=20)
        assert len(drive.traffic.poses_m) > 0
    names = [square.network.edge_ids[edge] for edge in np.concatenate(edge_links(square.network)).tolist()]
    turns = set(zip(names[: len(names) // 2], names[len(names) // 2 :], strict=True))
    assert ("CB", "BC") in turns and ("AB", "BA") not in turns  # SUMO's ego would wait for itself


def test_roads_that_the_network_calls_connectors_are_driven_to_the_end(tmp_path):
    """SUMO strips them from the ends of a route, and the ego left the road there."""
    ways = "".join(f'<edge id="{a}{b}" from="{a}" to="{b}" speed="9"/>' for a, b in ("AB", "BC", "CD", "DA"))
    net_file = town(tmp_path, SQUARE, ways).net_file
    net_file.write_text(re.sub('<edge id="(AB|CD)"', r'<edge id="\1" function="connector"', net_file.read_text()))
    square = read_town(net_file)
    for seed in range(3):
        drive = simulate_drive(square, TourSpec(length_m=400), TrafficSpec(vehicles=2), EgoSpec(), seed)
        assert length_m(drive) == pytest.approx(400, abs=15)


def test_a_tour_goes_on_where_lanes_are_counted_shorter_than_drawn(tmp_path):
    """SUMO's ego reached the end of its route after half the way and the drive ended without a word."""
    ways = "".join(f'<edge id="{a}{b}" from="{a}" to="{b}" speed="9" length="50"/>' for a, b in ("AB", "BC", "CD", "DA"))
    square = town(tmp_path, SQUARE, ways)
    drive = simulate_drive(square, TourSpec(length_m=1500), TrafficSpec(vehicles=2), EgoSpec(), 1)
    assert length_m(drive) == pytest.approx(1500, rel=0.05)  # lanes inside junctions are counted as drawn
