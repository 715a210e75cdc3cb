"""What people write after --from: each is a town, a map, or a sentence that says what to do."""

import gzip

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.draft import new_scenario
from hippodrome.eval.authoring.sources import KINDS, require_source, unknown_kind
from hippodrome.sim.map_import import import_map


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("Karlsruhe", "nor a file; for a place's map, download the area"),
        ("Karlsruhe, Germany", "for a place's map, download the area"),
        ("", "a folder; it holds no map"),
        ("49.00,8.38,49.02,8.42", "degrees alone are no map: download the area .*--around takes a circle out of it"),
        ("geo:49.00,8.38", "degrees alone are no map"),
        ("https://example.org/town.osm.pbf", "an address, and nothing is downloaded; fetch the file"),
        ("gird", "did you mean grid?"),
        ("Grid", "did you mean grid?"),
        ("maps", "a folder; name a map in it: town.osm"),
        ("maps/", "a folder; name a map in it: town.osm"),
        ("none", "a folder; it holds no map"),
        ("maps/twn.net.xml", "neither a kind of town"),
        ("maps/town.osn", "did you mean maps/town.osm?"),
        ("nowhere/town.net.xml", "neither a kind of town"),
    ],
)
def test_what_is_no_source_is_told_with_what_to_do(tmp_path, monkeypatch, source, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    (tmp_path / "none").mkdir()
    (tmp_path / "maps/town.osm").write_text("<osm/>")
    with pytest.raises(HippodromeError, match=words) as caught:
        new_scenario("a", source, tmp_path / "a.yaml")
    assert str(caught.value).startswith(f"--from {source}: ")
    assert [one.name for one in tmp_path.iterdir()].count("a.yaml") == 0


def test_kinds_files_and_packages_are_left_to_their_readers(tmp_path):
    (tmp_path / "a b.net.xml").write_text("<net/>")
    for source in (*KINDS, str(tmp_path / "a b.net.xml"), str(tmp_path / "lost.osm"), "package:sumo/lost.net.xml"):
        require_source(source)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"<net version='1'/>", "it begins as a .net.xml does: name it so"),
        (gzip.compress(b"<!-- a comment --><osm/>", mtime=0), "it begins as a .osm does: name it so"),
        (b"<OpenDRIVE/>", "it begins as a .xodr does: name it so"),
        (b"<kml/>", "osm.pbf, .pbf, .xodr, .xodr.gz$"),
        (b"", ".xodr.gz$"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><a/>", ".xodr.gz$"),
    ],
)
def test_a_map_of_another_name_says_of_which_kind_it_is(tmp_path, content, words):
    (tmp_path / "town.xml").write_bytes(content)
    with pytest.raises(HippodromeError, match=f"town.xml: unknown kind of map; there are .net.xml, .*{words}"):
        raise unknown_kind("town.xml", tmp_path / "town.xml")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.osm", b"", "it is empty; fetch it again"),
        ("a.osm.gz", gzip.compress(b" \n", mtime=0), "it is empty"),
        (
            "a.osm",
            b"<html><body>Too many requests</body></html>",
            "begins with <html>, .*that is a web page",
        ),
        ("a.osm", b'{"elements": []}', "it is JSON, and OpenStreetMap is XML here; ask for XML"),
        ("a.osm", b"\x50\x4b\x03\x04", "it has no XML element; is it whole?"),
        ("a.osm", b"<net/>", "it begins with <net>, and OpenStreetMap with <osm>; give it the name of its kind"),
        ("a.xodr", b"<osm/>", "it begins with <osm>, and OpenDRIVE with <OpenDRIVE>"),
        ("a.xodr.gz", b"", "it is empty"),
        ("a.osm.gz", gzip.compress(b"<osm/>" * 1000, mtime=0)[:40], "cannot be read: Compressed file ended"),
    ],
)
def test_what_is_no_map_in_spite_of_its_name_is_told(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(HippodromeError, match=words) as caught:
        import_map(tmp_path / name, tmp_path / "made.net.xml.gz")
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert [one.name for one in tmp_path.iterdir()] == [name]
