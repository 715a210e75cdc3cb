"""What is done to maps and networks on purpose is exactly what its name says."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hippodrome.core.types import EdgeKind, HippodromeError
from hippodrome.eval.trials.stress.cases import CASES, StressCase, chosen_cases, in_self_similar_grid
from hippodrome.eval.trials.stress.perturbations import with_false_closures, without_roads
from hippodrome.eval.trials.stress.rows import StressRow
from hippodrome.eval.trials.stress.table import stress_markdown
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NOISE_LEVELS, SelfMotionNoise, at_level
from hippodrome.sim.town import build_town
from tests.core.synthetic import grid_network, semi_metric_drive


@pytest.fixture(scope="module")
def network():
    return grid_network(np.random.default_rng(1), columns=3, rows=3)


def test_false_closures_are_added_and_nothing_else_changes(network):
    before = semi_metric_drive(network, np.random.default_rng(2)).cognitive_map
    after = with_false_closures(before, 0.5, np.random.default_rng(2))
    own = np.count_nonzero(before.edges.kind == EdgeKind.CLOSURE)
    assert len(after.edges.source) == len(before.edges.source) + round(0.5 * own)
    assert_array_equal(after.edges.source[: len(before.edges.source)], before.edges.source)
    assert after.poses is before.poses
    assert with_false_closures(before, 0.0, np.random.default_rng(2)) is before


def test_a_removed_road_leaves_a_consistent_network(network):
    gone = [0, 1]
    rest = without_roads(network, gone)
    removed = set(network.lane_ids) - set(rest.lane_ids)
    assert {network.lane_ids[lane] for lane in range(network.lane_count) if network.lane_edge[lane] in gone} <= removed
    assert all(
        network.is_internal[network.lane_ids.index(name)]
        for name in removed
        if network.lane_edge[network.lane_ids.index(name)] not in gone
    )
    assert rest.successor.max(initial=0) < rest.lane_count
    for lane in range(rest.lane_count):
        same = network.lane_ids.index(rest.lane_ids[lane])
        assert_array_equal(rest.lane_points_m(lane), network.lane_points_m(same))
        assert {rest.lane_ids[s] for s in rest.successors(lane)} == {
            network.lane_ids[s] for s in network.successors(same)
        } - removed
        assert not rest.is_internal[lane] or len(rest.successors(lane))


def test_the_summary_shows_failures_and_the_worst():
    rows = [
        StressRow("a", 1, "paper", 10, 1.0, 0, 0.2, 0.9, 0.2, 0.1, 1.0, 0.5),
        StressRow("b", 2, "paper", 10, 1.0, 3, 0.6, 30.0, 0.6, 0.1, 1.0, 0.5),
        StressRow("b", 3, "paper", 10, failure="no route"),
    ]
    text = stress_markdown(rows)
    assert "| paper | 3 | 1 | 0.40 |" in text
    assert "0.60 (b, seed 2)" in text
    assert "- paper, b, seed 3: no route" in text


def test_a_row_says_how_to_make_it_again_and_what_is_right():
    row = StressRow(
        "a", 4, "harsh", 200, 0.5, 0, 0.2, 0.9, 0.2, 0.1, 1.0, 0.5, None, far=1, right_share=0.9, rerun="hippodrome x"
    )
    refused = StressRow("a", 5, "another town", 200, failure="no vertex is vouched for", rerun="hippodrome y")
    text = stress_markdown([row, refused])
    assert "| 50.0 | 90.0 | 1.00 | 0 |" in text
    assert "- another town, a, seed 5: no vertex is vouched for. `hippodrome y`" in text


def test_cases_of_one_self_motion_share_a_map_and_unknown_names_are_refused():
    assert len({case.self_motion().model_dump_json() for case in CASES}) == 5
    with pytest.raises(HippodromeError, match="no stress case 'rain'"):
        chosen_cases(["paper", "rain"])


def test_a_case_changes_the_errors_and_leaves_the_unit_of_the_speeds_that_a_scenario_states():
    stated = SelfMotionNoise(units_per_metre=1.0, units_per_metre_spread=0.0, speed_noise=0.5)
    found = StressCase("harsh", noise="harsh").self_motion(stated)
    assert (found.units_per_metre, found.units_per_metre_spread) == (1.0, 0.0)
    assert (found.speed_noise, found.gyro_gain) == (NOISE_LEVELS["harsh"].speed_noise, NOISE_LEVELS["harsh"].gyro_gain)
    assert at_level("harsh", "clean") == at_level("harsh", SelfMotionNoise(speed_noise=0.5)) == "harsh"


def test_the_self_similar_grid_is_one(tmp_path):
    scenario = in_self_similar_grid(Scenario(name="any"), tmp_path)
    network = build_town(scenario.town, 1, tmp_path).network
    lengths = network.lane_lengths_m()[~network.is_internal]
    assert lengths.max() - lengths.min() < 6.0  # corners and edges of the grid have smaller crossings
    before = scenario.town.network.read_bytes()
    scenario.town.network.unlink()
    in_self_similar_grid(Scenario(name="any"), tmp_path)
    assert scenario.town.network.read_bytes() == before  # no date in it
