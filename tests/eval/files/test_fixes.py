"""Fixes of every kind say the same of the same drive, and what is damaged is refused in one line."""

import contextlib
import json
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.eval.files.fixes import RANGE_ERROR_M, is_fix_file, read_fixes
from hippodrome.eval.metrics.association import TrajectoryError

BEGAN_S = datetime(2026, 5, 1, 23, 59, 58, tzinfo=UTC).timestamp()
T_S = BEGAN_S + np.arange(5.0)  # past midnight
LAT, LON = 49.0 + 1e-4 * np.arange(5), 8.4 - 2e-4 * np.arange(5)


def iso(t):
    return datetime.fromtimestamp(t, UTC).isoformat().replace("+00:00", "Z")


def gpx(path):
    points = "".join(
        f'<trkpt lat="{a!r}" lon="{o!r}"><ele>110</ele><time>{iso(t)}</time><hdop>1.5</hdop></trkpt>'
        for t, a, o in zip(T_S, LAT.tolist(), LON.tolist(), strict=True)
    )
    path.write_text(f'<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{points}</trkseg></trk></gpx>')


def table(path):
    rows = [f"{a!r},{iso(t)},{o!r},6.0" for t, a, o in zip(T_S, LAT.tolist(), LON.tolist(), strict=True)]
    path.write_text("\ufeffLatitude,Time,Longitude,accuracy\n" + "\n".join(rows) + "\n")


def milliseconds(path):
    rows = [f"{round(1e3 * t)};{a!r};{o!r}" for t, a, o in zip(T_S, LAT.tolist(), LON.tolist(), strict=True)]
    path.write_text("timestamp;lat;lng\n" + "\n".join(rows) + "\n")


def geojson(path):
    places = [[o, a] for a, o in zip(LAT.tolist(), LON.tolist(), strict=True)]
    feature = {
        "type": "Feature",
        "properties": {"coordTimes": [iso(t) for t in T_S]},
        "geometry": {"type": "LineString", "coordinates": places},
    }
    path.write_text(json.dumps(feature))


def sentence(body):
    total = 0
    for character in body.encode():
        total ^= character
    return f"${body}*{total:02X}"


def nmea_angle(degrees, digits):
    whole = int(abs(degrees))
    return f"{whole:0{digits}d}{(abs(degrees) - whole) * 60.0:010.7f}"


def nmea(path, with_date=True):
    lines = []
    for t, a, o in zip(T_S, LAT, LON, strict=True):
        at = datetime.fromtimestamp(t, UTC)
        place = f"{nmea_angle(a, 2)},N,{nmea_angle(o, 3)},E"
        lines.append(sentence(f"GPGGA,{at:%H%M%S}.00,{place},1,08,1.5,110.0,M,48.0,M,,"))
        if with_date:
            lines.append(sentence(f"GPRMC,{at:%H%M%S}.00,A,{place},10.0,90.0,{at:%d%m%y},,"))
    path.write_text("\r\n".join(lines) + "\r\n$GPGSV,junk\r\n")


