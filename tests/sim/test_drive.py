from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sumo

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import HippodromeError
from hippodrome.sim.drive import project_m, simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.lane_log import LaneLog, driven_edges, lane_pieces, lanes_ahead
from hippodrome.sim.path import centreline
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"
TOWNS = {
    "rural": TownSpec(kind="rural", road_km=2.5, width_m=220.0, height_m=260.0),
    "grid, two lanes": TownSpec(kind="grid", road_km=2.5, width_m=220.0, height_m=260.0, lanes=2, speed_limit_mps=13.9),
    "radial": TownSpec(kind="radial", road_km=2.5, width_m=260.0, height_m=260.0),
    "bs3d": TownSpec(network=GAMES / "bs3d" / "bs.net.xml"),
    "DRT": TownSpec(network=GAMES / "DRT" / "osm.net.xml"),
}


@pytest.fixture(scope="module", params=sorted(TOWNS))
def driven(request, tmp_path_factory):
    town = build_town(TOWNS[request.param], 5, tmp_path_factory.mktemp("towns"))
    return town, simulate_drive(town, TourSpec(length_m=700.0), TrafficSpec(vehicles=8), EgoSpec(), 5)


def test_motion_is_physical(driven):
    _, drive = driven
    dt = np.diff(drive.t_s)
    np.testing.assert_allclose(dt, dt[0])
    turned = wrap(np.diff(drive.poses_m[:, 2]))
    moved = np.diff(drive.poses_m[:, :2], axis=0)
    assert np.abs(turned / dt).max() <= 0.9
    assert np.abs(turned / dt * drive.speed_mps[1:]).max() <= 3.5
    assert np.abs(np.diff(drive.speed_mps) / dt).max() <= 8.1
    middle = drive.poses_m[:-1, 2] + 0.5 * turned
    forward = moved[:, 0] * np.cos(middle) + moved[:, 1] * np.sin(middle)
    sideways = moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle)
    assert forward.min() >= -1e-6
    assert np.abs(sideways).max() < 0.005  # the rear axle does not slip
    np.testing.assert_allclose(forward / dt, drive.speed_mps[:-1], atol=0.5)


def test_poses_lie_on_their_lanes(driven):
    town, drive = driven
    gap = np.empty(len(drive.t_s))
    for lane in np.unique(drive.lane):
        mine = drive.lane == lane
        assert drive.lane_position_m[mine].min() >= 0.0
        gap[mine] = np.linalg.norm(
            centreline(town.network, int(lane), drive.lane_position_m[mine]) - drive.poses_m[mine, :2], axis=1
        )
    assert np.median(gap) < 0.2
    assert np.mean(gap < 0.5) > (0.95 if town.name in ("rural", "radial") else 0.85)  # elsewhere lane changes take their time


def test_length_and_shares_are_as_asked(driven):
    _, drive = driven
    length = np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum()
    assert 650.0 < length < 760.0
    assert 0.0 < drive.coverage <= 1.0 and 0.0 <= drive.revisit_share < 1.0


def test_lanes_follow_one_another_through_the_network(driven):
    """Each next lane is reached by successors or a neighbour; only short ones and those beside may have been skipped."""
    town, drive = driven
    network, lanes = town.network, drive.lane[np.concatenate([[True], np.diff(drive.lane) != 0])]
    short = network.lane_lengths_m() < 1.0
    for lane, after in pairwise(lanes.tolist()):
        reached, frontier = set(), {lane}
        for _ in range(4):
            onward = {int(s) for each in frontier for s in network.successors(each)}
            near = frontier | onward
            beside = {int(s) for each in near for s in (network.left_lane[each], network.right_lane[each]) if s >= 0}
            reached |= onward | beside
            frontier = {each for each in onward if short[each]} | beside
        assert after in reached


def test_traffic_is_near_moves_smoothly_and_does_not_overlap_the_ego(driven):
    _, drive = driven
    log = drive.traffic
    assert log.start[-1] == len(log.vehicle) > 0
    ego = np.stack([np.interp(log.t_s, drive.t_s, axis) for axis in drive.poses_m[:, :2].T], axis=1)
    owner = np.repeat(np.arange(len(log.t_s)), np.diff(log.start))
    distance = np.linalg.norm(log.poses_m[:, :2] - ego[owner], axis=1)
    assert distance.max() < 165.0
    assert np.mean(distance < 2.0) < 1e-3
    for vehicle in np.unique(log.vehicle)[:5]:
        mine = log.vehicle == vehicle
        steps = np.linalg.norm(np.diff(log.poses_m[mine, :2], axis=0), axis=1)[np.diff(owner[mine]) == 1]
        assert steps.max(initial=0.0) < 0.1 * 25.0 + 3.5  # a lane change is one sideways hop


