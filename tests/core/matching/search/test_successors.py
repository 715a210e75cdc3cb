"""One step of the search by hand: where it leads, and what it costs."""

import numpy as np
import pytest

from hippodrome.core.matching.search.backward import backward
from hippodrome.core.matching.search.beam import BeamLimits, forward
from hippodrome.core.matching.search.config import OffNetworkCosts, SearchCosts
from hippodrome.core.matching.search.hypotheses import HYPOTHESIS, NOWHERE, PLACE, SUCCESSOR
from hippodrome.core.matching.search.model import StepObservation
from hippodrome.core.matching.search.problem import SearchProblem, compiled_drive, compiled_model
from hippodrome.core.matching.search.successors import expand, jump_bar, successors
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.lanes_ahead import build_search_graph
from tests.core.synthetic import lanes_of

COSTS = SearchCosts()
FORK = lanes_of([(0, 0), (10, 0)], [(10, 0), (20, 0)], [(10, 0), (20, 10)], successor=[(0, 1), (0, 2)])


def problem(network=FORK, headings=(0.0, 0.0, 0.0, 0.0), log_scale=(0.0,)):
    """Steps of 5 m, bins of 1 m."""
    samples = 5.0 * np.arange(len(headings))
    track = Track(samples, np.array(headings), samples, 5.0)
    graph = build_search_graph(network, 20.0)
    return SearchProblem(network, track, np.array(log_scale), graph, COSTS, OffNetworkCosts(), 1.0)


def hypothesis(**fields):
    row = np.zeros(1, HYPOTHESIS)
    for name, value in fields.items():
        row[name] = value
    return row


def observation(heading_rad=0.0, place=(0.0, 0.0, 0.0)):
    return StepObservation(heading_rad, heading_rad, 5.0, *place)


def expanded(row, model, seen, may_jump=False, most_cost=100.0):
    out = np.zeros(64, SUCCESSOR)
    return out[: expand(row[0], seen, model, may_jump, most_cost, out)]


def test_a_step_leads_to_the_predicted_bin_and_its_neighbours():
    """5 m on from bin 0; a bin of 1 m either way is free up to half a bin, the rest has a sigma of 0.4 m."""
    found = expanded(hypothesis(bin=0), compiled_model(problem()), observation())
    assert found["bin"].tolist() == [4, 5, 6]
    beyond = 0.5 * (0.5 / 0.4) ** 2
    assert found["log_likelihood"] == pytest.approx([-beyond, 0.0, -beyond])
    assert found["remainder_m"].tolist() == [0.5, 0.0, -0.5]  # carried on, as far as half a bin


def test_a_heading_error_costs_and_pulls_the_offset():
    """0.06 rad are half a sigma: 1/8 nat; the offset takes over a tenth of the error."""
    found = expanded(hypothesis(bin=0), compiled_model(problem()), observation(heading_rad=-0.06), most_cost=0.2)
    assert found["bin"].tolist() == [5]
    assert found["log_likelihood"] == pytest.approx([-0.125])
    assert found["heading_offset_rad"] == pytest.approx([0.006])


def test_both_branches_of_a_fork_are_reached_and_the_wrong_one_costs_its_heading():
    found = expanded(hypothesis(bin=7), compiled_model(problem()), observation(), most_cost=6.5)
    lane = problem().graph.lane[found["bin"]]
    straight, turning = found["log_likelihood"][lane == 1].max(), found["log_likelihood"][lane == 2].max()
    assert straight == pytest.approx(0.0)
    assert -6.0 - 0.5 * (0.5 / 0.4) ** 2 < turning <= -6.0  # 45 degrees: truncated at 6 nats


