"""Maps and trajectories in latitude and longitude: read back by other means, they lie where they lay."""

import dataclasses
import json
import shutil
from xml.etree import ElementTree

import numpy as np
import pyproj
import pytest

from hippodrome.core.types import MatchStatus
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.files.fixes import read_fixes
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.proto.codec import load_map, save_map
from tests.sim.test_georeference import UTM32, net

OFFSET = np.array([-454791.0, -5425352.39])


@pytest.fixture
def network(run, tmp_path):
    """The run's network, said to lie in Karlsruhe."""
    text = next((run.root / "towns").glob("*.net.xml")).read_text()
    before, _, rest = text.partition("<location")
    path = tmp_path / "town.net.xml"
    location = (
        f'<location netOffset="{OFFSET[0]},{OFFSET[1]}" projParameter="{UTM32}" convBoundary="0,0,1,1" origBoundary="0,0,1,1"/>'
    )
    path.write_text(before + location + rest.partition("/>")[2])
    return path


def metres(lon_lat):
    """Network metres of longitudes and latitudes, by pyproj alone."""
    return np.column_stack(pyproj.Proj(UTM32)(*np.asarray(lon_lat, float).T)) + OFFSET


def test_gpx_of_a_whole_run(run, network, tmp_path):
    assert main(["export", str(run.root), "--to", "gpx", "--network", str(network), "--out", str(tmp_path / "web")]) == DONE
    root = ElementTree.parse(tmp_path / "web" / "hamlet-mapping.gpx").getroot()
    space = {"g": "http://www.topografix.com/GPX/1/1"}
    assert root.tag == "{http://www.topografix.com/GPX/1/1}gpx"
    tracks = {track.find("g:name", space).text: track for track in root.findall("g:trk", space)}
    points = [(float(p.get("lon")), float(p.get("lat"))) for p in tracks["topometric"].findall(".//g:trkpt", space)]
    assert np.abs(metres(points) - read_tum(run.scenario / "topometric.tum").poses[:, :2]).max() < 1e-3
    assert "semi-metric" not in tracks
    assert "truth" in tracks


def test_geojson_says_what_vouches_for_each_vertex(run, network, tmp_path):
    found = load_map(run.scenario / "topometric-default.pbstream")[0]
    status = np.array([0, 0, 0, 3, 3, 1, 1, 0, 0, 0, 2, 0], np.uint8)
    found = dataclasses.replace(found, road_match=dataclasses.replace(found.road_match, status=status))
    save_map(tmp_path / "topo.pb", found, {})
    arguments = ["export", tmp_path / "topo.pb", "--to", "geojson", "--network", network, "--out", tmp_path / "web"]
    assert main([str(word) for word in arguments]) == DONE
    features = json.loads((tmp_path / "web" / "topo.geojson").read_text())["features"]
    points = [f for f in features if f["geometry"]["type"] == "Point"]
    assert [p["properties"]["status"] for p in points] == [MatchStatus(int(value)).name.lower() for value in status]
    assert np.abs(metres([p["geometry"]["coordinates"] for p in points]) - found.poses[:, :2]).max() < 1e-3
    lines = [f for f in features if f["geometry"]["type"] == "LineString"]
    assert [line["properties"]["status"] for line in lines] == ["matched", "no_route", "ambiguous", "matched", "off_network"]
    variance = (found.covariance[:, 0, 0] + found.covariance[:, 1, 1]) / 2.0
    said = [p["properties"].get("sigma_m", np.nan) for p in points]  # a random matrix is not always a covariance
    assert np.allclose(np.square(said), np.where(variance >= 0.0, variance, np.nan), atol=1e-2, equal_nan=True)


def test_our_geojson_is_a_truth_that_we_read(run, network, tmp_path):
    arguments = ["export", run.scenario / "topometric.tum", "--to", "geojson", "--network", network, "--out", tmp_path / "web"]
    assert main([str(word) for word in arguments]) == DONE
    back, ours = read_fixes(tmp_path / "web" / "topometric.geojson"), read_tum(run.scenario / "topometric.tum")
    assert np.array_equal(back.t_s, ours.t_s)
    assert np.abs(metres(np.column_stack([back.lon_deg, back.lat_deg])) - ours.poses[:, :2]).max() < 1e-3


def test_what_is_nowhere_on_earth_is_refused(run, network, tmp_path, capsys):
    out = ["--out", str(tmp_path / "web")]
    assert main(["export", str(run.root), "--to", "gpx", *out]) == BAD_INPUT
    assert "no projection" in capsys.readouterr().err
    tum = str(run.scenario / "topometric.tum")
    assert main(["export", tum, "--to", "gpx", *out]) == BAD_INPUT
    assert "--network" in capsys.readouterr().err
    assert main(["export", tum, "--to", "tum", *out]) == BAD_INPUT
    assert "takes a folder" in capsys.readouterr().err
    semi = str(run.scenario / "semi-metric.pbstream")
    assert main(["export", semi, "--to", "gpx", "--network", str(network), *out]) == BAD_INPUT
    assert "hippodrome refine" in capsys.readouterr().err
    assert not (tmp_path / "web").exists()


def test_a_start_on_earth_is_asked_of_the_network(run, tmp_path, capsys):
    shutil.copy(run.scenario / "semi-metric.pbstream", tmp_path / "semi.pbstream")
    nowhere = net(tmp_path / "a.net.xml", "!")
    arguments = ["refine", tmp_path / "semi.pbstream", "--network", nowhere, "--start", "geo:49,8.4,90", "--out", tmp_path / "t"]
    assert main([str(word) for word in arguments]) == BAD_INPUT
    assert "no projection" in capsys.readouterr().err
    for wrong in ("geo:91,8", "geo:49", "geo:49,8,1,2", "geo:a,b"):
        with pytest.raises(SystemExit):
            main([*map(str, arguments[:5]), wrong, "--out", "t"])
        assert "is not geo:LAT,LON" in capsys.readouterr().err
