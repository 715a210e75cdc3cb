import numpy as np

from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.route import search_route
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import read_town
from tests.core.matching.drives import misplaced_m, random_drive


def test_a_drive_on_the_left_is_found_on_the_left(tmp_path):
    net_file = tmp_path / "left.net.xml"
    run_tool("netgenerate", "--rand", "--rand.iterations=25", "--seed=3", "--lefthand", "--output-file", str(net_file))
    town = read_town(net_file)
    assert town.left_hand
    visits, poses, lanes = random_drive(town.network, 2, 2000.0, turn_noise_rad=0.004)
    route = search_route(visits, town.network, RouteSearchConfig())
    assert misplaced_m(route, poses).max() < 10.0
    nearest = np.clip(np.searchsorted(route.track.visit_arc, route.track.arc), 0, len(lanes) - 1)
    on_road = ~town.network.is_internal[lanes[nearest]] & ~town.network.is_internal[route.lane]
    assert np.mean(route.lane[on_road] == lanes[nearest][on_road]) > 0.95
