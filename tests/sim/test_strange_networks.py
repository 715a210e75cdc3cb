"""Networks of traits that strangers' maps have: each is driven to the end, or refused with a reason that is true."""

import inspect

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec
from tests.sim import strange_networks, stranger_networks, unlisted_maps, unlisted_networks

BUILDERS = {
    name: build
    for module in (strange_networks, stranger_networks, unlisted_networks, unlisted_maps)
    for name, build in inspect.getmembers(module, inspect.isfunction)
    if build.__module__ == module.__name__ and list(inspect.signature(build).parameters) == ["folder"]
}
DRIVEN = sorted(BUILDERS.keys() - {"converted", "osm", "never_green", "both_ways_on_one_side", "cliff", "banked_road"})


@pytest.mark.parametrize("name", DRIVEN)
def test_a_drive_is_as_long_as_asked(tmp_path, name):
    town = build_town(TownSpec(network=BUILDERS[name](tmp_path)), 1, tmp_path)
    assert town.left_hand == (name == "roundabout_left")
    for seed in (1, 2):
        drive = simulate_drive(town, TourSpec(length_m=250), TrafficSpec(vehicles=8), EgoSpec(), seed)
        driven_m = np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum()
        assert driven_m == pytest.approx(250, abs=20)  # the bicycle cuts and widens corners
        assert np.abs(np.diff(drive.speed_mps)).max() < 0.5 * 1.01  # no jump: 8 m/s^2 at most, of steps of 0.05 s


def test_what_is_drawn_follows_the_roads_and_not_the_distance_between_them(tmp_path):
    """Two villages 10,000 km apart: the ground lies along their roads, and the scene's origin where one drives."""
    town = build_town(TownSpec(network=stranger_networks.ten_thousand_kilometres_apart(tmp_path)), 1, tmp_path)
    scene = build_scene(town, 1, Conditions())
    assert np.linalg.norm(scene.origin_m - [75.0, 75.0]) < 120.0
    assert sum(len(tile.faces) for tile in scene.tiles) < 100_000


def test_a_road_steeper_than_any_is_told(tmp_path):
    notes = " | ".join(build_town(TownSpec(network=stranger_networks.cliff(tmp_path)), 1, tmp_path).notes)
    assert "1 road(s) climb or fall by more than 50%, for instance AB by 200%" in notes


def test_a_step_of_the_road_is_told_as_one_that_is_too_steep(tmp_path):
    town = build_town(TownSpec(network=unlisted_maps.banked_road(tmp_path)), 1, tmp_path)
    assert "2 road(s) climb or fall by more than 50%, for instance -1 by 500%" in " | ".join(town.notes)
    drive = simulate_drive(town, TourSpec(length_m=250), TrafficSpec(vehicles=8), EgoSpec(), 1)
    assert np.ptp(drive.heights_m) > 5.0


def test_a_road_without_a_way_back_is_refused(tmp_path):
    with pytest.raises(HippodromeError, match="no closed loop for passenger cars, so no tour can return; add a way round"):
        build_town(TownSpec(network=stranger_networks.both_ways_on_one_side(tmp_path)), 1, tmp_path)


def test_a_light_without_green_is_named(tmp_path):
    town = build_town(TownSpec(network=strange_networks.never_green(tmp_path)), 1, tmp_path)
    with pytest.raises(
        HippodromeError, match=r"standing for 360 s: the traffic light \w at the end of edge \w\w shows it no green"
    ):
        simulate_drive(town, TourSpec(length_m=250), TrafficSpec(vehicles=8), EgoSpec(), 1)


def test_what_the_ferry_was_is_said(tmp_path):
    notes = " | ".join(build_town(TownSpec(network=strange_networks.ferry(tmp_path)), 1, tmp_path).notes)
    assert "route.ferry" in notes and "not for cars and were left out" in notes
    assert "cannot be left or reached again" in notes
