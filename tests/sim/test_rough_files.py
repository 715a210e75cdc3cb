"""A network in every dress that a file may have, encodings, packings, names, versions: it is read, or refused with reason."""

import gzip
import re

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.map_import import import_map
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import TownSpec, build_town
from tests.sim.test_map_import import BLOCK

GEODETIC = '<location netOffset="-123456789012.00,-5400000000.00" convBoundary="0,0,180,180" origBoundary="13,52,13.1,52.1" ' \
           'projParameter="+proj=utm +zone=33 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"/>'  # fmt: skip
READ = {  # the same 24 edges of four blocks, whatever they are called
    "as it is": lambda text: text.encode(),
    "byte order mark": lambda text: ("\ufeff" + text).encode(),
    "lines of Windows": lambda text: text.replace("\n", "\r\n").encode(),
    "UTF-16": lambda text: text.replace("UTF-8", "UTF-16").encode("utf-16"),
    "Latin-1": lambda text: text.replace("UTF-8", "ISO-8859-1").replace("A0A1", "Straße").encode("latin-1"),
    "packed, and not named so": lambda text: gzip.compress(text.encode()),
    "Chinese, and a taxi": lambda text: text.replace("A0A1", "东京路").replace("B1B2", "🚕").encode(),
    "dots and colons": lambda text: text.replace("A0A1", "-a.b/c#1-2").replace("C1C2", "x:y").encode(),
    "of a later version": lambda text: re.sub(r'<net version="[^"]*"', '<net version="9.99"', text).encode(),
    "no location": lambda text: re.sub(r"<location [^>]*/>", "", text).encode(),
    "far from its projection": lambda text: re.sub(r"<location [^>]*/>", GEODETIC, text).encode(),
    "phases of no time": lambda text: re.sub(r'(<phase duration=")[^"]*', r"\g<1>0", text).encode(),
    "a dead end with traffic": lambda text: re.sub(r'(<junction id="B1" type=")[^"]*', r"\1dead_end", text).encode(),
    "a long comment": lambda text: text.replace("<location", f"<!--{'x' * 2_000_000}--><location").encode(),
    "an unknown class": lambda text: text.replace('<lane id="A0A1_0"', '<lane id="A0A1_0" disallow="hoverboard"').encode(),
}
REFUSED = {
    "no speed": (r'(id="A0A1_0"[^>]*speed=")[^"]*', r"\g<1>0", "'A0A1_0' has a speed limit of 0"),
    "a metre": (r'(id="A0A1_0"[^>]*length=")[^"]*', r"\g<1>1", "'A0A1_0' is drawn 8[0-9] m long and said to be 1 m"),
    "trains": (r'(<lane id="[A-C][^"]*")', r'\1 allow="rail tram"', "no lane is open to passenger cars"),
    "a word for its version": (r'<net version="[^"]*"', '<net version="next"', "not a consistent SUMO network"),
    "no such projection": (r'projParameter="[^"]*"', 'projParameter="+proj=nonsense"', "unknown projection id.*netedit"),
    "no such junction": (r'(id="B1" type=")[^"]*', r"\1hovercraft", "junction 'B1' is not a valid node type.*netedit"),
}


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    path = tmp_path_factory.mktemp("grid") / "grid.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=3", "--grid.length=90", "--tls.guess", "-o", str(path))
    return path.read_text()


@pytest.mark.parametrize("dress", READ)
@pytest.mark.parametrize("name", ["town.net.xml", "town.net.xml.gz"])
def test_a_network_in_any_dress_is_read(tmp_path, grid, dress, name):
    if name.endswith(".gz") and dress != "as it is":
        return  # that a plain one may be called so is told once
    (tmp_path / name).write_bytes(READ[dress](grid))
    town = build_town(TownSpec(network=tmp_path / name), 1, tmp_path)
    assert sum(not edge.startswith(":") for edge in town.network.edge_ids) == 24


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_driven_is_refused_with_its_place(tmp_path, grid, kind):
    pattern, wrong, said = REFUSED[kind]
    (tmp_path / "town.net.xml").write_text(re.sub(pattern, wrong, grid))
    with pytest.raises(HippodromeError, match=said) as refused:
        build_town(TownSpec(network=tmp_path / "town.net.xml"), 1, tmp_path)
    assert str(tmp_path) in str(refused.value) and "\n" not in str(refused.value)


def test_a_map_whose_roads_have_no_speed_says_so(tmp_path):
    (tmp_path / "still.osm").write_text(BLOCK.replace('k="highway"', 'k="maxspeed" v="0"/><tag k="highway"'))
    with pytest.raises(HippodromeError, match=r"because it has speed 0.*correct maxspeed"):
        import_map(tmp_path / "still.osm", tmp_path / "made.net.xml.gz")
