"""What the ego stands on: a seam between two lanes is no edge of the road."""

from types import SimpleNamespace

from hippodrome.sim.loop.footing import stand
from hippodrome.sim.loop.ground import Ground
from tests.core.navigation.roads import network_of


def off_road(y_m):
    """Whether the ego is off the road at a place across two lanes of 3.2 m, between which 30 cm belong to neither."""
    lanes = network_of([[(0.0, 0.0), (100.0, 0.0)], [(0.0, 3.5), (100.0, 3.5)]], [])
    ground = Ground(SimpleNamespace(network=lanes, junction_polygons_m=(), turning_places_m=(), heights_m=None))
    return stand(ground, (50.0, y_m, 0.0), 0, 0).off_road


def test_a_seam_below_the_middle_is_no_edge_of_the_road():
    assert not off_road(0.0) and not off_road(1.75)


def test_beside_the_lanes_is_off_the_road():
    assert off_road(-2.0) and off_road(9.0)
