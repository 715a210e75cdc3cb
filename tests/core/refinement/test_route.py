from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.refinement.config import RouteRefineConfig
from hippodrome.core.refinement.route import refine_route
from hippodrome.core.se2 import compose, wrap
from hippodrome.core.types import EdgeKind, MatchStatus, Observation, Visits
from tests.core.matching.drives import square_grid
from tests.core.synthetic import grid_network, semi_metric_drive

CONFIG = RouteRefineConfig()
LENGTH_M = 2500.0


def town(seed=1):
    return grid_network(np.random.default_rng(seed), columns=4, rows=3)


def drive(network, seed=1, **how):
    return semi_metric_drive(network, np.random.default_rng(seed), length_m=LENGTH_M, relaxed=False, **{"closures": 60, **how})


def errors(refinement, truth):
    """Errors (V, 3) of the refined poses."""
    off = refinement.cognitive_map.poses - truth
    return np.column_stack([off[:, :2], wrap(off[:, 2])])


def ape(refinement, truth):
    return float(np.hypot(*errors(refinement, truth)[:, :2].T).mean())


@pytest.fixture(scope="module")
def network():
    return town()


@pytest.fixture(scope="module")
def driven(network):
    return drive(network, false_share=0.01)


@pytest.fixture(scope="module")
def refined(network, driven):
    return refine_route(driven.cognitive_map, network, CONFIG)


def test_decimetres_from_an_unknown_start(refined, driven):
    assert ape(refined, driven.true_poses) < 0.45
    assert refined.breaks == ()
    assert np.degrees(np.abs(errors(refined, driven.true_poses)[:, 2]).mean()) < 1.0


def test_the_answer_is_a_whole_map(refined, driven, network):
    before, after = driven.cognitive_map, refined.cognitive_map
    assert after.frame == "network"
    assert after.edges is before.edges
    assert np.mean(np.abs(after.log_scale - np.log(driven.metres_per_unit))) < 0.05
    match = after.road_match
    assert match.lane_ids == network.lane_ids
    assert np.mean(match.lane == driven.true_lane) > 0.97
    assert np.all(match.position_m <= network.lane_lengths_m()[match.lane] + 1e-9)


def test_the_covariance_is_calibrated(network):
    nees = []
    for seed in range(3):
        there = drive(network, seed)
        found = refine_route(there.cognitive_map, network, CONFIG)
        off = errors(found, there.true_poses)
        nees.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.cognitive_map.covariance), off).mean() / 3.0)
    assert 0.5 < np.mean(nees) < 2.0


def test_false_closures_do_not_matter(network, driven):
    poisoned = drive(network, false_share=0.2)
    np.testing.assert_allclose(poisoned.true_poses, driven.true_poses)
    found = refine_route(poisoned.cognitive_map, network, CONFIG)
    without = replace(poisoned.cognitive_map, edges=_without_closures(poisoned.cognitive_map.edges))
    assert ape(found, driven.true_poses) < 1.3 * ape(refine_route(without, network, CONFIG), driven.true_poses)


def _without_closures(edges):
    kept = edges.kind != EdgeKind.CLOSURE
    return replace(
        edges, **{name: getattr(edges, name)[kept] for name in ("source", "target", "motion", "sigma", "kind", "margin")}
    )


def test_the_gyros_gain_is_estimated(network, driven):
    motion = driven.cognitive_map.visits.motion * [1.0, 1.0, 1.0 / 1.04]
    skewed = replace(driven.cognitive_map, visits=replace(driven.cognitive_map.visits, motion=motion))
    found = refine_route(skewed, network, CONFIG)
    assert found.estimates["gyro_gain_error"] == pytest.approx(0.04, abs=0.01)
    assert ape(found, driven.true_poses) < 0.5


