"""Where a map seems wrong: told only where the drive proves it, in degrees where the network knows them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.matching.confidence import match_breaks
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, MatchStatus, Refinement, RoadMatch
from hippodrome.eval.real.drive import marks
from hippodrome.eval.real.findings import find_wrong_roads, to_record, usual_error_m
from hippodrome.eval.real.findings_file import write_findings
from hippodrome.eval.real.kept import read_breaks, read_findings
from tests.proto.maps import random_map

SIGMA_M = 2.5
NET = '<net><location netOffset="{offset}" convBoundary="0,0,1,1" origBoundary="0,0,1,1" projParameter="{projection}"/></net>'
UTM = "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"


def straight_road(*lanes):
    """A network of lanes, each of two points."""
    count = len(lanes)
    return RoadNetwork(
        lane_ids=tuple(f"l{i}" for i in range(count)), edge_ids=tuple(f"e{i}" for i in range(count)),
        lane_edge=np.arange(count, dtype=np.int32), is_internal=np.zeros(count, bool), width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 14.0), points_m=np.array([point for lane in lanes for point in lane], float),
        point_start=np.arange(count + 1, dtype=np.int32) * 2, successor=np.zeros(0, np.int32),
        successor_start=np.zeros(count + 1, np.int32), left_lane=np.full(count, -1, np.int32),
        right_lane=np.full(count, -1, np.int32), survey_sigma_m=SIGMA_M,
    )  # fmt: skip


EAST = ((0.0, 0.0), (500.0, 0.0))
WEST = ((500.0, 0.0), (0.0, 0.0))


def drive_east(error_m=None, status=None, sigma_m=0.8, places=None):
    """100 vertices, 5 m apart, driven to the east; as much of a refinement as findings look at."""
    count = 100
    poses = np.column_stack([5.0 * np.arange(count), np.zeros(count), np.zeros(count)]) if places is None else places
    status = np.zeros(count, np.uint8) if status is None else status
    covariance = np.tile(np.diag([sigma_m**2, sigma_m**2, 1e-4]), (count, 1, 1))
    match = RoadMatch(("l0",), np.where(status == 0, 0, -1).astype(np.int32), np.zeros(count), status)
    refined = replace(
        random_map(refined=True),
        frame="network",
        poses=poses,
        t_s=np.arange(count, dtype=float),
        covariance=covariance,
        road_match=match,
    )
    return Refinement(refined, match_breaks(status), {}, error_m)


def bump(size_m, first=40, last=50):
    """An error of the map to the north over some vertices."""
    error_m = np.zeros((100, 2))
    error_m[first : last + 1, 1] = size_m
    return error_m


def test_a_road_that_is_drawn_metres_off_is_told_with_its_side_and_length():
    (found,) = find_wrong_roads(drive_east(bump(5.0)), straight_road(EAST), SIGMA_M)
    assert (found.kind, found.first_vertex, found.last_vertex, found.length_m) == ("drawn off", 40, 50, 50.0)
    assert found.offset_m == (0.0, 5.0) and found.sigma_m == 0.8
    assert found.words() == "over 50 m the road is drawn up to 5.0 m +- 0.8 north of where it was driven"


@pytest.mark.parametrize(
    ("what", "refinement"),
    [
        ("within the map's accuracy", drive_east(bump(3.9))),
        ("not well known", drive_east(bump(5.0), sigma_m=1.7)),
        ("a corner that was cut", drive_east(bump(5.0, 40, 42))),
        ("not vouched for", drive_east(bump(5.0), np.full(100, MatchStatus.AMBIGUOUS, np.uint8))),
        ("roads that are taken as exact", drive_east(None)),
        ("along the road", drive_east(bump(5.0)[:, ::-1])),
    ],
)
def test_what_the_drive_does_not_prove_is_not_told(what, refinement):
    assert find_wrong_roads(refinement, straight_road(EAST), SIGMA_M) == (), what


def test_an_accurate_network_is_held_to_its_word():
    assert len(find_wrong_roads(drive_east(bump(2.0), sigma_m=0.3), straight_road(EAST), 0.5)) == 1
    assert find_wrong_roads(drive_east(bump(1.2), sigma_m=0.3), straight_road(EAST), 0.5) == ()
    assert find_wrong_roads(drive_east(bump(9.0)), straight_road(EAST), 0.0) == ()


def test_a_road_that_is_driven_twice_is_told_once():
    there = np.column_stack([5.0 * np.arange(50), np.zeros(50), np.zeros(50)])
    back = np.column_stack([there[::-1, 0], np.zeros(50), np.full(50, np.pi)])
    error_m = bump(5.0, 20, 30) + bump(5.0, 69, 79)
    refinement = drive_east(error_m, places=np.concatenate([there, back]))
    (found,) = find_wrong_roads(refinement, straight_road(EAST), SIGMA_M)
    assert found.passes == 2 and found.words().endswith("driven 2 times")


def off_network(first, last):
    status = np.zeros(100, np.uint8)
    status[first : last + 1] = MatchStatus.OFF_NETWORK
    return status


def test_a_road_that_is_missing_is_told_where_it_was_driven():
    roads = straight_road(((0.0, 0.0), (150.0, 0.0)), ((350.0, 0.0), (500.0, 0.0)))
    (found,) = find_wrong_roads(drive_east(status=off_network(30, 69)), roads, SIGMA_M)
    assert found.kind == "missing road" and found.first_vertex in (30, 31) and found.last_vertex in (68, 69)
    assert found.points_m[0][0] == pytest.approx(150.0, abs=10.0) and found.points_m[-1][0] == pytest.approx(350.0, abs=10.0)


def test_a_road_that_leads_the_other_way_is_told():
    (found,) = find_wrong_roads(drive_east(status=off_network(30, 69)), straight_road(WEST), SIGMA_M)
    assert (found.kind, found.length_m) == ("wrong direction", 195.0) and "one-way" in found.words()


def test_a_stretch_off_the_network_beside_a_road_that_fits_is_the_drives_fault():
    assert find_wrong_roads(drive_east(status=off_network(30, 69)), straight_road(EAST, WEST), SIGMA_M) == ()


def test_a_stretch_that_hangs_on_nothing_vouched_tells_nothing():
    status = np.full(100, MatchStatus.AMBIGUOUS, np.uint8)
    status[30:70] = MatchStatus.OFF_NETWORK
    assert find_wrong_roads(drive_east(status=status), straight_road(((0.0, 90.0), (9.0, 90.0))), SIGMA_M) == ()


def test_findings_survive_the_record_of_a_run_and_broken_ones_are_refused(tmp_path):
    found = find_wrong_roads(drive_east(bump(5.0)), straight_road(EAST), SIGMA_M)
    kept, content = tmp_path / "refinement.json", {"breaks": [], "map_error_m": [0.5, 2]}
    one = to_record(found[0])
    kept.write_text(json.dumps({**content, "findings": [one]}))
    assert read_findings(kept, 10_000) == (found[:1], (0.5, 2.0))
    wrong = (
        {"first_vertex": 10**400},
        {"last_vertex": 10**9},
        {"first_vertex": -1},
        {"length_m": "x"},
        {"kind": 3},
        {"points_m": 1},
    )
    for findings in (7, [7], [{}], *([{**one, **change}] for change in wrong), [{**one, "sigma_m": float("nan")}]):
        kept.write_text(json.dumps({**content, "findings": findings}))
        with pytest.raises(HippodromeError, match="delete it"):
            read_findings(kept, 10_000)
    kept.write_text(json.dumps({"breaks": [{"first": 10**30, "last": 10**31, "status": "OFF_NETWORK", "cause": ""}]}))
    with pytest.raises(HippodromeError, match="of a map of 46: not the breaks"):
        read_breaks(kept, 46)


def test_the_usual_error_is_that_of_the_vouched_stretches():
    status = np.full(100, MatchStatus.AMBIGUOUS, np.uint8)
    assert usual_error_m(drive_east(bump(5.0), status)) is None and usual_error_m(drive_east(None)) is None
    assert usual_error_m(drive_east(np.full((100, 2), [3.0, 4.0]))) == (5.0, 5.0)


@pytest.mark.parametrize(
    ("offset", "projection", "first"), [("-450000,-5400000", UTM, (8.319, 48.751)), ("0,0", "!", (200.0, 0.0))]
)
def test_findings_are_geojson_in_degrees_or_say_that_they_are_not(tmp_path, offset, projection, first):
    net_file, path = tmp_path / "town.net.xml", tmp_path / "findings.geojson"
    net_file.write_text(NET.format(offset=offset, projection=projection))
    write_findings(path, find_wrong_roads(drive_east(bump(5.0)), straight_road(EAST), SIGMA_M), net_file)
    content = json.loads(path.read_text())
    (feature,) = content["features"]
    assert content["type"] == "FeatureCollection" and ("WGS84 degrees" in content["coordinates"]) == (projection == UTM)
    assert feature["geometry"]["coordinates"][0] == pytest.approx(first, abs=0.02)
    about = feature["properties"]
    assert (about["offset_east_m"], about["offset_north_m"], about["length_m"], about["kind"]) == (0.0, 5.0, 50.0, "drawn off")


def test_marks_go_on_after_z():
    assert marks(28)[:2] == ["A", "B"] and marks(28)[25:] == ["Z", "A2", "B2"]