def oxts(path):
    (path / "oxts" / "data").mkdir(parents=True)
    stamps = [datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%d %H:%M:%S.%f") + "000" for t in T_S]
    (path / "oxts" / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    for i, (a, o) in enumerate(zip(LAT.tolist(), LON.tolist(), strict=True)):
        rest = " ".join(["0"] * 21)
        (path / "oxts" / "data" / f"{i:010d}.txt").write_text(f"{a!r} {o!r} {rest} 0.05 0 0\n")


KINDS = {
    "a.gpx": (gpx, 1.5 * RANGE_ERROR_M),
    "a.csv": (table, 6.0),
    "b.csv": (milliseconds, None),
    "a.geojson": (geojson, None),
    "a.nmea": (nmea, 1.5 * RANGE_ERROR_M),
    "drive_sync": (oxts, 0.05),
}


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_says_the_same(tmp_path, name):
    write, sigma_m = KINDS[name]
    write(tmp_path / name)
    assert is_fix_file(tmp_path / name)
    found = read_fixes(tmp_path / name)
    assert np.abs(found.t_s - T_S).max() < 1e-3
    assert np.abs(found.lat_deg - LAT).max() < 1e-8
    assert np.abs(found.lon_deg - LON).max() < 1e-8
    assert found.sigma_m is None if sigma_m is None else np.allclose(found.sigma_m, sigma_m)


def test_nmea_without_a_date_goes_on_past_midnight_and_counts_bad_checksums(tmp_path):
    nmea(tmp_path / "a.nmea", with_date=False)
    text = (tmp_path / "a.nmea").read_text()
    (tmp_path / "a.nmea").write_text(text + "$GPGGA,000004.00,4900.0,N,00824.0,E,1,08,1.5,110.0,M,48.0,M,,*00\n")
    found = read_fixes(tmp_path / "a.nmea")
    assert np.diff(found.t_s).tolist() == [1.0] * 4
    assert any("no date" in note for note in found.notes)
    assert any(note.startswith("1 sentence") for note in found.notes)


def test_a_repeated_time_is_left_out_and_counted(tmp_path):
    (tmp_path / "a.csv").write_text("t_s,lat,lon\n1,49,8\n2,49.1,8\n2,49.1,8\n3,49.2,8\n")
    found = read_fixes(tmp_path / "a.csv")
    assert found.t_s.tolist() == [1.0, 2.0, 3.0]
    assert found.notes == ("1 fix(es) with the time of the one before are left out",)


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.gpx", '<!DOCTYPE g [<!ENTITY a "b">]><gpx>&a;</gpx>', "DOCTYPE"),
        ("a.gpx", "<gpx><trk></gpx>", "not a GPX file"),
        ("a.gpx", "<gpx/>", "no fixes with a time"),
        ("a.gpx", '<gpx><trkpt lat="x" lon="1"><time>2026-05-01T00:00:00Z</time></trkpt></gpx>', "track point 1: 'x'"),
        ("a.csv", "t_s,lat,lon\n1,49,8\n0,49,8\n", "fix 2 is earlier"),
        ("a.csv", "t_s,lat,lon\n1,49\n", "line 2: 2 columns"),
        ("a.csv", "t_s,lat,lon\n1,8,190\n", "no place on Earth"),
        ("a.csv", "t_s,lat,lon\n1,nan,8\n", "no place on Earth"),
        ("a.csv", "t_s,x,y\n1,2,3\n", "name a time"),
        ("a.csv", "t_s,lat,lon\nyesterday,2,3\n", "neither seconds nor a date"),
        ("a.geojson", "{", "not a GeoJSON"),
        ("a.geojson", '{"type": "FeatureCollection", "features": [3]}', "no Feature with a LineString"),
        (
            "a.geojson",
            '{"geometry": {"type": "LineString", "coordinates": [[8, 49]]}, "properties": {}}',
            "a time for each place",
        ),
        ("a.nmea", "$GPRMC,1,A,1,N,1,E,1,1,1,,\n", "is no place"),
    ],
)
def test_what_is_damaged_is_refused_in_one_line(tmp_path, name, text, complaint):
    (tmp_path / name).write_text(text)
    with pytest.raises(TrajectoryError, match=complaint) as refused:
        read_fixes(tmp_path / name)
    assert str(tmp_path / name) in str(refused.value)
    assert "\n" not in str(refused.value)


@given(data=st.binary(max_size=300), name=st.sampled_from(["a.gpx", "a.csv", "a.nmea", "a.geojson"]))
@settings(max_examples=150, deadline=None)
def test_nothing_but_an_error_of_ours_comes_of_noise(tmp_path_factory, data, name):
    path = tmp_path_factory.mktemp("noise") / name
    path.write_bytes(
        {"a.gpx": b"<gpx>", "a.csv": b"t,lat,lon\n", "a.nmea": b"$GPRMC,", "a.geojson": b'{"features":'}[name] + data
    )
    with contextlib.suppress(TrajectoryError):
        read_fixes(path)
