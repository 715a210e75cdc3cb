"""Which roads missions find closed: those that are named, or as many as are asked for, drawn by the seed."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.barriers import closed_roads
from hippodrome.sim.network import drivable_edges, edge_links
from hippodrome.sim.town import build_town
from tests.sim.loop import small


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    scenario = small.scenario()
    return build_town(scenario.town, scenario.seed, tmp_path_factory.mktemp("town"))


def closing(closed, seed=1):
    scenario = small.scenario()
    return scenario.model_copy(update={"seed": seed, "localization": scenario.localization.model_copy(update={"closed": closed})})


def reachable(network, gone):
    """How many drivable roads can be reached from each other without one."""
    source, target = edge_links(network)
    stays = (source != gone) & (target != gone)
    count = len(network.edge_ids)
    graph = coo_array((np.ones(stays.sum()), (source[stays], target[stays])), shape=(count, count))
    part = connected_components(graph, connection="strong")[1]
    return int(np.bincount(part[[edge for edge in drivable_edges(network).tolist() if edge != gone]]).max())


def test_a_road_is_drawn_that_cuts_as_few_others_off_as_can_be(town):
    network = town.network
    best = max(reachable(network, edge) for edge in drivable_edges(network).tolist())
    for seed in range(6):
        drawn = closed_roads(closing(1, seed), network)
        assert len(drawn) == 1 and drawn == closed_roads(closing(1, seed), network)
        assert reachable(network, network.edge_ids.index(drawn[0])) == best
    assert len(set(closed_roads(closing(3), network))) == 3
    assert len({closed_roads(closing(1, seed), network) for seed in range(12)}) > 1


def test_names_are_taken_as_they_are_and_must_exist(town):
    name = town.network.edge_ids[int(drivable_edges(town.network)[0])]
    assert closed_roads(closing((name,)), town.network) == (name,)
    assert closed_roads(closing(0), town.network) == ()
    with pytest.raises(HippodromeError, match="no road 'nowhere'"):
        closed_roads(closing(("nowhere",)), town.network)
    with pytest.raises(HippodromeError, match="100 roads: the mapping drive passes only"):
        closed_roads(closing(100), town.network)
