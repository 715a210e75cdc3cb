"""Networks on Earth: there and back, against pyproj by itself, and what is refused."""

import gzip

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core.types import StartPose
from hippodrome.sim.geo_start import GeoStart
from hippodrome.sim.georeference import GeoReference, GeoReferenceError, placed_start, read_georeference

UTM32 = "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
KARLSRUHE = GeoReference(UTM32, (-454791.0, -5425352.39), "k.net.xml")


def net(path, projection=UTM32, offset="-454791.00,-5425352.39"):
    text = (
        f'<?xml version="1.0"?>\n<!-- made by a test -->\n<net version="1.20"><location netOffset="{offset}" '
        f'convBoundary="0,0,1,1" origBoundary="8,48,9,49" projParameter="{projection}"/></net>'
    )
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


@given(lat=st.floats(48.0, 50.0), lon=st.floats(7.0, 11.0))
@settings(max_examples=50, deadline=None)
def test_there_and_back(lat, lon):
    there = KARLSRUHE.to_network(np.array([lat]), np.array([lon]))
    back = KARLSRUHE.to_lat_lon(there)[0]
    assert np.abs(back - [lat, lon]).max() < 1e-9  # 0.1 mm


@pytest.mark.parametrize("name", ["a.net.xml", "a.net.xml.gz"])
def test_a_network_says_where_it_lies(tmp_path, name):
    found = read_georeference(net(tmp_path / name))
    assert (found.projection, found.offset_m) == (UTM32, (-454791.0, -5425352.39))
    x_m, y_m = pyproj.Proj(UTM32)(8.39, 48.985)
    assert np.allclose(found.to_network(np.array([48.985]), np.array([8.39])), [[x_m - 454791.0, y_m - 5425352.39]], atol=1e-6)


@pytest.mark.parametrize("projection", ["!", "-", ""])
def test_a_network_without_a_projection_says_so(tmp_path, projection):
    with pytest.raises(GeoReferenceError, match="no projection"):
        read_georeference(net(tmp_path / "a.net.xml", projection))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<net></net>", "no <location>"),
        ("no xml", "not a SUMO network"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><net/>', "entities"),
        ('<net><location netOffset="1" projParameter="+proj=utm +zone=32"/></net>', "not two numbers"),
        ('<net><location netOffset="1,2" projParameter="+proj=nowhere"/></net>', "is unknown"),
    ],
)
def test_what_is_no_network_is_refused_in_one_line(tmp_path, text, complaint):
    (tmp_path / "a.net.xml").write_text(text)
    with pytest.raises(GeoReferenceError, match=complaint) as refused:
        read_georeference(tmp_path / "a.net.xml")
    assert "\n" not in str(refused.value)


@given(compass=st.floats(0.0, 360.0), lon=st.floats(6.5, 11.5))
@settings(max_examples=30, deadline=None)
def test_a_compass_is_corrected_by_the_meridians_convergence(compass, lon):
    convergence_deg = pyproj.Proj(UTM32).get_factors(lon, 49.0).meridian_convergence
    heading_deg = np.degrees(KARLSRUHE.heading_rad(49.0, lon, compass))
    expected = 90.0 - (compass - convergence_deg)
    assert abs((heading_deg - expected + 180.0) % 360.0 - 180.0) < 1e-3


def test_starts_of_both_kinds(tmp_path):
    network = net(tmp_path / "a.net.xml")
    given_m = StartPose(1.0, 2.0, 0.5)
    assert placed_start(given_m, tmp_path / "not there", "paper") is given_m
    assert placed_start(None, network) is None
    east = placed_start(GeoStart(48.985, 8.39, 90.0), network)
    assert abs(east.heading_rad) < np.radians(0.5)
    assert placed_start(GeoStart(48.985, 8.39), network).sigma_rad > np.pi
    with pytest.raises(GeoReferenceError, match="known heading"):
        placed_start(GeoStart(48.985, 8.39), network, "paper")
