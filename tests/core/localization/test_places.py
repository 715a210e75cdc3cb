"""The places of a topometric map: links between views, poses between views, lanes."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.localization.places import _ends, _links, drawn_to_lanes, likely_cells, make_place_map
from hippodrome.core.roads.geometry import road_geometry
from tests.core.looped_world import Pictures, topometric_map
from tests.core.synthetic import lanes_of

PICTURES = Pictures(seed=3)
MAP = topometric_map(PICTURES, np.random.default_rng(3))


def sources_of(cell, links):
    return links.paths.source[links.start[cell] : links.start[cell + 1]]


def test_links_follow_the_street_and_never_the_opposite_lane():
    places = make_place_map(MAP, None, 0.0, 0.4)
    for cell in range(2, len(places.poses_m) - 1, 7):
        sources = sources_of(cell, places.predecessors)
        assert cell - 1 in sources
        assert cell + 1 not in sources
    opposite = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 3.2, np.pi], [0.0, 3.2, np.pi]])
    links = _links(opposite, cKDTree(opposite[:, :2]))
    assert [list(sources_of(j, links)) for j in range(4)] == [[0], [0, 1], [2], [2, 3]]


def test_a_street_ends_where_nothing_leads_on_and_where_nothing_leads_from():
    street = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.5, 0.2, 0.0]])  # two visits of its last place
    links = _links(street, cKDTree(street[:, :2]))
    assert list(_ends(links)) == [True, False, True, True]


def test_expected_cells_are_those_that_the_best_lead_to():
    places = make_place_map(MAP, None, 0.0, 0.4)
    filtered = np.zeros(len(places.poses_m), np.float32)
    filtered[[20, 50]] = [2.0, 1.0]
    near = likely_cells(places, filtered, 1)
    assert set(near) == {j for j in range(len(filtered)) if 20 in sources_of(j, places.predecessors)}
    assert 51 in likely_cells(places, filtered, 2)
    assert len(likely_cells(places, np.zeros_like(filtered), 1)) == 0


def test_lane_pull_needs_a_single_lane_of_the_same_way():
    def lane(y, heading_east):
        points = [[0.0, y], [100.0, y]]
        return points if heading_east else points[::-1]

    pose = np.array([[50.0, 0.6, 0.05]])
    single = road_geometry(lanes_of(lane(0.0, True), lane(3.2, False)))
    assert_allclose(drawn_to_lanes(pose, single, np.array([0.5])), [[50.0, 0.3, 0.05]])
    double = road_geometry(lanes_of(lane(0.0, True), lane(3.2, True)))
    assert_allclose(drawn_to_lanes(pose, double, np.array([0.5])), pose)
    assert_allclose(se2.wrap(pose[:, 2]), pose[:, 2])
