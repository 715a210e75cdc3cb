"""Maps of other makers: read for real by netconvert and libosmium, of bounded size, with the user's file in each error."""

import gzip
import os

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.check import check_scenario
from hippodrome.eval.authoring.draft import draft_for, new_scenario
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.sim import map_import
from hippodrome.sim.map_import import import_map, sumo_network
from hippodrome.sim.netconvert_notes import netconvert_notes
from hippodrome.sim.network import read_network
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import build_town, read_town
from hippodrome.sim.town_spec import TownSpec

CORNERS = [(50.0, 8.0), (50.0, 8.004), (50.002, 8.004), (50.002, 8.0)]
NODES = "".join(f'<node id="{i}" version="1" lat="{lat}" lon="{lon}"/>' for i, (lat, lon) in enumerate(CORNERS, 1))
REFS = "".join(f'<nd ref="{i}"/>' for i in (1, 2, 3, 4, 1))
BLOCK = f"""<?xml version="1.0"?><osm version="0.6">{NODES}
<way id="1" version="1">{REFS}<tag k="highway" v="residential"/><tag k="maxspeed" v="30"/></way>
<way id="2" version="1"><nd ref="1"/><nd ref="3"/><tag k="highway" v="footway"/></way></osm>"""


def packed_block(folder, ending):
    """The same block of streets in one of the forms that OpenStreetMap is handed round in."""
    plain, packed = folder / "block.osm", folder / f"block{ending}"
    plain.write_text(BLOCK)
    if ending == ".osm.gz":
        packed.write_bytes(gzip.compress(plain.read_bytes()))
    elif ending in (".osm.pbf", ".osm.bz2"):
        osmium = pytest.importorskip("osmium")
        with osmium.SimpleWriter(str(packed)) as writer:
            for one in osmium.FileProcessor(str(plain)):
                writer.add(one)
    return packed


@pytest.mark.parametrize("ending", [".osm", ".osm.gz", ".osm.pbf", ".osm.bz2"])
def test_new_reads_openstreetmap_in_every_form(tmp_path, ending):
    path = tmp_path / "scenarios" / "block.yaml"
    path.parent.mkdir()
    draft = new_scenario("block", str(packed_block(tmp_path, ending)), path)
    assert 0.9 < draft.drivable_km < 1.1  # round a block of about 290 m by 220 m in one direction, for nobody turns round
    assert check_scenario(path).errors == ()
    assert {one.name for one in path.parent.iterdir()} == {"block.yaml", "block.net.xml.gz"}
    assert read_scenario(path).town.network == path.parent / "block.net.xml.gz"


def test_packed_or_not_is_told_by_the_bytes_and_letters_by_the_declaration(tmp_path):
    """Browsers unpack what they fetch and leave its name; old exports have Latin letters in bytes of their own."""
    street = BLOCK.replace('v="residential"/>', 'v="residential"/><tag k="name" v="Gr\xfcnstra\xdfe"/>')
    (tmp_path / "a.osm").write_text(BLOCK)
    (tmp_path / "b.osm.gz").write_text(BLOCK)
    (tmp_path / "c.osm").write_bytes(gzip.compress(BLOCK.encode()))
    (tmp_path / "d.osm").write_bytes(street.replace("?>", ' encoding="ISO-8859-1"?>', 1).encode("latin-1"))
    (tmp_path / "e.osm").write_bytes(b"\xef\xbb\xbf" + street.encode())
    made = [tmp_path / f"{letter}.net.xml.gz" for letter in "abcde"]
    for net_file in made:
        import_map(next(one for one in tmp_path.glob(f"{net_file.name[0]}.osm*")), net_file)
    assert made[0].read_bytes() == made[1].read_bytes() == made[2].read_bytes()
    for net_file in made[3:]:
        assert "Gr\xfcnstra\xdfe" in gzip.decompress(net_file.read_bytes()).decode()


def test_new_reads_opendrive(tmp_path):
    """A generated town written as OpenDRIVE by netconvert, and read again, is as long as it was."""
    town = build_town(TownSpec(kind="grid", width_m=190, height_m=190, road_km=1.3), 1, tmp_path)
    source = tmp_path / "town.xodr"
    run_tool("netconvert", f"--sumo-net-file={town.net_file}", f"--opendrive-output={source}", "--no-warnings=true")
    draft = new_scenario("again", str(source), tmp_path / "again.yaml")
    assert draft.drivable_km == pytest.approx(draft_for(town).drivable_km, rel=0.05)
    assert check_scenario(tmp_path / "again.yaml").errors == ()


def test_the_same_map_gives_the_same_bytes(tmp_path):
    source = packed_block(tmp_path, ".osm")
    made = [tmp_path / name for name in ("one.net.xml.gz", "two.net.xml.gz")]
    for net_file in made:
        import_map(source, net_file)
    assert made[0].read_bytes() == made[1].read_bytes()
    assert b"<!--" not in gzip.decompress(made[0].read_bytes()) and read_town(made[0]).network.lane_count > 0