def test_same_seed_same_drive_in_one_process(tmp_path):
    town = build_town(TOWNS["rural"], 1, tmp_path)
    spec = TourSpec(duration_s=40.0), TrafficSpec(vehicles=10), EgoSpec(lateral_wander_m=0.3)
    one, same, other = (simulate_drive(town, *spec, seed) for seed in (2, 2, 3))
    for name in ("poses_m", "speed_mps", "yaw_rate_radps", "lane", "lane_position_m"):
        assert getattr(one, name).tobytes() == getattr(same, name).tobytes()
    assert one.traffic.poses_m.tobytes() == same.traffic.poses_m.tobytes()
    assert one.poses_m.tobytes() != other.poses_m.tobytes()
    assert one.t_s[-1] == pytest.approx(40.0, abs=0.2)


def test_no_traffic_is_possible(tmp_path):
    town = build_town(TOWNS["radial"], 1, tmp_path)
    drive = simulate_drive(town, TourSpec(length_m=150.0), TrafficSpec(vehicles=0), EgoSpec(), 0)
    assert len(drive.traffic.vehicle) == 0 and len(drive.t_s) > 100


def test_broken_network_is_an_error_and_the_next_drive_works(tmp_path):
    town = build_town(TOWNS["radial"], 1, tmp_path)
    intact = town.net_file.read_text()
    town.net_file.write_text(intact[: len(intact) // 2])
    spec = TourSpec(length_m=60.0), TrafficSpec(vehicles=0), EgoSpec()
    with pytest.raises(HippodromeError, match="SUMO failed"):
        simulate_drive(town, *spec, 0)
    town.net_file.write_text(intact)
    assert len(simulate_drive(town, *spec, 0).t_s) > 10


@pytest.fixture
def chain():
    """Lanes a (10 m) -> x (0.2 m, internal) -> b0 (20 m), beside it b1 (20 m) -> c (5 m)."""
    lines = [[[0, 0], [10, 0]], [[10, 0], [10.2, 0]], [[10.2, 0], [30.2, 0]], [[10.2, 3], [30.2, 3]], [[30.2, 3], [35.2, 3]]]
    return RoadNetwork(
        lane_ids=("a", "x", "b0", "b1", "c"),
        edge_ids=("a", "x", "b", "c"),
        lane_edge=np.array([0, 1, 2, 2, 3], np.int32),
        is_internal=np.array([False, True, False, False, False]),
        width_m=np.full(5, 3.0),
        speed_limit_mps=np.full(5, 10.0),
        points_m=np.array(lines, dtype=float).reshape(-1, 2),
        point_start=np.arange(0, 11, 2, dtype=np.int32),
        successor=np.array([1, 2, 4], np.int32),
        successor_start=np.array([0, 1, 2, 2, 3, 3], np.int32),
        left_lane=np.array([-1, -1, 3, -1, -1], np.int32),
        right_lane=np.array([-1, -1, -1, 2, -1], np.int32),
    )


def test_skipped_lanes_and_lane_changes_are_filled_in(chain):
    log = LaneLog(np.array([0, 0, 2, 3, 4]), np.array([5.0, 9.0, 2.0, 6.0, 1.0]), np.full(5, 4.0))
    pieces, distance = lane_pieces(chain, log)
    assert [chain.lane_ids[piece.lane] for piece in pieces] == ["a", "x", "b0", "b1", "c"]
    assert [piece.side_step for piece in pieces] == [False, False, False, True, False]
    np.testing.assert_allclose(distance, [0.0, 4.0, 7.2, 11.2, 26.2])
    assert [chain.edge_ids[edge] for edge in driven_edges(chain, pieces)] == ["a", "b", "c"]


def test_impossible_moves_are_an_error(chain):
    log = LaneLog(np.array([4, 0]), np.array([1.0, 1.0]), np.ones(2))
    with pytest.raises(HippodromeError, match="from lane c to a"):
        lane_pieces(chain, log)


def test_lanes_ahead_stop_where_a_lane_change_is_needed(chain):
    b, c = 2, 3
    assert lanes_ahead(chain, 0, [b, c], 100.0) == [1, 2]
    assert lanes_ahead(chain, 3, [c], 100.0) == [4]


def test_projection_ignores_the_other_pass_of_a_lane():
    loop = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [25.0, 50.0], [25.0, -50.0]])  # crosses itself at (25, 0)
    along = project_m(loop, np.array([[25.0, 0.1], [25.1, 0.0]]), np.array([24.0, 176.0]))
    np.testing.assert_allclose(along, [25.0, 50.0 + 50.0 + 25.0 + 50.0])
