"""Mode ``paper`` end to end on synthetic drives."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from hippodrome.core.matching.hmm.match import MatchedPath
from hippodrome.core.refinement.config import PaperRefineConfig
from hippodrome.core.refinement.paper import metric_edges, minimise_topometric_cost, refine_paper, trusted_edges, without_closures
from hippodrome.core.types import EdgeKind, MatchStatus, StartPose
from tests.core.synthetic import grid_network, semi_metric_drive

RIGID = PaperRefineConfig(bent_cost=np.inf)  # one similarity, no growing: fast


def drive_of(seed, **options):
    rng = np.random.default_rng(seed)
    network = grid_network(rng)
    return network, semi_metric_drive(network, rng, **{"length_m": 4000.0, **options})


def error_m(refinement, drive):
    return np.linalg.norm((refinement.cognitive_map.poses - drive.true_poses)[:, :2], axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_a_drive_becomes_metric_to_under_five_metres(seed):
    network, drive = drive_of(seed, length_m=4000.0, units_per_metre=[0.4, 1.0, 2.5][seed])
    refinement = refine_paper(drive.cognitive_map, network, StartPose(*drive.true_poses[0]), PaperRefineConfig())
    refined = refinement.cognitive_map
    assert error_m(refinement, drive).mean() < 5.0
    assert refined.frame == "network"
    assert np.exp(refined.log_scale) == pytest.approx(np.median(drive.metres_per_unit), rel=0.06)
    assert np.mean(refined.road_match.lane == drive.true_lane) > 0.85
    assert refined.road_match.lane_ids == network.lane_ids
    assert refinement.breaks == ()
    assert refinement.estimates["sigma_z_m"] >= 1.0 and refinement.estimates["beta_m"] >= 0.5


def test_same_input_same_bytes():
    network, drive = drive_of(1, length_m=2000.0)
    start = StartPose(*drive.true_poses[0])
    first, second = (refine_paper(drive.cognitive_map, network, start, RIGID) for _ in range(2))
    assert first.cognitive_map.poses.tobytes() == second.cognitive_map.poses.tobytes()
    assert first.estimates == second.estimates


def test_more_rounds_come_closer():
    network, drive = drive_of(0)
    start = StartPose(*drive.true_poses[0])
    once, often = (refine_paper(drive.cognitive_map, network, start, replace(RIGID, rounds=rounds)) for rounds in (1, 5))
    assert error_m(often, drive).mean() < error_m(once, drive).mean()


def test_false_closures_that_the_map_contradicts_are_left_out():
    _, drive = drive_of(3, false_share=0.1)
    edges = drive.cognitive_map.edges
    true_m = np.linalg.norm((drive.true_poses[edges.source] - drive.true_poses[edges.target])[:, :2], axis=1)
    false = (edges.kind == EdgeKind.CLOSURE) & (true_m > 40.0)
    kept = trusted_edges(drive.cognitive_map, PaperRefineConfig())
    pairs = set(zip(kept.source.tolist(), kept.target.tolist(), strict=True))
    assert false.sum() >= 5
    assert not any((a, b) in pairs for a, b in zip(edges.source[false], edges.target[false], strict=True))
    assert np.sum(kept.kind == EdgeKind.ODOMETRY) == np.sum(edges.kind == EdgeKind.ODOMETRY)


def test_edges_take_the_scale_of_the_alignment_but_not_their_headings():
    _, drive = drive_of(3, length_m=500.0)
    edges = drive.cognitive_map.edges
    metric = metric_edges(edges, 2.5)
    assert metric.motion == pytest.approx(edges.motion * [2.5, 2.5, 1.0])
    assert metric.sigma == pytest.approx(edges.sigma * [2.5, 2.5, 1.0])


def test_a_stretch_off_the_roads_is_named_and_hangs_on_its_edges():
    """Every lane near the middle of the drive is taken out of the network."""
    network, drive = drive_of(4)
    middle = drive.true_poses[len(drive.true_poses) // 2, :2]
    far = np.array([np.linalg.norm(network.lane_points_m(i) - middle, axis=1).min() > 60.0 for i in range(network.lane_count)])
    keep = np.flatnonzero(far)
    number = np.full(network.lane_count, -1, dtype=np.int32)
    number[keep] = np.arange(len(keep))
    onward = [[j for j in number[network.successors(i)] if j >= 0] for i in keep]
    holed = replace(
        network,
        lane_ids=tuple(network.lane_ids[i] for i in keep),
        lane_edge=network.lane_edge[keep],
        is_internal=network.is_internal[keep],
        width_m=network.width_m[keep],
        speed_limit_mps=network.speed_limit_mps[keep],
        points_m=np.concatenate([network.lane_points_m(i) for i in keep]),
        point_start=np.cumsum([0] + [len(network.lane_points_m(i)) for i in keep]).astype(np.int32),
        successor=np.array([j for after in onward for j in after], dtype=np.int32),
        successor_start=np.cumsum([0] + [len(after) for after in onward]).astype(np.int32),
        left_lane=network.left_lane[keep],
        right_lane=network.right_lane[keep],
    )
    refinement = refine_paper(drive.cognitive_map, holed, StartPose(*drive.true_poses[0]), RIGID)
    match = refinement.cognitive_map.road_match
    named = np.zeros(len(match.lane), dtype=bool)
    for stretch in refinement.breaks:
        assert stretch.cause
        named[stretch.first_vertex : stretch.last_vertex + 1] = True
    assert refinement.breaks
    assert named[match.lane < 0].all()
    assert np.array_equal(match.lane < 0, match.status != MatchStatus.MATCHED)
    assert np.isnan(match.position_m[match.lane < 0]).all()
    assert np.isfinite(refinement.cognitive_map.poses).all()


def test_the_optimum_of_a_matched_map_is_a_fixed_point():
    """Matched exactly where the poses are, with edges that agree, nothing moves."""
    _, drive = drive_of(6, length_m=800.0, closures=0, relaxed=False, scale_wander=0.0)
    poses, config = drive.cognitive_map.poses, PaperRefineConfig()
    edges = trusted_edges(drive.cognitive_map, config)
    matched = _matched_at(poses)
    found, cost = minimise_topometric_cost(poses, edges, matched, config)
    assert found == pytest.approx(poses, abs=1e-6)
    assert cost == pytest.approx(0.0, abs=1e-9)


def _matched_at(poses):
    count = len(poses)
    lane, status = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.uint8)
    return MatchedPath(lane, np.zeros(count), poses[:, :2], status, (), 1.0, 1.0)


def test_a_map_without_closures_is_bent_on_to_the_roads():
    """0.6 rad of heading drift: no similarity fits, so the drive is grown from its beginning."""
    network, drive = drive_of(3, length_m=3000.0, closures=0, relaxed=False)
    start = StartPose(*drive.true_poses[0])
    refinement = refine_paper(drive.cognitive_map, network, start, PaperRefineConfig())
    rigid = refine_paper(drive.cognitive_map, network, start, RIGID)
    assert refinement.estimates["grown"] == 1.0
    assert error_m(refinement, drive).mean() < 5.0 < error_m(rigid, drive).mean()


def test_dead_reckoning_undoes_what_closures_did():
    _, drive = drive_of(5, length_m=1500.0)
    _, raw = drive_of(5, length_m=1500.0, relaxed=False)
    reckoned = without_closures(drive.cognitive_map)
    assert reckoned.poses == pytest.approx(raw.cognitive_map.poses, abs=1e-9)
    assert set(reckoned.edges.kind.tolist()) == {int(EdgeKind.ODOMETRY)}


def test_an_unknown_setting_is_rejected():
    with pytest.raises(ValidationError, match="rouds"):
        TypeAdapter(PaperRefineConfig).validate_python({"rouds": 3})
    assert TypeAdapter(PaperRefineConfig).validate_python({"matching": {"radius_m": 30}}).matching.radius_m == 30.0
