"""Countries that keep left: found in the map, said, and driven and drawn as such."""

import math
import re

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.check import check_scenario
from hippodrome.eval.authoring.draft import new_scenario
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.driving_side import opendrive_side, osm_side
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.keep_left_places import keeps_left_at
from hippodrome.sim.map_import import sumo_network
from hippodrome.sim.scene.lanes import Beside, beside, cut_lanes
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town, read_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

PARIS, BRISTOL, SINGAPORE = (48.85, 2.35), (51.45, -2.6), (1.35, 103.85)


def osm(ways, place=PARIS, relation=""):
    """Two streets from a roundabout of eight nodes, 1..8 anticlockwise, out to node 20 and 21; ``ways`` are its tags."""
    lat, lon = place
    places = {i + 1: (lat + 0.0002 * math.sin(i * math.pi / 4), lon + 0.0003 * math.cos(i * math.pi / 4)) for i in range(8)}
    places |= {20: (lat, lon + 0.002), 21: (lat + 0.002, lon)}
    nodes = "".join(f'<node id="{i}" version="1" lat="{a:.7f}" lon="{o:.7f}"/>' for i, (a, o) in places.items())
    return f'<osm version="0.6">{nodes}{"".join(ways)}{relation}</osm>'


def way(number, nodes, **tags):
    refs = "".join(f'<nd ref="{node}"/>' for node in nodes)
    words = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in {"highway": "residential", **tags}.items())
    return f'<way id="{number}" version="1">{refs}{words}</way>'


ANTICLOCKWISE, CLOCKWISE = (1, 2, 3, 4, 5, 6, 7, 8, 1), (1, 8, 7, 6, 5, 4, 3, 2, 1)
STREETS = [way(1, (1, 20)), way(2, (3, 21)), way(3, (20, 21))]


def side_of(folder, text, find=osm_side):
    file = folder / "map.osm"
    file.write_text(text)
    return find(file)


@pytest.mark.parametrize(("text", "side", "word"), [
    (osm([*STREETS, way(9, CLOCKWISE, junction="roundabout")]), "left", "clockwise"),
    (osm([*STREETS, way(9, ANTICLOCKWISE, junction="roundabout")]), "right", ""),
    (osm([*STREETS, way(9, ANTICLOCKWISE, junction="roundabout", oneway="-1")]), "left", "clockwise"),
    (osm([way(8, CLOCKWISE[:5], junction="roundabout"), way(9, CLOCKWISE[4:], junction="circular")]), "left", "2 of its 2"),
    (osm([*STREETS, way(9, ANTICLOCKWISE, junction="roundabout")], BRISTOL), "right", "anticlockwise"),  # said, for it is odd
    (osm([way(1, (1, 20), driving_side="left"), way(2, (20, 21))]), "left", "1 of its 2 roads are tagged"),
    (osm([*STREETS, way(4, (1, 3), driving_side="left"), way(9, ANTICLOCKWISE, junction="roundabout")]), "right", ""),
    (osm(STREETS, relation='<relation id="1"><tag k="driving_side" v="left"/></relation>'), "left", "boundary"),
    (osm(STREETS, BRISTOL), "left", "latitude 51.45, longitude -2.6"),
    (osm(STREETS, SINGAPORE), "left", "latitude 1.35"),
    (osm(STREETS), "right", ""),
    (osm([way(1, (1, 20), driving_side="right"), way(2, (20, 21))], BRISTOL), "right", "driving_side=right"),
    ("<osm><way>", "right", ""),
    ("no xml", "right", ""),
])  # fmt: skip
def test_the_side_is_found_in_openstreetmap(tmp_path, text, side, word):
    found = side_of(tmp_path, text)
    assert found.side == side
    assert word in found.reason and bool(word) == bool(found.reason)


def test_a_mini_roundabout_tells_its_direction(tmp_path):
    mini = '<node id="30" lat="48.85" lon="2.351"><tag k="highway" v="mini_roundabout"/><tag k="direction" v="clockwise"/></node>'
    assert side_of(tmp_path, osm(STREETS).replace('<node id="1"', f'{mini}<node id="1"')).side == "left"


