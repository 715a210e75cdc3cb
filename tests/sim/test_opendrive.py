"""OpenDRIVE's curves as netconvert can take them, and what is wrong with a map said of the user's file."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim import map_import
from hippodrome.sim.map_import import import_map, sumo_network
from hippodrome.sim.network import read_network
from hippodrome.sim.opendrive import with_arcs_for_arcs
from hippodrome.sim.sumo_tools import run_tool

OVAL = """<OpenDRIVE><header revMajor="1" revMinor="4"/><road name="oval" length="365.663706" id="1" junction="-1">
<link><predecessor elementType="road" elementId="1" contactPoint="end"/>
<successor elementType="road" elementId="1" contactPoint="start"/></link><planView>
<geometry s="0" x="0" y="0" hdg="0" length="120"><line/></geometry>
<geometry s="120" x="120" y="0" hdg="0" length="62.831853"><spiral curvStart="0.05" curvEnd="{end}"/></geometry>
<geometry s="182.831853" x="120" y="40" hdg="3.141593" length="120"><line/></geometry>
<geometry s="302.831853" x="0" y="40" hdg="3.141593" length="62.831853">
<spiral curvStart="0.05" curvEnd="{end}"></spiral></geometry>
</planView><lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving">
<link><predecessor id="-1"/><successor id="-1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"""


@pytest.mark.parametrize("quote", ['"', "'"])
@pytest.mark.parametrize("end", ["0.05", "0.05000000000000001"])
def test_a_spiral_that_is_an_arc_is_read_as_one(tmp_path, end, quote):
    """netconvert makes a straight of the one and runs out of memory on the other; the half circles have a radius of 20 m."""
    source = tmp_path / "oval.xodr"
    source.write_text(OVAL.format(end=end).replace('"', quote))
    net_file, notes = sumo_network(source, tmp_path)
    points = read_network(net_file).points_m
    assert "2 spiral(s) of constant curvature" in notes[0]
    assert np.ptp(points, axis=0) == pytest.approx([120 + 2 * 21.75, 2 * 21.75], abs=1.0)  # the lane lies 1.75 m to the right


def test_a_spiral_that_is_one_goes_to_netconvert_as_it_is(tmp_path):
    source = tmp_path / "map.xodr"
    source.write_text(OVAL.format(end="0.06"))
    assert with_arcs_for_arcs(source) == 0 and source.read_text() == OVAL.format(end="0.06")


def test_a_curve_that_netconvert_cannot_follow_finely_is_drawn_coarsely(tmp_path, monkeypatch):
    def refuses_fine_curves(name, *options, input_bytes=0):
        if any(option.startswith("--opendrive.curve-resolution") for option in options):
            raise HippodromeError("netconvert failed (1): Error: std::bad_alloc")
        run_tool(name, *options, input_bytes=input_bytes)

    monkeypatch.setattr(map_import, "run_tool", refuses_fine_curves)
    source = tmp_path / "oval.xodr"
    source.write_text(OVAL.format(end="0.05"))
    notes = import_map(source, tmp_path / "oval.net.xml.gz")
    assert any("drew them more coarsely" in note for note in notes)
    assert np.ptp(read_network(tmp_path / "oval.net.xml.gz").points_m, axis=0) == pytest.approx([163.5, 43.5], abs=1.0)


def test_a_map_that_fails_twice_says_the_first_reason_and_a_cure(tmp_path):
    source = tmp_path / "odd.xodr"
    source.write_text(OVAL.format(end="0.05").replace('x="120" y="40"', 'x="1,5" y="40"'))
    with pytest.raises(HippodromeError, match=r"odd\.xodr: cannot be imported: netconvert .*'x' in definition of .*correct this"):
        import_map(source, tmp_path / "odd.net.xml.gz")


def test_a_lane_without_a_number_is_said_of_the_users_file(tmp_path):
    source = tmp_path / "odd.xodr"
    source.write_text(OVAL.format(end="0.05").replace('<lane id="-1"', '<lane id="x"').replace("<road ", '<road rule="LHT" '))
    with pytest.raises(HippodromeError, match=r"odd\.xodr: not a consistent OpenDRIVE file .*write it again with the tool"):
        import_map(source, tmp_path / "odd.net.xml.gz")
