import gzip
import re
from pathlib import Path

import numpy as np
import pytest
import sumo
import sumolib

from hippodrome.core.types import HippodromeError
from hippodrome.sim.net_file import is_left_hand, load_net
from hippodrome.sim.net_notes import check_network
from hippodrome.sim.network import (
    drivable_edges,
    edge_lengths_m,
    edge_links,
    junction_gaps,
    junction_lengths_m,
    read_network,
    road_network,
)

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"

# Two edges a -> b joined by a two-piece internal lane chain, b leads back to a; c is a dead end; lane a_1 is for buses only.
TINY = """<net version="1.20"{lefthand}>
<edge id=":B_0" function="internal"><lane id=":B_0_0" index="0" speed="5" length="2" shape="100,0 102,0"/></edge>
<edge id=":B_1" function="internal"><lane id=":B_1_0" index="0" speed="5" length="2" shape="102,0 104,0"/></edge>
<edge id=":A_0" function="internal"><lane id=":A_0_0" index="0" speed="5" length="0.1" shape="0,0 0,0"/></edge>
<edge id="a" from="A" to="B" priority="1">
<lane id="a_0" index="0" speed="10" length="100" width="3" shape="0,0 50,0 50,0 100,0"/>
<lane id="a_1" index="1" speed="10" length="100" allow="bus" shape="0,3 100,3"/>
<lane id="a_2" index="2" speed="10" length="100" shape="0,6 100,6"/>
<lane id="a_3" index="3" speed="10" length="100" shape="0,9 100,9"/></edge>
<edge id="b" from="B" to="A" priority="1"><lane id="b_0" index="0" speed="10" length="150" shape="104,0 104,50 0,50 0,0"/></edge>
<edge id="c" from="B" to="C" priority="1"><lane id="c_0" index="0" speed="10" length="30" shape="104,0 134,0"/></edge>
<junction id="A" type="priority" x="0" y="0" incLanes="b_0" intLanes=":A_0_0" shape=""/>
<junction id="B" type="priority" x="102" y="0" incLanes="a_0" intLanes=":B_0_0" shape=""/>
<junction id="C" type="dead_end" x="134" y="0" incLanes="c_0" intLanes="" shape=""/>
<junction id="C2" type="dead_end" x="134.3" y="0" incLanes="" intLanes="" shape=""/>
<connection from="a" to="b" fromLane="0" toLane="0" via=":B_0_0" dir="s" state="M"/>
<connection from="a" to="c" fromLane="2" toLane="0" dir="s" state="M"/>
<connection from="b" to="a" fromLane="0" toLane="0" via=":A_0_0" dir="s" state="M"/>
<connection from=":B_0" to="b" fromLane="0" toLane="0" via=":B_1_0" dir="s" state="M"/>
<connection from=":B_1" to="b" fromLane="0" toLane="0" dir="s" state="M"/>
<connection from=":A_0" to="a" fromLane="0" toLane="0" dir="s" state="M"/>
</net>"""


PLAIN = TINY.format(lefthand="")


@pytest.fixture
def tiny_file(tmp_path):
    file = tmp_path / "tiny.net.xml"
    file.write_text(PLAIN)
    return file


def lane_names(network, lanes):
    return [network.lane_ids[lane] if lane >= 0 else None for lane in lanes]


def test_chains_of_internal_lanes_neighbours_and_repeated_points(tiny_file):
    network = read_network(tiny_file)
    number = {name: i for i, name in enumerate(network.lane_ids)}
    assert "a_1" not in number  # buses only
    for lane, after in {"a_0": ":B_0_0", ":B_0_0": ":B_1_0", ":B_1_0": "b_0", "a_2": "c_0", "b_0": ":A_0_0"}.items():
        assert lane_names(network, network.successors(number[lane])) == [after]
    assert len(network.successors(number["c_0"])) == 0
    np.testing.assert_array_equal(network.lane_points_m(number["a_0"]), [[0, 0], [50, 0], [100, 0]])
    assert lane_names(network, network.left_lane)[number["a_2"]] == "a_3"
    assert lane_names(network, network.right_lane)[number["a_2"]] is None  # the bus lane is none of ours
    assert network.width_m[number["a_0"]] == 3.0 and network.width_m[number["a_2"]] == 3.2


def test_left_hand_networks_swap_neighbours(tmp_path):
    file = tmp_path / "left.net.xml"
    file.write_text(TINY.format(lefthand=' lefthand="1"'))
    network = read_network(file)
    assert is_left_hand(file)
    assert lane_names(network, network.right_lane)[network.lane_ids.index("a_2")] == "a_3"


def test_zero_length_lane_gets_a_heading_from_its_predecessor(tiny_file):
    network = read_network(tiny_file)
    points = network.lane_points_m(network.lane_ids.index(":A_0_0"))
    np.testing.assert_allclose(np.diff(points, axis=0), [[0.0, -0.01]], atol=1e-9)  # b arrives southwards


def test_links_lengths_and_drivable_part(tiny_file):
    network = read_network(tiny_file)
    a, b, c = (network.edge_ids.index(name) for name in "abc")
    assert set(zip(*edge_links(network), strict=True)) == {(a, b), (a, c), (b, a)}
    assert set(drivable_edges(network)) == {a, b}
    assert edge_lengths_m(network)[[a, b, c]] == pytest.approx([100.0, 50.0 + 104.0 + 50.0, 30.0])
    assert junction_lengths_m(network)[a] == pytest.approx(4.0 / 3.0)  # 4 m behind one of its three lanes