@pytest.mark.parametrize("place", [
    (51.5, -0.1), (55.9, -3.2), (53.3, -6.3), (-31.9, 115.9), (-37.8, 145.0), (-36.8, 174.8), (35.7, 139.7), (43.06, 141.35),
    (28.6, 77.2), (13.0, 80.2), (6.9, 79.9), (13.75, 100.5), (3.1, 101.7), (-6.2, 106.8), (-33.9, 18.4), (-26.2, 28.0),
    (-1.3, 36.8), (0.3, 32.6), (35.2, 33.4), (35.9, 14.5), (18.0, -76.8), (24.9, 67.1), (31.5, 74.3), (27.7, 85.3), (22.3, 114.2),
])  # fmt: skip
def test_towns_that_keep_left(place):
    assert keeps_left_at(*place)


@pytest.mark.parametrize("place", [
    (48.9, 2.3), (50.95, 1.85), (50.73, 1.6), (49.5, 0.1), (49.64, -1.62), (64.1, -21.9), (62.0, -6.8), (36.9, 30.7),
    (34.0, 35.5),
    (37.6, 127.0), (35.1, 129.05), (43.1, 131.9), (25.0, 121.5), (22.54, 114.06), (31.2, 121.5), (29.65, 91.1), (16.8, 96.2),
    (11.6, 104.9), (18.0, 102.6), (14.6, 121.0), (10.3, 123.9), (34.5, 69.2), (31.6, 65.7), (9.0, 38.8), (2.0, 45.3),
    (-1.95, 30.1),
    (-3.4, 29.4), (-11.7, 27.5), (-8.8, 13.2), (-18.9, 47.5), (23.1, -82.4), (25.8, -80.2), (40.7, -74.0), (-22.3, 166.4),
])  # fmt: skip
def test_towns_that_keep_right(place):
    assert not keeps_left_at(*place)


def lanes_lie_left(town):
    """The share of pieces of lanes beside a piece of another lane in the opposite direction that have it on their right."""
    pieces = cut_lanes(town.network, np.zeros(2))
    pieces = pieces.select(~town.network.is_internal[pieces.lane])
    oncoming = [beside(pieces, town.network.is_internal, side)[0] == Beside.OPPOSITE for side in (1, -1)]
    assert (oncoming[0] | oncoming[1]).sum() > 20
    return oncoming[1].sum() / (oncoming[0].sum() + oncoming[1].sum())


def test_a_map_of_a_country_that_keeps_left_is_driven_on_the_left(tmp_path):
    source = tmp_path / "town.osm"
    source.write_text(osm([*STREETS, way(9, CLOCKWISE, junction="roundabout")]))
    town = build_town(TownSpec(network=source), 1, tmp_path)
    assert town.left_hand and lanes_lie_left(town) == 1.0
    assert any("traffic keeps left, for 1 of its 1 roundabouts are driven clockwise" in note for note in town.notes)
    drive = simulate_drive(town, TourSpec(length_m=500), TrafficSpec(vehicles=3), EgoSpec(), 1)
    assert np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum() > 490
    told = build_town(TownSpec(network=source, driving_side="right"), 1, tmp_path)
    assert not told.left_hand and lanes_lie_left(told) == 0.0


def test_new_says_the_side_and_takes_the_users_word(tmp_path):
    source = tmp_path / "town.osm"
    source.write_text(osm(STREETS, BRISTOL))
    notes = new_scenario("a", str(source), tmp_path / "a.yaml").notes
    assert any("keeps left" in note and "scenario new --driving-side right" in note for note in notes)
    new_scenario("b", str(source), tmp_path / "b.yaml", "right")
    sides = [build_town(read_scenario(tmp_path / f"{name}.yaml").town, 1, tmp_path).left_hand for name in "ab"]
    assert sides == [True, False]


