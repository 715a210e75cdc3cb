import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import numpy as np
import pytest

from hippodrome.sim.tour import tour_graph, toured_area
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic import VEHICLE_SIZES_M, random_trip, traffic_at, vehicle_types_xml
from hippodrome.sim.types import TrafficLog


@pytest.fixture
def log():
    """Vehicle 7 drives 2 m east and turns across +-pi; vehicle 9 is seen at the first step only, 8 at the second only."""
    return TrafficLog(
        t_s=np.array([0.0, 0.1]),
        start=np.array([0, 2, 4], dtype=np.int32),
        vehicle=np.array([9, 7, 7, 8], dtype=np.int32),
        poses_m=np.array([[5.0, 5.0, 1.0], [0.0, 0.0, 3.1], [2.0, 0.0, -3.1], [1.0, 1.0, 0.0]]),
        kind=np.array([2, 0, 0, 1], dtype=np.uint8),
    )


def test_interpolation_by_hand(log):
    poses, kinds, ids = traffic_at(log, 0.025)
    assert ids.tolist() == [9, 7] and kinds.tolist() == [2, 0]
    np.testing.assert_allclose(poses[1], [0.5, 0.0, 3.1 + 0.25 * (2 * np.pi - 6.2)])
    np.testing.assert_allclose(poses[0], [5.0, 5.0, 1.0])  # held


@pytest.mark.parametrize(("t_s", "ids"), [(-5.0, [9, 7]), (0.0, [9, 7]), (0.1, [7, 8]), (99.0, [7, 8])])
def test_ends_are_held(log, t_s, ids):
    poses, _, found = traffic_at(log, t_s)
    assert found.tolist() == ids
    assert np.isfinite(poses).all()


def test_interpolation_does_not_change_the_log(log):
    before = log.poses_m.copy()
    traffic_at(log, 0.05)
    np.testing.assert_array_equal(log.poses_m, before)


def test_empty_logs_are_empty():
    nothing = TrafficLog(np.empty(0), np.zeros(1, np.int32), np.empty(0, np.int32), np.empty((0, 3)), np.empty(0, np.uint8))
    assert [len(part) for part in traffic_at(nothing, 1.0)] == [0, 0, 0]


def test_trips_follow_links_within_their_area_and_repeat_with_the_seed(tmp_path):
    town = build_town(TownSpec(kind="grid", road_km=2.0), 0, tmp_path)
    graph = tour_graph(town.network)
    area = toured_area(graph, 1200.0)
    number = {int(edge): k for k, edge in enumerate(graph.edges)}
    trips = [random_trip(graph, area, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert trips[0] == trips[1] != trips[2]
    for trip in trips:
        steps = [number[edge] for edge in trip]
        assert set(steps) <= set(area.tolist())
        assert all(graph.cost_m[a, b] > 0.0 for a, b in pairwise(steps))


def test_vehicle_types_have_the_sizes_that_are_drawn():
    types = {t.attrib["id"]: t.attrib for t in ElementTree.fromstring(vehicle_types_xml(1.5, 2.0, 4.5)).iter("vType")}
    for kind, (length, width, height) in enumerate(VEHICLE_SIZES_M):
        assert [float(types[f"kind{kind}"][key]) for key in ("length", "width", "height")] == [length, width, height]
    assert float(types["ego"]["timeToTeleport"]) < 0.0