def test_a_missing_road_is_off_network_and_the_rest_is_right(network, driven):
    before = driven.true_lane[: len(driven.true_lane) // 2]
    gone = int(np.bincount(before[~network.is_internal[before]]).argmax())
    twin = gone ^ 1  # the other direction of the same road
    found = refine_route(driven.cognitive_map, _without_lanes(network, {gone, twin}), CONFIG)
    status = found.cognitive_map.road_match.status
    off_road = np.isin(driven.true_lane, [gone, twin])
    wrong = np.hypot(*errors(found, driven.true_poses)[:, :2].T)
    assert np.mean(status[~off_road] == MatchStatus.MATCHED) > 0.93
    assert wrong[status == MatchStatus.MATCHED].max() < 6.0
    assert np.mean(status[off_road] == MatchStatus.OFF_NETWORK) > 0.7
    assert {b.status for b in found.breaks} == {MatchStatus.OFF_NETWORK}
    assert np.all(found.cognitive_map.road_match.lane[status == MatchStatus.OFF_NETWORK] == -1)


def _without_lanes(network, gone):
    """The network with these lanes and all that lead to or from them inside junctions cut out."""
    gone = gone | {i for i in range(network.lane_count) if network.is_internal[i] and set(network.successors(i).tolist()) & gone}
    gone = gone | {int(s) for lane in gone for s in network.successors(lane) if network.is_internal[s]}
    kept = [i for i in range(network.lane_count) if i not in gone]
    index = {lane: k for k, lane in enumerate(kept)}
    after = [[index[int(s)] for s in network.successors(i) if int(s) in index] for i in kept]
    lanes = [network.lane_points_m(i) for i in kept]
    return replace(
        network,
        lane_ids=tuple(network.lane_ids[i] for i in kept),
        lane_edge=network.lane_edge[kept],
        is_internal=network.is_internal[kept],
        width_m=network.width_m[kept],
        speed_limit_mps=network.speed_limit_mps[kept],
        points_m=np.concatenate(lanes),
        point_start=np.cumsum([0] + [len(lane) for lane in lanes]).astype(np.int32),
        successor=np.array([s for group in after for s in group], dtype=np.int32),
        successor_start=np.cumsum([0] + [len(group) for group in after]).astype(np.int32),
        left_lane=network.left_lane[kept],
        right_lane=network.right_lane[kept],
    )


def test_merged_vertices_keep_their_first_visit(network, driven):
    """Every revisited vertex merged into the one it closes with, as some mappers do."""
    plain = driven.cognitive_map
    closures = plain.edges.kind == EdgeKind.CLOSURE
    vertex = plain.visits.vertex.copy()
    for a, b, motion in zip(
        plain.edges.source[closures], plain.edges.target[closures], plain.edges.motion[closures], strict=True
    ):
        if np.hypot(*motion[:2]) < 2.0 and np.hypot(*(driven.true_poses[a] - driven.true_poses[b])[:2]) < 5.0:
            vertex[a] = vertex[b]
    merged = replace(plain, visits=replace(plain.visits, vertex=vertex), edges=_without_closures(plain.edges))
    found = refine_route(merged, network, CONFIG)
    used = np.unique(vertex)
    assert len(used) < len(vertex)
    assert np.hypot(*errors(found, driven.true_poses)[used, :2].T).mean() < 0.6


def test_a_stop_with_a_noisy_gyro_is_survived(network, driven):
    visits = driven.cognitive_map.visits
    rng = np.random.default_rng(0)
    middle, still = len(visits.t_s) // 2, 20
    pause = np.column_stack([np.zeros((still, 2)), 0.001 * rng.standard_normal(still)])
    grown = Visits(
        t_s=np.concatenate(
            [visits.t_s[:middle], visits.t_s[middle - 1] + 1.0 + np.arange(still), visits.t_s[middle:] + still + 1.0]
        ),
        vertex=np.concatenate([visits.vertex[:middle], np.full(still, middle - 1), visits.vertex[middle:]]).astype(np.int32),
        motion=np.concatenate([visits.motion[:middle], pause, visits.motion[middle:]]),
    )
    found = refine_route(replace(driven.cognitive_map, visits=grown), network, CONFIG)
    assert ape(found, driven.true_poses) < 0.5


def test_the_answer_is_the_same_every_time(network, driven, refined):
    again = refine_route(driven.cognitive_map, network, CONFIG)
    assert again.cognitive_map.poses.tobytes() == refined.cognitive_map.poses.tobytes()
    assert again.estimates == refined.estimates


def test_the_first_pose_of_the_map_does_not_matter(network, driven, refined):
    moved = replace(driven.cognitive_map, poses=compose(np.array([5.0, 6.0, 1.0]), driven.cognitive_map.poses))
    found = refine_route(moved, network, CONFIG)
    assert found.cognitive_map.poses.tobytes() == refined.cognitive_map.poses.tobytes()


@pytest.mark.parametrize("turn_rad", [0.0, 0.001])
def test_a_drive_without_a_turn_is_a_finite_map_that_nothing_vouches_for(turn_rad):
    """Neither the place along the road nor the scale can be told: the equations alone have no unique solution."""
    mapper = MotionMapper()
    for i in range(40):
        mapper.step(Observation(t_s=0.2 * i + 0.2, dt_s=0.2, speed=5.0, yaw_rate_radps=turn_rad, frame=None))
    refined = refine_route(mapper.finish(), square_grid(columns=3, rows=3), CONFIG).cognitive_map
    assert np.isfinite(refined.poses).all()
    assert np.isfinite(refined.covariance).all()
    assert np.all(refined.road_match.status != MatchStatus.MATCHED)
