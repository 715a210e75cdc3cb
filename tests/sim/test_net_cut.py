"""Circles cut out of large maps."""

from pathlib import Path

import numpy as np
import pytest
import sumo
from hypothesis import given
from hypothesis import strategies as st

from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.draft import new_scenario
from hippodrome.sim.georeference import read_georeference
from hippodrome.sim.map_import import import_map
from hippodrome.sim.net_cut import Around, cut_network, import_options, parse_around
from hippodrome.sim.network import read_network
from hippodrome.sim.sumo_tools import run_tool

BERLIN = Path(sumo.SUMO_HOME) / "tools" / "game" / "DRT" / "osm.net.xml"


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    net_file = tmp_path_factory.mktemp("grid") / "grid.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=12", "--grid.length=100", f"--output-file={net_file}")
    return net_file


def test_a_circle_keeps_its_metres_and_its_bytes(grid, tmp_path):
    one, two = tmp_path / "one.net.xml.gz", tmp_path / "two.net.xml.gz"
    cut_network(grid, one, parse_around("xy:600,500", 250.0))
    cut_network(grid, two, parse_around("xy:600,500", 250.0))
    assert one.read_bytes() == two.read_bytes()
    whole, part = read_network(grid), read_network(one)
    roads = part.points_m[np.repeat(~part.is_internal, np.diff(part.point_start))]
    assert np.linalg.norm(roads - [600.0, 500.0], axis=1).max() < 250.0 + 100.0  # an edge that reaches in is kept whole
    for place in [(600.0, 500.0), (600.0, 700.0), (450.0, 500.0)]:
        assert np.linalg.norm(roads - place, axis=1).min() < 60.0
    assert set(part.edge_ids) & set(whole.edge_ids) and part.lane_count < 0.4 * whole.lane_count


def test_a_place_on_earth_is_found_in_the_network(tmp_path):
    reference, network = read_georeference(BERLIN), read_network(BERLIN)
    middle_m = np.median(network.points_m, axis=0)
    lat, lon = reference.to_lat_lon(middle_m[None])[0]
    made = tmp_path / "part.net.xml.gz"
    cut_network(BERLIN, made, Around(lat, lon, 300.0, on_earth=True))
    part = read_network(made)
    assert np.linalg.norm(np.median(part.points_m, axis=0) - middle_m) < 150.0
    assert 0 < part.lane_count < 0.3 * network.lane_count


def test_a_scenario_is_written_for_the_circle(grid, tmp_path):
    path = tmp_path / "part.yaml"
    draft = new_scenario("part", str(grid), path, around=parse_around("xy:600,500", 250.0))
    assert 2.0 < draft.drivable_km < 20.0
    assert path.with_name("part.net.xml.gz").is_file() and "within 250 m around (600,500) m" in path.read_text().splitlines()[0]


def test_an_import_keeps_the_circle(tmp_path):
    rows, ways = [], []
    for i in range(6):
        for j in range(6):
            rows.append(f'<node id="{10 * i + j + 1}" lat="{50.0 + 0.002 * i}" lon="{8.0 + 0.003 * j}"/>')
        for ids in ([10 * i + j + 1 for j in range(6)], [10 * j + i + 1 for j in range(6)]):
            nodes = "".join(f'<nd ref="{n}"/>' for n in ids)
            ways.append(f'<way id="{len(ways) + 1}">{nodes}<tag k="highway" v="residential"/></way>')
    osm = tmp_path / "map.osm"
    osm.write_text(f'<osm version="0.6">{"".join(rows)}{"".join(ways)}</osm>')
    made, part = tmp_path / "all.net.xml.gz", tmp_path / "part.net.xml.gz"
    import_map(osm, made)
    import_map(osm, part, more_options=import_options(parse_around("50.004,8.006", 300.0)))
    assert 0 < read_network(part).lane_count < read_network(made).lane_count


@pytest.mark.parametrize(
    ("middle", "radius_m", "words"),
    [("49", 10.0, "LAT,LON"), ("a,b", 10.0, "LAT,LON"), ("91,0", 10.0, "no such place"), ("nan,0", 10.0, "no such place"),
     ("49,6", 0.0, "--radius 0"), ("49,6", float("nan"), "--radius"), ("xy:1,2,3", 1.0, "two numbers")],
)  # fmt: skip
def test_what_is_no_circle_is_refused(middle, radius_m, words):
    with pytest.raises(HippodromeError, match=words):
        parse_around(middle, radius_m)


@given(st.text(max_size=20), st.floats())
def test_any_words_are_a_circle_or_one_error(middle, radius_m):
    try:
        parse_around(middle, radius_m)
    except HippodromeError as error:
        assert "--" in str(error)


def test_what_cannot_be_cut_is_refused_with_its_cure(grid, tmp_path):
    made = tmp_path / "made.net.xml.gz"
    with pytest.raises(HippodromeError, match="xy:X,Y"):
        cut_network(grid, made, parse_around("49,6", 100.0))
    with pytest.raises(HippodromeError, match="no road within 20 m"):
        cut_network(grid, made, parse_around("xy:9999,9999", 20.0))
    with pytest.raises(HippodromeError, match="generated"):
        new_scenario("a", "grid", tmp_path / "a.yaml", around=parse_around("49,6", 100.0))
    with pytest.raises(HippodromeError, match="LAT,LON"):
        import_options(parse_around("xy:0,0", 100.0))
    assert not made.exists() and not (tmp_path / "a.yaml").exists()
