"""Broken network files: refused in one line with place and cure, and nothing that kills SUMO is handed to it in this process."""

import gzip
import re

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim import net_file as net_files
from hippodrome.sim import sumo_tools
from hippodrome.sim.net_file import load_net
from hippodrome.sim.network import read_network
from hippodrome.sim.sumo_tools import check_that_sumo_reads, run_tool
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec


@pytest.fixture(scope="module")
def crossing(tmp_path_factory):
    """A small network with crossings that SUMO gives internal junctions."""
    file = tmp_path_factory.mktemp("net") / "crossing.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=3", "--grid.length=100", f"--output-file={file}", "--no-warnings")
    return re.sub(r"<!--.*?-->", "", file.read_text(), flags=re.DOTALL)


def written(folder, text):
    file = folder / "broken.net.xml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(("pattern", "put", "reason"), [
    (r'(<junction id="B1"[^>]*?) x="[^"]*"', r'\1 x="1e308"', r"junction 'B1' lies at \(1e\+308, 100\) m"),
    (r'(<junction id="B1"[^>]*?) y="[^"]*"', r'\1 y="nan"', r"junction 'B1' lies at \(100, nan\) m"),
    (r'<junction id="B1".*?</junction>', "", "meet at junction 'B1', which the file does not describe"),
    (r'(<edge id="A0A1") from="A0"', r'\1 from="elsewhere"', "meet at junction 'elsewhere'"),
    (r'(<edge id="A0A1") from="A0"', r"\1", "edge 'A0A1' does not say between which junctions it lies"),
    (r'(<lane id="A0A1_0"[^>]*?) speed="[^"]*"', r'\1 speed="nan"', "lane 'A0A1_0' has a speed limit of nan m/s"),
    (r'(<lane id="A0A1_0"[^>]*?) speed="[^"]*"', r'\1 speed="-5"', "lane 'A0A1_0' has a speed limit of -5 m/s"),
    (r'(<lane id="A0A1_0"[^>]*?) speed="[^"]*"', r'\1 speed="0"', "lane 'A0A1_0' has a speed limit of 0 m/s"),
    (r'(<lane id="A0A1_0")', r'\1 width="-3"', "lane 'A0A1_0' has a width of -3 m"),
    (r'(<lane id="A0A1_0")', r'\1 width="inf"', "lane 'A0A1_0' has a width of inf m"),
    (r'(<lane id="A0A1_0"[^>]*?) length="[^"]*"', r'\1 length="-9"', "lane 'A0A1_0' has a length of -9 m"),
    (r'(<lane id="A0A1_0"[^>]*?) shape="[^"]*"', r'\1 shape="0,0 1e300,5"', "lane 'A0A1_0' has a shape that goes farther"),
])  # fmt: skip
def test_what_nobody_can_drive_on_is_refused_with_its_place(tmp_path, crossing, pattern, put, reason):
    changed, count = re.subn(pattern, put, crossing, count=1, flags=re.DOTALL)
    assert count == 1
    with pytest.raises(HippodromeError, match=rf"broken\.net\.xml: not a consistent SUMO network \(.*{reason}"):
        load_net(written(tmp_path, changed))


def test_a_network_that_crashes_sumo_is_refused(tmp_path, crossing):
    """Without the connection out of an internal junction SUMO dies of a signal, and a simulation in this process would too."""
    changed, count = re.subn(r'<connection from=":B1_3"[^>]*via="[^>]*/>', "", crossing, count=1)
    assert count == 1
    file = written(tmp_path, changed)
    with pytest.raises(HippodromeError, match=r"SUMO cannot drive on it: sumo (crashed|failed).*netconvert -s broken\.net"):
        build_town(TownSpec(network=file), 1, tmp_path)


def test_a_network_that_crashes_sumo_when_a_car_comes_is_refused(tmp_path, crossing):
    changed, count = re.subn(r'<junction id=":B1_\d+_0" type="internal".*?/>', "", crossing, count=1)
    assert count == 1
    file = written(tmp_path, changed)
    with pytest.raises(HippodromeError, match=r"junction ':B1_\d+_0', where cars wait inside a crossing, is not described"):
        build_town(TownSpec(network=file), 1, tmp_path)
    assert read_network(file).lane_count > 0


def test_what_sumo_complains_of_is_told(tmp_path, crossing):
    changed, count = re.subn(r'(<junction id="B1") type="[^"]*"', r'\1 type="odd"', crossing, count=1)
    assert count == 1
    with pytest.raises(HippodromeError, match=r"SUMO cannot drive on it: sumo failed \(1\): Error: "):
        check_that_sumo_reads(written(tmp_path, changed))


def test_a_root_without_a_version_is_read(tmp_path, crossing):
    changed, count = re.subn(r'<net version="[^"]*"', "<net", crossing)
    assert count == 1
    assert len(load_net(written(tmp_path, changed)).getEdges()) > 20


def test_entities_are_refused_before_they_are_expanded(tmp_path):
    lines = "".join(f"<!ENTITY a{i + 1} '{10 * f'&a{i};'}'>" for i in range(9))
    file = written(tmp_path, f"<!DOCTYPE net [<!ENTITY a0 'lol'>{lines}]><net version='1.20' x='&a9;'/>")
    with pytest.raises(HippodromeError, match=r"declares XML entities .*take the DOCTYPE out"):
        load_net(file)


def test_a_packed_bomb_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(net_files, "MAX_NET_BYTES", 1 << 20)
    file = tmp_path / "bomb.net.xml.gz"
    file.write_bytes(gzip.compress(b'<net version="1.20">' + b" " * (3 << 20) + b"</net>"))
    with pytest.raises(HippodromeError, match="more than 1 MiB unpacked; cut out a smaller area"):
        load_net(file)


def test_a_program_that_wants_too_much_memory_or_time_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(sumo_tools, "TOOL_BYTES", 64 << 20)
    with pytest.raises(HippodromeError, match=r"netgenerate (failed|crashed)"):
        run_tool("netgenerate", "--grid", "--grid.number=60", f"--output-file={tmp_path}/a.net.xml")
    monkeypatch.setattr(sumo_tools, "TOOL_BYTES", 1 << 30)
    monkeypatch.setattr(sumo_tools, "TOOL_TIMEOUT_S", 0.2)
    with pytest.raises(HippodromeError, match="netgenerate: no answer within 0 s"):
        run_tool("netgenerate", "--grid", "--grid.number=200", f"--output-file={tmp_path}/a.net.xml")
