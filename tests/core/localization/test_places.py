"""The places of a topometric map: links between views, evidence along them, poses between views, lanes."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.localization import places as places_module
from hippodrome.core.roads.geometry import road_geometry
from tests.core.looped_world import Pictures, topometric_map
from tests.core.synthetic import lanes_of

PICTURES = Pictures(seed=3)
MAP = topometric_map(PICTURES, np.random.default_rng(3))


def test_parabola_peaks_where_it_should():
    def fall(x, peak):
        return (x - peak) ** 2 - peak**2

    for peak in (-1.5, 0.0, 0.8):
        assert_allclose(places_module.peak_offset(4.0, 6.0, fall(-4.0, peak), fall(6.0, peak)), peak, atol=1e-12)
    assert places_module.peak_offset(4.0, 6.0, 0.1, -5.0) == 0.0  # no peak: the cell itself
    assert places_module.peak_offset(4.0, 6.0, 2.0, -1.0) == 3.0  # no farther than half way


def test_links_follow_the_street_and_never_the_opposite_lane():
    places = places_module.places_of(MAP, None, 0.0, 0.4)
    for cell in range(2, len(places.poses_m) - 1, 7):
        sources = places.link_from[places.link_start[cell] : places.link_start[cell + 1]]
        assert cell - 1 in sources
        assert cell + 1 not in sources
    opposite = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 3.2, np.pi], [0.0, 3.2, np.pi]])
    start, source, _, _ = places_module._links(opposite, cKDTree(opposite[:, :2]))
    assert [list(source[start[j] : start[j + 1]]) for j in range(4)] == [[0], [0, 1], [2], [2, 3]]


def test_a_street_ends_where_nothing_leads_on_and_where_nothing_leads_from():
    street = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.5, 0.2, 0.0]])  # two visits of its last place
    links = places_module._links(street, cKDTree(street[:, :2]))
    assert list(places_module._ends(links)) == [True, False, True, True]


def test_evidence_runs_along_links_only():
    links = (np.array([0, 1, 3]), np.array([0, 0, 1]), np.array([0.0, 5.0, 0.0]), np.zeros(3))
    before, z, cells = np.array([2.0, 0.0], np.float32), np.array([0.5, 1.0], np.float32), np.arange(2, dtype=np.int32)
    moved = places_module.propagate(before, cells, z, links, (5.0, 0.0), (3.0, 0.5), np.float32(0.5))
    assert_allclose(moved, [0.25, 1.5])
    turned = places_module.propagate(before, cells, z, links, (5.0, 1.0), (3.0, 0.5), np.float32(0.5))
    assert_allclose(turned, [0.25, 0.5])
    second = places_module.propagate(before, cells[1:], z[1:], links, (5.0, 0.0), (3.0, 0.5), np.float32(0.5))
    assert_allclose(second, [0.0, 1.5])


def test_expected_cells_are_those_that_the_best_lead_to():
    places = places_module.places_of(MAP, None, 0.0, 0.4)
    filtered = np.zeros(len(places.poses_m), np.float32)
    filtered[[20, 50]] = [2.0, 1.0]
    near = places_module.expected(places, filtered, 1)
    assert set(near) == {
        j for j in range(len(filtered)) if 20 in places.link_from[places.link_start[j] : places.link_start[j + 1]]
    }
    assert 51 in places_module.expected(places, filtered, 2)
    assert len(places_module.expected(places, np.zeros_like(filtered), 1)) == 0


def test_lane_pull_needs_a_single_lane_of_the_same_way():
    def lane(y, heading_east):
        points = [[0.0, y], [100.0, y]]
        return points if heading_east else points[::-1]

    pose = np.array([[50.0, 0.6, 0.05]])
    single = road_geometry(lanes_of(lane(0.0, True), lane(3.2, False)))
    assert_allclose(places_module.centred(pose, single, np.array([0.5])), [[50.0, 0.3, 0.05]])
    double = road_geometry(lanes_of(lane(0.0, True), lane(3.2, True)))
    assert_allclose(places_module.centred(pose, double, np.array([0.5])), pose)
    assert_allclose(se2.wrap(pose[:, 2]), pose[:, 2])
