"""Scores by hand: arrivals, false arrivals, SPL, penalties, and the table's width."""

from typing import get_args

import numpy as np
import pytest

from hippodrome.core.navigation.types import DrivingState
from hippodrome.core.types import HippodromeError
from hippodrome.eval.commands.drive import ROW_KEYS
from hippodrome.eval.drive.flight import TRACE, Flight
from hippodrome.eval.drive.foreign import Policy
from hippodrome.eval.drive.missions import Mission, draw_missions
from hippodrome.eval.drive.rows import ROWS, policy_row, row_named
from hippodrome.eval.drive.run import with_earlier
from hippodrome.eval.drive.scoring import DEFINITIONS, mission_result, row_result
from hippodrome.eval.drive.table import table_lines
from hippodrome.eval.results.model import Network, Results, Row, ScenarioResult, write_results
from hippodrome.sim.loop.types import Event, EventKind
from hippodrome.sim.mission_spec import RowKey
from tests.core.synthetic import grid_network, lanes_of

NETWORK = lanes_of([(0.0, 0.0), (100.0, 0.0)], [(100.0, 0.0), (200.0, 0.0)], successor=[(0, 1)])
MISSION = Mission(0, 5, "e0_0", 20.0, "e1_0", 50.0, True, 130.0)


def flight(end_m=150.0, arrived=True, driven_m=130.0, events=(), outside=0.0):
    rows = np.zeros((11, len(TRACE)))
    at = {name: k for k, name in enumerate(TRACE)}
    rows[:, at["t_s"]] = np.linspace(0.0, 40.0, 11)
    rows[:, at["x_m"]] = np.linspace(20.0, end_m, 11)
    rows[:, at["lane_m"]] = end_m - 100.0
    rows[:, at["speed_mps"]] = 5.0
    rows[:, at["gap_m"]] = np.inf
    rows[:, at["driven_m"]] = np.linspace(0.0, driven_m, 11)
    rows[3:, at["localized"]] = 1.0
    rows[:, at["wheel_outside_m"]] = outside
    rows[:, at["state"]] = float(DrivingState.ARRIVED)
    return Flight(rows, tuple(events), "e1_0", arrived, "arrived" if arrived else "time is up: searching", 2.0)


def event(kind, at_fault=True):
    return Event(kind, 1.0, 0.0, 0.0, at_fault, "e0_0")


def test_an_arrival_within_three_metres_is_a_success_and_one_beyond_is_false():
    good, bad = (mission_result(MISSION, flight(end), NETWORK, 20.0) for end in (152.9, 153.2))
    assert good["success"] and not good["false_arrival"] and good["cause"] == "arrived"
    assert not bad["success"] and bad["false_arrival"] and bad["cause"] == "said so elsewhere"


def test_the_path_length_weighs_a_success():
    assert mission_result(MISSION, flight(driven_m=260.0), NETWORK, 20.0)["spl"] == pytest.approx(0.5)
    assert mission_result(MISSION, flight(arrived=False), NETWORK, 20.0)["spl"] == 0.0


def test_infractions_at_fault_multiply_the_completion():
    events = [event(EventKind.COLLISION), event(EventKind.COLLISION, at_fault=False), event(EventKind.RED_LIGHT)]
    figures = mission_result(MISSION, flight(events=events), NETWORK, 20.0)
    assert figures["driving_score"] == pytest.approx(100.0 * 0.6 * 0.7)
    assert figures["events"] == {"collision": 1, "collision of others": 1, "red light": 1}
    half = mission_result(MISSION, flight(end_m=110.0, arrived=False), NETWORK, None)
    assert half["completion"] == pytest.approx(1.0 - 40.0 / 130.0)


def test_a_row_is_what_its_missions_are():
    missions = [mission_result(MISSION, flight(outside=outside), NETWORK, 20.0) for outside in (0.0, 0.2)]
    missions.append(mission_result(MISSION, flight(arrived=False), NETWORK, 20.0))
    row = row_result(missions, 12.0)
    assert row["success_rate"] == pytest.approx(2.0 / 3.0) and row["time_ratio"] == pytest.approx(2.0)
    assert row["outside_lane_share"] == pytest.approx(1.0 / 3.0) and row["metres_until_localized"] == pytest.approx(39.0)
    assert set(DEFINITIONS) <= set(row)


def test_missions_are_drawn_by_seed_and_the_first_do_not_depend_on_their_number():
    network = grid_network(np.random.default_rng(1), columns=3, rows=3)
    mapped = np.ones(network.lane_count, dtype=bool)
    few, many = draw_missions(network, mapped, 3, 2, frozenset()), draw_missions(network, mapped, 3, 4, frozenset())
    assert few == many[:2] and draw_missions(network, mapped, 4, 2, frozenset()) != few
    assert all(mission.shortest_m > 100.0 for mission in many)
    closed = int(network.lane_edge[network.lane_ids.index(few[0].goal_lane)])
    other = draw_missions(network, mapped, 3, 1, frozenset({closed}))[0]
    assert other.goal_lane != few[0].goal_lane


def test_the_table_fits_a_terminal():
    drive = row_result([mission_result(MISSION, flight(), NETWORK, 20.0)], 12.0)
    place = Network(path=None, generator="grid", edges=2, km=0.2)
    rows = tuple(Row(method=row.label, drive=drive) for row in ROWS)
    results = Results(
        scenarios=(ScenarioResult(name="x" * 60, seed=1, network=place, noise="paper", frames=0, duration_s=0.0, rows=rows),)
    )
    assert max(map(len, table_lines(results))) <= 80


def test_a_row_that_there_is_not_is_refused():
    with pytest.raises(HippodromeError, match="choose from ours"):
        row_named("theirs")


def test_rows_have_the_same_keys_everywhere():
    keys = tuple(row.key for row in ROWS)
    assert keys == get_args(RowKey) == ROW_KEYS
    with pytest.raises(HippodromeError, match="a row of ours is called so"):
        policy_row(Policy("truth", "my_module:Mine"))


def test_rows_of_an_evaluation_in_the_same_folder_are_kept(tmp_path):
    place = {"network": Network(edges=2, km=0.2), "noise": "paper", "frames": 0, "duration_s": 0.0, "configuration": {}}
    drive = row_result([mission_result(MISSION, flight(), NETWORK, 20.0)], 12.0)
    mapped, old, new = Row(method="topometric"), Row(method="old", drive=drive), Row(method="ours", drive=drive)
    earlier, now, other = (
        Results(scenarios=(ScenarioResult(name="town", seed=seed, rows=rows, **place),))
        for seed, rows in ((1, (mapped, old)), (1, (new,)), (2, (new,)))
    )
    write_results(tmp_path / "results.json", earlier)
    assert [row.method for row in with_earlier(now, tmp_path / "results.json").scenarios[0].rows] == ["topometric", "ours"]
    assert with_earlier(other, tmp_path / "results.json") == other
    (tmp_path / "results.json").write_text("{")
    assert with_earlier(now, tmp_path / "results.json") == now == with_earlier(now, tmp_path / "absent.json")
