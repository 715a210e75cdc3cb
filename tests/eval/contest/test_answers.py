"""Answers that are none: each is a sentence, whatever a method gives in place of a trajectory, a pose or a cost."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.contest.answers import numbers, sound_cost, sound_estimates, sound_map
from hippodrome.eval.methods.protocol import Answer, Cost, Localized, Mapped, as_answers, as_estimate, as_mapped

T_S, POSES = np.arange(4.0), np.zeros((4, 3))


def mapped(**changes):
    return replace(Mapped(Trajectory(T_S, POSES)), **changes)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"trajectory": None}, "its trajectory is None, not a Trajectory"),
        ({"trajectory": Trajectory(T_S.astype(str), POSES)}, "no real numbers, but an array of <U"),
        ({"trajectory": Trajectory(T_S, POSES + 1j)}, "no real numbers, but an array of complex128"),
        ({"trajectory": Trajectory([0.0, None], [[0.0] * 3] * 2)}, "no real numbers"),
        ({"trajectory": Trajectory(T_S, POSES + 1e300)}, r"sample 0 is beyond 1e\+12"),
        ({"trajectory": Trajectory(T_S, POSES[:3])}, "do not fit"),
        ({"live": "poses"}, "live: its trajectory is a str"),
        ({"live": Trajectory(T_S, POSES * math.nan)}, "live: sample 0 is not finite"),
        ({"cognitive_map": "a map"}, "its cognitive_map is a str"),
        ({"figures": None}, "its figures are no dictionary"),
        ({"figures": {3: 4}}, "its figures are no dictionary"),
        ({"figures": {"ape": 0.1}}, "'ape', which is measured here"),
        ({"figures": {"method": "ours"}}, "'method', which is measured here"),
        ({"figures": {"mine": math.nan}}, "its figure 'mine'"),
        ({"figures": {"mine": np.zeros(3)}}, "its figure 'mine'"),
        ({"figures": {"vertices": "many"}}, "its figure 'vertices'"),
        ({"cost": "cheap"}, "its cost is a str"),
    ],
)
def test_what_is_no_map_is_a_sentence(changes, cause):
    with pytest.raises(HippodromeError, match=cause):
        sound_map(mapped(**changes), "mine")


def test_a_map_keeps_its_bytes_and_numbers_may_be_of_any_real_kind():
    found = sound_map(mapped(trajectory=Trajectory([0, 1], [[0, 0, 0], [1, 0, 0]]), figures={"mine": np.float32(1.5)}), "mine")
    assert found.trajectory.poses.dtype == np.float64
    assert found.figures == {"mine": 1.5}
    assert sound_map(mapped(), "mine").trajectory.poses is POSES


def test_what_saves_is_a_function():
    with pytest.raises(HippodromeError, match="its save is a str"):
        as_mapped(mapped(save="there"), "mine")


@pytest.mark.parametrize("cost", [Cost(-1.0), Cost(math.nan), Cost(1.0, None, np.array([math.nan])), Cost("much")])
def test_costs_are_numbers_from_zero_on(cost):
    with pytest.raises(HippodromeError, match="its cost"):
        sound_cost(cost, "mine")


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"t_s": None}, "gave a time"),
        ({"t_s": "1.0"}, "gave a time"),
        ({"pose": np.zeros(2)}, "a pose of shape"),
        ({"pose": np.full(3, np.nan)}, "a pose that is not finite"),
        ({"pose": np.full(3, 1e300)}, "a pose that is not finite, or beyond"),
        ({"covariance": np.eye(2)}, "a covariance of shape"),
        ({"covariance": np.full((3, 3), np.nan)}, "a covariance that is none"),
        ({"covariance": -np.eye(3)}, "a covariance that is none"),
        ({"covariance": np.triu(np.ones((3, 3)))}, "a covariance that is none"),
        ({"localized": "yes"}, "True or False is expected"),
    ],
)
def test_what_is_no_answer_is_a_sentence(changes, cause):
    sound = as_estimate(Answer(1.0, 0.0, 0.0, 0.0, covariance=np.eye(3)), "mine")
    assert sound_estimates([sound], "mine")[0].localized is True
    with pytest.raises(HippodromeError, match=cause):
        sound_estimates([replace(sound, **changes)], "mine")


def test_who_is_not_localized_needs_no_pose():
    nowhere = replace(as_estimate(Answer(1.0, 0.0, 0.0, 0.0, localized=False), "mine"), pose=np.full(3, np.nan))
    assert sound_estimates([nowhere], "mine")[0].pose.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "odd", [{"x_m": "x"}, {"covariance": "small"}, {"localized": np.array([True, False])}, {"x_m": math.inf}]
)
def test_an_answer_that_is_not_made_of_numbers_is_a_sentence(odd):
    with pytest.raises(HippodromeError, match="mine: localize"):
        as_estimate(replace(Answer(1.0, 0.0, 0.0, 0.0), **odd), "mine")


@pytest.mark.parametrize(
    ("given", "cause"),
    [
        (None, "map.. gave None, as a function does that has no return and no yield; return a Trajectory, or yield"),
        (3, "map.. gave a int; return a Trajectory"),
        ([], "map.. gave no poses"),
        ("abcd", "its pose 0 is a str"),
        ({"t_s": 1.0}, "its pose 0 is a str"),
        ([(0.0, 1.0, 2.0)], "its pose 0 is of 3 values"),
        ([(0.0, 1.0, 2.0, 3.0), (1.0, 2.0)], "its pose 1 is of 2 values"),
        ((T_S, POSES), "its pose 1 is not made of numbers"),
        ((np.arange(9.0), np.zeros((9, 3))), "its pose 0 is of more than 4 values"),
        ([(0.0, 1.0, 2.0, None)], r"its pose 0 is not made of numbers \(float, float, float, NoneType\)"),
        ([None], "its pose 0 is None"),
        ([(0.0, 1.0, 2.0, 10**400)], "its pose 0 is not made of numbers"),
    ],
)
def test_whatever_map_gives_is_a_trajectory_or_a_sentence(given, cause):
    with pytest.raises(HippodromeError, match=f"mine: {cause}|mine: map.. gave no trajectory: {cause}"):
        as_mapped(given, "mine")


@pytest.mark.parametrize("given", [None, 3, "abc", {"a": 1}, Answer(0.0, 0.0, 0.0, 0.0), Localized(None, Cost(0.0))])
def test_whatever_localize_gives_is_answers_or_a_sentence(given):
    with pytest.raises(HippodromeError, match=r"mine: localize.. gave .*; yield one Answer"):
        as_answers(given, "mine")


@pytest.mark.parametrize("given", [None, (0.0, 1.0, 2.0, 3.0), 1.0, np.zeros(4)])
def test_whatever_stands_for_an_answer_is_one_or_a_sentence(given):
    with pytest.raises(HippodromeError, match=r"mine: localize.. gave .* as an answer; yield one Answer"):
        as_estimate(given, "mine")


def test_numbers_are_real():
    assert numbers([True and 1, 2.5], "it").tolist() == [1.0, 2.5]
    for odd in ("abc", None, [1.0, None], [[1.0], [1.0, 2.0]], 1j, object()):
        with pytest.raises(HippodromeError, match="it: no real numbers"):
            numbers(odd, "it")