def test_a_bomb_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(map_import, "MAX_UNPACKED_BYTES", 1 << 20)
    source = tmp_path / "bomb.osm.gz"
    source.write_bytes(gzip.compress(bytes(3 << 20)))
    country = tmp_path / "country.osm.pbf"
    country.write_bytes(bytes(2 << 20))
    with pytest.raises(HippodromeError, match=r"country\.osm\.pbf: more than 1 MiB"):
        import_map(country, tmp_path / "out.net.xml.gz")
    with pytest.raises(HippodromeError, match=r"bomb\.osm\.gz: more than 1 MiB; cut out a smaller area"):
        import_map(source, tmp_path / "out.net.xml.gz")


@pytest.mark.parametrize(("name", "content", "reason"), [
    ("a.osm", b"hello", "cannot be imported"),
    ("a.osm", b"<osm/>", "no roads"),
    ("a.osm.gz", b"hello", "cannot be imported"),
    ("a.osm.pbf", b"hello", "cannot be read"),
    ("a.xodr", b"<osm/>", "cannot be imported"),
    ("a.net.xml", b"hello", "not a SUMO network"),
    ("a.kml", b"hello", "unknown kind of map; there are .net.xml"),
    ("lost.osm", None, "no such file"),
])  # fmt: skip
def test_what_cannot_be_read_is_said_of_the_users_file(tmp_path, name, content, reason):
    if name.endswith(".pbf"):
        pytest.importorskip("osmium")
    source = tmp_path / name
    if content is not None:
        source.write_bytes(content)
    with pytest.raises(HippodromeError, match=reason) as refused:
        new_scenario("a", str(source), tmp_path / "out.yaml")
    assert str(source) in str(refused.value)
    assert [one.name for one in tmp_path.iterdir() if one != source] == []


def test_without_osmium_the_cure_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "osmium", None)
    with pytest.raises(HippodromeError, match=r"pip install 'hippodrome\[osm\]'"):
        import_map(packed_block(tmp_path, ".osm").rename(tmp_path / "a.osm.pbf"), tmp_path / "out.net.xml.gz")


def test_new_overwrites_no_network(tmp_path):
    source = packed_block(tmp_path, ".osm")
    (tmp_path / "b.net.xml.gz").write_text("mine")
    with pytest.raises(HippodromeError, match=r"b\.net\.xml\.gz: exists already"):
        new_scenario("b", str(source), tmp_path / "b.yaml")
    assert not (tmp_path / "b.yaml").exists()


@pytest.mark.parametrize("name", ["osm_bbox.osm.xml.gz", "BLOCK.OSM", "Block.Osm.Gz"])
def test_a_map_is_known_by_its_ending_in_any_case_of_letters(tmp_path, name):
    source = tmp_path / name
    source.write_bytes(gzip.compress(BLOCK.encode()) if name.lower().endswith("gz") else BLOCK.encode())
    net_file, _ = sumo_network(source, tmp_path / "made")
    assert read_network(net_file).lane_count > 0


def test_a_map_is_converted_once_and_told_by_its_content(tmp_path):
    source = packed_block(tmp_path, ".osm")
    first, _ = sumo_network(source, tmp_path / "made")
    first.write_bytes(b"marked")
    assert sumo_network(source, tmp_path / "made")[0].read_bytes() == b"marked"
    source.write_text(BLOCK.replace("residential", "primary"))
    assert sumo_network(source, tmp_path / "made")[0] != first
    assert sumo_network(first, tmp_path / "made") == (first, ())


def test_a_single_road_is_kept_and_said_to_join_no_other(tmp_path):
    """netconvert takes away roads without a junction, so nothing was left and "no lane is open to cars" was said."""
    source = tmp_path / "road.osm"
    source.write_text(BLOCK.replace(REFS, '<nd ref="1"/><nd ref="2"/>'))
    net_file, notes = sumo_network(source, tmp_path)
    assert read_network(net_file).lane_count >= 2
    assert any("no road of it joins another one" in note for note in notes)
    assert sumo_network(source, tmp_path)[1] == notes  # also when it was converted before


def test_a_map_without_roads_for_cars_says_that(tmp_path):
    source = tmp_path / "yard.osm"
    source.write_text(BLOCK.replace("residential", "service"))
    with pytest.raises(HippodromeError, match=r"yard\.osm: holds no roads for cars .*service roads.*larger extract"):
        import_map(source, tmp_path / "yard.net.xml.gz")