def test_notes_name_what_is_odd(tiny_file):
    net = load_net(tiny_file)
    notes = " | ".join(check_network(net, road_network(net, tiny_file), tiny_file))
    assert "1 of 3 edges" in notes and "instance c" in notes
    assert "zero-length" in notes and ":A_0_0" in notes
    assert "coincide" not in notes  # C2 has no roads


def test_no_loop_is_an_error(tmp_path):
    file = tmp_path / "open.net.xml"
    file.write_text(PLAIN.replace('from=":A_0" to="a"', 'from=":A_0" to="c"'))
    net = load_net(file)
    with pytest.raises(HippodromeError, match=r"open\.net\.xml: no closed loop"):
        check_network(net, road_network(net, file), file)


def test_networks_without_roads_for_cars_are_rejected(tmp_path, tiny_file):
    file = tmp_path / "bus.net.xml"
    file.write_text(tiny_file.read_text().replace('speed="10"', 'allow="bus" speed="10"').replace('allow="bus" shape', "shape"))
    with pytest.raises(HippodromeError, match="no lane is open to passenger cars"):
        read_network(file)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "no <net> element"),
        (b"<osm version='0.6'></osm>", "netconvert"),
        (b"not xml at all", "no <net> element"),
        (PLAIN[:1500].encode(), "broken network"),
        (PLAIN.replace('to="b" fromLane', 'to="nowhere" fromLane').encode(), "not a consistent SUMO network"),
        (PLAIN.replace('shape="104,0 134,0"', 'shape="104,x 134,0"').encode(), "not a consistent SUMO network"),
        (gzip.compress(PLAIN.encode(), mtime=0)[:-40], ""),
        (b"\x1f\x8b garbage", "unreadable"),
    ],
)
def test_bad_files_are_one_clear_line(tmp_path, content, reason):
    file = tmp_path / "bad.net.xml"
    file.write_bytes(content)
    with pytest.raises(HippodromeError, match=r"bad\.net\.xml") as caught:
        read_network(file)
    assert reason in str(caught.value) and "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(HippodromeError, match="no such network file"):
        read_network(tmp_path / "none.net.xml")


def test_gzip_is_read_like_plain(tmp_path, tiny_file):
    packed = tmp_path / "tiny.net.xml.gz"
    packed.write_bytes(gzip.compress(tiny_file.read_bytes()))
    assert read_network(packed).lane_ids == read_network(tiny_file).lane_ids


@pytest.mark.parametrize("name", ["bs3d/bs.net.xml", "fkk_in/ingolstadt.net.xml.gz"])
def test_real_networks_join_up(name):
    """Each lane begins where the lanes that lead to it end, and sumolib's own search finds the same next edges."""
    network = read_network(GAMES / name)
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.successor_start))
    ends = network.points_m[network.point_start[1:] - 1][owner]
    begins = network.points_m[network.point_start[:-1]][network.successor]
    assert np.linalg.norm(ends - begins, axis=1).max() < 0.5
    net = sumolib.net.readNet(str(GAMES / name))
    cars = {e.getID(): e for e in net.getEdges() if e.allows("passenger")}
    expected = {
        (e.getID(), link.getTo().getID())
        for e in cars.values()
        for links in e.getOutgoing().values()
        for link in links
        if link.allows("passenger") and link.getFromLane().allows("passenger") and link.getToLane().allows("passenger")
    }
    found = {(network.edge_ids[a], network.edge_ids[b]) for a, b in zip(*edge_links(network), strict=True)}
    assert found == expected


@pytest.mark.parametrize(
    "root", ['<net\n  version="1.20"', "<!-- " + 9000 * "an option of netconvert " + '--><net version="1.20"']
)
def test_the_root_is_found_wherever_xml_allows_it(tmp_path, root):
    file = tmp_path / "town.net.xml"
    file.write_text(PLAIN.replace('<net version="1.20"', root))
    assert read_network(file).lane_count == read_network(_written(tmp_path, PLAIN)).lane_count
    assert not is_left_hand(file)


@pytest.mark.parametrize(("value", "left"), [
    ("true", True), ("True", True), ("YES", True), ("on", True), ("x", True), ("T", True), ("1", True),
    ("false", False), ("0", False), ("no", False), ("", False),
])  # fmt: skip
def test_the_driving_side_is_read_as_sumo_reads_booleans(tmp_path, value, left):
    assert is_left_hand(_written(tmp_path, TINY.format(lefthand=f' lefthand="{value}"'))) == left


def test_a_traffic_light_that_begins_its_cycle_at_the_start_is_read(tmp_path):
    light = '<tlLogic id="B" type="static" programID="0" offset="begin"><phase duration="30" state="GG"/></tlLogic></net>'
    assert read_network(_written(tmp_path, PLAIN.replace("</net>", light))).lane_count > 0


def test_a_connector_is_a_road(tmp_path):
    text = PLAIN.replace('<edge id="b" from', '<edge id="b" function="connector" from')
    assert read_network(_written(tmp_path, text)).edge_ids == read_network(_written(tmp_path, PLAIN)).edge_ids


def test_a_network_without_lanes_inside_junctions_names_the_cure(tmp_path):
    text = re.sub(r"<edge id=.:.*?</edge>\n|<connection from=.:.*?/>\n| via=.[^ ]*", "", PLAIN)
    file = _written(tmp_path, text)
    (note,) = junction_gaps(read_network(file), file)
    assert "netconvert --no-internal-links=false -s written.net.xml" in note
    assert note in check_network(load_net(file), read_network(file), file)
    file = _written(tmp_path, PLAIN)
    assert junction_gaps(read_network(file), file) == ()


def _written(folder, text):
    file = folder / "written.net.xml"
    file.write_text(text)
    return file
