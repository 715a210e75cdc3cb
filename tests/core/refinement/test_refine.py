from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import HippodromeError, StartPose
from tests.core.synthetic import grid_network, semi_metric_drive


@pytest.fixture(scope="module")
def world():
    network = grid_network(np.random.default_rng(1), columns=3, rows=3)
    return network, semi_metric_drive(network, np.random.default_rng(2), length_m=1200.0, closures=20)


def test_both_modes_answer_and_route_is_closer(world):
    network, drive = world
    start = StartPose(*drive.true_poses[0])
    ape = {}
    for mode in ("route", "paper"):
        refined = refine(drive.cognitive_map, network, RefineConfig(mode=mode), start).cognitive_map
        assert refined.frame == "network"
        ape[mode] = np.hypot(*(refined.poses - drive.true_poses)[:, :2].T).mean()
    assert ape["route"] < ape["paper"]


def test_mode_paper_asks_for_a_start(world):
    network, drive = world
    with pytest.raises(HippodromeError, match="needs a start pose"):
        refine(drive.cognitive_map, network, RefineConfig(mode="paper"))


def test_a_refined_map_is_not_refined_again(world):
    network, drive = world
    with pytest.raises(HippodromeError, match="only a semi-metric map"):
        refine(replace(drive.cognitive_map, frame="network"), network)