def test_what_netconvert_warns_of_is_told_once_for_each_kind(tmp_path):
    source = tmp_path / "bent.osm"
    lost = "".join(
        f'<way id="{i}" version="1"><nd ref="1"/><nd ref="99"/><tag k="highway" v="residential"/></way>' for i in (7, 8)
    )
    source.write_text(BLOCK.replace("</osm>", f"{lost}</osm>"))
    notes = import_map(source, tmp_path / "bent.net.xml.gz")
    assert any(note.startswith("netconvert: ") for note in notes) and len(notes) <= 6
    assert any("of this kind)" in note for note in notes)


def test_entities_are_refused(tmp_path):
    lines = "".join(f"<!ENTITY a{i + 1} '{10 * f'&a{i};'}'>" for i in range(9))
    source = tmp_path / "lol.osm"
    source.write_text(f"<!DOCTYPE osm [<!ENTITY a0 'lol'>{lines}]><osm x='&a9;'>&a9;</osm>")
    with pytest.raises(HippodromeError, match=r"lol\.osm: declares XML entities .*take the DOCTYPE out"):
        import_map(source, tmp_path / "lol.net.xml.gz")


def test_warnings_have_place_meaning_and_cure(tmp_path):
    made = tmp_path / "made.net.xml"
    made.write_text(
        '<net><lane id="a_0" index="0" shape="12.4,5.0 20,5"/><junction id="J" type="priority" x="7.0" y="8.6"/></net>'
    )
    log = [
        "Warning: Speed of turning connection 'a_0->b_0' reduced by 3.2.",
        "Warning: Speed of turning connection 'c_0->d_0' reduced by 4.2.",
        "Warning: Could not compute spiral geometry for edge 'a'.",
        "Warning: Something new about junction 'J'.",
        "Loading done.",
        *(f"Warning: Strange thing {'x' * i}" for i in range(4)),
    ]
    notes = netconvert_notes(log, made)
    assert notes[0].startswith(
        "netconvert: Could not compute spiral geometry for edge 'a' at (12, 5) m: a curve was drawn as a straight"
    )
    assert "reduced by 3.2 at (12, 5) m (2 of this kind): cars turn slowly there; nothing to do" in notes[1]
    assert "about junction 'J' at (7, 9) m: look there in netedit" in notes[2]
    assert len(notes) == 6 and notes[5].startswith("netconvert: 2 warnings of 2 more kinds")


@pytest.mark.parametrize(("warning", "meaning"), [
    ("Using default width for edge '2' as value 'x' could not be parsed", "the usual value was taken"),
    ("Ignoring changeLeft prohibition for 'a_1' to avoid dead-end", "lanes may be changed there"),
    ("Could not compute smooth shape for edge 'a'", "a bend is drawn with a corner"),
])  # fmt: skip
def test_nothing_is_called_left_out_that_is_there(tmp_path, warning, meaning):
    (note,) = netconvert_notes([f"Warning: {warning}."], tmp_path / "none.net.xml")
    assert meaning in note and "left out" not in note


def test_a_map_that_includes_another_file_says_which_and_what_to_do(tmp_path):
    source = tmp_path / "part.xodr"
    source.write_text('<OpenDRIVE><header revMajor="1" revMinor="8"/><include file="other.xml"/></OpenDRIVE>')
    with pytest.raises(HippodromeError, match=r"Cannot read file 'other\.xml'.*put what is in it in the place of the <include>"):
        import_map(source, tmp_path / "made.net.xml.gz")


def test_warnings_that_netconvert_only_counts_are_counted_with_their_kind(tmp_path):
    log = [*(f"Warning: Found angle of {a}.5 degrees at edge 'e{a}', segment 0." for a in (91, 92, 93)),
           "Warning: 25 total messages of type: Found angle of % degrees at edge '%', segment %."]  # fmt: skip
    (note,) = netconvert_notes(log, tmp_path / "none.net.xml")
    assert note.startswith("netconvert: Found angle of 91.5 degrees at edge 'e91', segment 0 (25 of this kind): cars slow down")


def test_a_comma_in_a_folder_and_capitals_in_a_name_do_no_harm(tmp_path):
    folder = tmp_path / "a,b c"
    folder.mkdir()
    new_scenario("town", str(packed_block(folder, ".osm")), folder / "town.yaml")
    assert check_scenario(folder / "town.yaml").errors == ()
    (folder / "TOWN.NET.XML").write_bytes(gzip.decompress((folder / "town.net.xml.gz").read_bytes()))
    new_scenario("again", str(folder / "TOWN.NET.XML"), folder / "again.yaml")
    assert check_scenario(folder / "again.yaml").errors == ()


def test_a_pipe_in_place_of_a_map_is_called_one(tmp_path):
    os.mkfifo(tmp_path / "a.osm")
    with pytest.raises(HippodromeError, match=r"a.osm: not a file, but a folder, a pipe or a device; give "):
        import_map(tmp_path / "a.osm", tmp_path / "a.net.xml.gz")
    with pytest.raises(HippodromeError, match=r"b.osm: no such file; give "):
        import_map(tmp_path / "b.osm", tmp_path / "b.net.xml.gz")
