"""What is found on roads that keep left is the mirror image of what is found on roads that keep right."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import StartPose
from tests.core.synthetic import grid_network, semi_metric_drive

MIRROR = np.array([1.0, -1.0, -1.0])  # of a pose or a motion


def mirrored_network(network):
    sides = {"left_lane": network.right_lane, "right_lane": network.left_lane}
    return replace(network, points_m=network.points_m * MIRROR[:2], **sides)


def mirrored_map(one):
    edges = replace(one.edges, motion=one.edges.motion * MIRROR)
    visits = replace(one.visits, motion=one.visits.motion * MIRROR)
    return replace(one, poses=one.poses * MIRROR, edges=edges, visits=visits)


def test_a_town_that_keeps_left_has_the_error_of_its_mirror_image():
    network = grid_network(np.random.default_rng(0))
    drive = semi_metric_drive(network, np.random.default_rng(1), length_m=4000.0)
    start = StartPose(*drive.true_poses[0])
    right = refine(drive.cognitive_map, network, start=start).cognitive_map
    other = StartPose(*(drive.true_poses[0] * MIRROR))
    left = refine(mirrored_map(drive.cognitive_map), mirrored_network(network), start=other).cognitive_map
    error_m = [
        np.hypot(*(found.poses[:, :2] - true).T)
        for found, true in ((right, drive.true_poses[:, :2]), (left, drive.true_poses[:, :2] * MIRROR[:2]))
    ]
    assert error_m[0].mean() < 3.0
    assert error_m[1].mean() == pytest.approx(error_m[0].mean(), rel=0.1)