def test_a_generated_town_keeps_left_on_request(tmp_path):
    new_scenario("left", "grid", tmp_path / "left.yaml", "left")
    assert check_scenario(tmp_path / "left.yaml").errors == ()
    assert read_scenario(tmp_path / "left.yaml").town.driving_side == "left"
    spec = TownSpec(kind="grid", width_m=190, height_m=190, road_km=1.3)
    right, left = (build_town(spec.model_copy(update={"driving_side": side}), 1, tmp_path) for side in ("auto", "left"))
    assert left.left_hand and lanes_lie_left(left) == 1.0 and lanes_lie_left(right) == 0.0
    lengths = [np.sort(town.network.lane_lengths_m()[~town.network.is_internal]) for town in (left, right)]
    np.testing.assert_allclose(*lengths, atol=2.0)


def test_a_network_that_keeps_the_other_side_is_refused(tmp_path):
    net_file = tmp_path / "right.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=3", f"--output-file={net_file}", "--no-warnings")
    with pytest.raises(HippodromeError, match=r"keeps right, town\.driving_side says left; leave the key out"):
        build_town(TownSpec(network=net_file, driving_side="left"), 1, tmp_path)


ROAD = """<OpenDRIVE><header revMajor="1" revMinor="7"/><road name="a" length="200" id="1" junction="-1" rule="LHT">
<planView><geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView><lanes><laneSection s="0"><left>
<lane id="2" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
<lane id="1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"""


def test_an_opendrive_road_that_keeps_left(tmp_path):
    """The lanes with positive numbers lie on the left and run along the road: two of 3 m; the one of 4 m comes back."""
    source = tmp_path / "road.xodr"
    source.write_text(ROAD)
    net_file, notes = sumo_network(source, tmp_path)
    town = read_town(net_file)
    assert town.left_hand and any("1 of its 1 roads have rule=LHT" in note for note in notes)
    roads = {network_lane: town.network.lane_points_m(i) for i, network_lane in enumerate(town.network.lane_ids)
             if not town.network.is_internal[i]}  # fmt: skip
    along = [points[0, 1] for points in roads.values() if points[-1, 0] > points[0, 0]]
    back = [points[0, 1] for points in roads.values() if points[-1, 0] < points[0, 0]]
    assert sorted(along) == pytest.approx([1.5, 4.5]) and back == pytest.approx([-2.0])


def test_opendrive_of_the_same_town_gives_it_back(tmp_path):
    """netconvert writes a town that keeps left as OpenDRIVE; read again, all lanes lie where they were."""
    spec = TownSpec(kind="grid", width_m=190, height_m=190, road_km=1.3, driving_side="left")
    town = build_town(spec, 1, tmp_path)
    source = tmp_path / "again.xodr"
    run_tool("netconvert", f"--sumo-net-file={town.net_file}", f"--opendrive-output={source}", "--opendrive-output.lefthand-left",
             "--no-warnings=true")  # fmt: skip
    source.write_text(re.sub("<road ", '<road rule="LHT" ', source.read_text()))
    assert opendrive_side(source).side == "left"
    again = read_town(sumo_network(source, tmp_path)[0])
    assert again.left_hand
    middles = [
        np.array([t.network.lane_points_m(i).mean(axis=0) for i in np.flatnonzero(~t.network.is_internal)]) for t in (town, again)
    ]
    middles = [points - points.min(axis=0) for points in middles]  # netconvert moves the origin
    gaps_m = np.linalg.norm(middles[0][:, None] - middles[1][None], axis=2).min(axis=1)
    assert len(middles[0]) == len(middles[1]) and np.median(gaps_m) < 1.0


def test_opendrive_of_both_rules_follows_most_roads(tmp_path):
    mixed = "<OpenDRIVE>" + 2 * '<road rule="RHT"/>' + '<road rule="LHT"/>' + "</OpenDRIVE>"
    found = side_of(tmp_path, mixed, opendrive_side)
    assert found.side == "right" and "2 of its 3 roads have no rule LHT" in found.reason