def test_a_known_place_costs_its_distance():
    """The place is known to be bin 5's centre with a sigma of 2 m: bin 6 is half a sigma off."""
    x, y = problem().graph.points_m[5]
    found = expanded(hypothesis(bin=0), compiled_model(problem()), observation(place=(x, y, 0.25)))
    beyond = 0.5 * (0.5 / 0.4) ** 2
    assert found["log_likelihood"] == pytest.approx([-beyond - 0.125, 0.0, -beyond - 0.125])


def test_the_scale_changes_by_one_bin_or_jumps():
    """Scales of 1, 1.2 and 1.4 lead 5, 6 and 7 m ahead; a jump costs no more than 10 nats."""
    scales = tuple(np.log([1.0, 1.2, 1.4, 1.6, 1.8]))
    model = compiled_model(problem(log_scale=scales))
    steady, jumping = (expanded(hypothesis(bin=0), model, observation(), may_jump=jump) for jump in (False, True))
    best = {int(row["scale_bin"]): (int(row["bin"]), row["log_likelihood"]) for row in steady if row["remainder_m"] < 0.01}
    assert sorted({row["scale_bin"] for row in steady}) == [0, 1]
    assert best[1][0] == 6
    assert best[1][1] == pytest.approx(-3.0)
    cheapest = [jumping["log_likelihood"][jumping["scale_bin"] == k].max() for k in range(5)]
    assert cheapest == pytest.approx([0.0, -3.0, -6.0, -9.0, -10.0])


def test_only_a_few_good_hypotheses_may_jump():
    rows = np.concatenate([hypothesis(score_nats=-1.0), *[hypothesis(score_nats=-1.5)] * 150, hypothesis(score_nats=-9.0)])
    assert jump_bar(rows, -1.0) == pytest.approx(-3.0)
    assert jump_bar(np.concatenate([rows, rows]), -1.0) == np.inf


def test_off_the_network_dead_reckoning_comes_back_to_lanes_nearby():
    """At (1, 3), 20 m off the network, driving 5 m east: back to the bins around (6, 3), the cheapest right beside it."""
    places = np.zeros(1, PLACE)
    places["x_m"], places["y_m"], places["driven_m"] = 1.0, 3.0, 20.0
    out = np.zeros(64, SUCCESSOR)
    model = compiled_model(problem())
    found = out[: successors(hypothesis(bin=-1)[0], places, observation(), model, False, 100.0, out)]
    cheapest = found[np.argmax(found["log_likelihood"])]
    assert cheapest["bin"] in (5, 6)
    sigma_m = 2.0 + 0.05 * 25.0
    assert cheapest["log_likelihood"] == pytest.approx(-4.0 - 0.5 * (3.0**2 + 0.5**2) / sigma_m**2)
    assert set(problem().graph.lane[found["bin"]].tolist()) <= {0, 1}  # the third lane's heading is too far off


def test_max_marginals_are_the_scores_of_complete_routes():
    """Without pruning: to each survivor of the last step its own score, and at the first step the best score of all."""
    bent = problem(headings=(0.0, 0.1, 0.3, 0.5))
    drive, model = compiled_drive(bent, bent.track.heading_rad), compiled_model(bent)
    initial = np.concatenate([hypothesis(bin=0), hypothesis(bin=2, score_nats=-0.3)])
    survivors = forward(drive, model, BeamLimits(1e3, 10_000, 0, 1_000_000, np.full(4, NOWHERE)), initial, np.empty(0, PLACE))
    row_start, rows = survivors.row_start, survivors.hypotheses
    last = rows["score_nats"][row_start[-2] :]
    through = backward(drive, model, 1e3, survivors, np.zeros(len(last), np.float32))
    assert through[row_start[-2] :] == pytest.approx(last - last.max(), abs=1e-5)
    assert through[:2].max() == pytest.approx(0.0, abs=1e-5)
    pruned = backward(drive, model, 1.0, survivors, np.zeros(len(last), np.float32))
    kept = pruned > NOWHERE
    assert kept.any() and not kept.all()
    assert pruned[kept] == pytest.approx(through[kept], abs=1e-5)
