"""The environment of Gymnasium: its own checker, what is observed and paid, and a lane keeper of thirty lines."""

import runpy
import tomllib
import warnings
from importlib import import_module
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from hippodrome._gymnasium import register
from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.reward import FINES_M
from hippodrome.sim.loop.types import EventKind
from hippodrome.sim.loop.wrappers import SiUnits, without_truth
from tests.sim.loop import small

register()


@pytest.fixture
def make(tmp_path):
    made = []

    def make(vehicles=0, scenario=None, **options):
        scenario = scenario or small.scenario(vehicles=vehicles)
        made.append(gymnasium.make("hippodrome/Town-v0", scenario=scenario, root=tmp_path, **options))
        return made[-1]

    yield make
    for env in made:
        env.close()


def test_the_entry_point_is_the_one_that_registers():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    module, _, name = project["entry-points"]["gymnasium.envs"]["hippodrome"].partition(":")
    assert getattr(import_module(module), name) is register


@pytest.mark.parametrize("options", [{}, {"radar": True, "indicators": True}])
def test_gymnasiums_own_checker_is_content(make, options):
    env = make(3, render_mode="rgb_array", **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_same_seed_gives_the_same_drive(make):
    env = make(4, duration_s=1.0)
    runs = []
    for _ in range(2):
        observed, info = env.reset(seed=7)
        run = [observed["frame"].copy()]
        truncated = False
        while not truncated:
            observed, reward, _, truncated, info = env.step(np.array([0.4, 0.02], dtype=np.float32))
            run += [observed["frame"].copy(), observed["speed"], observed["yaw_rate"], reward, info["truth"]["x_m"]]
        runs.append(run)
    assert len(runs[0]) == 51
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))


@pytest.mark.parametrize(("view", "shape"), [("camera", (120, 160, 3)), ("top", (480, 480, 3)), ("both", (480, 1120, 3))])
def test_pictures(make, view, shape):
    env = make(2, render_mode="rgb_array", view=view)
    env.reset(seed=1)
    picture = env.render()
    assert picture.shape == shape
    assert picture.dtype == np.uint8
    assert picture.std() > 10.0


def test_driving_is_paid_and_the_ditch_is_fined(make):
    env = SiUnits(make())
    env.reset(seed=1)
    fines = {}
    for _ in range(10):
        _, reward, _, _, info = env.step(np.array([2.0, 0.0]))
        assert reward == pytest.approx(info["truth"]["speed_mps"] * 0.1, rel=0.01)
    for _ in range(40):
        _, reward, _, _, info = env.step(np.array([0.0, 0.5]))
        fines |= info["fines"]
    assert fines[EventKind.KERB] == FINES_M[EventKind.KERB]


def test_si_units_are_what_the_car_does(make):
    env = SiUnits(make())
    env.reset(seed=1)
    for _ in range(10):
        *_, info = env.step(np.array([1.5, 0.1]))
    assert info["truth"]["acceleration_mps2"] == pytest.approx(1.5, abs=0.02)
    assert info["truth"]["steering_rad"] == pytest.approx(0.1)
    assert env.action_space.contains(np.array([4.0, 0.0], dtype=np.float32))


def test_a_policy_under_test_gets_no_truth(make):
    env = without_truth(make())
    assert env.reset(seed=1)[1] == {}
    assert env.step(env.action_space.sample())[4] == {}


def test_goal_and_start_by_options(make):
    env = make()
    world = env.unwrapped.world
    lane = int(np.flatnonzero(~world.network.is_internal)[0])
    start, goal = (world.network.lane_ids[lane], 5.0), world.ground.pose_at(lane, 15.0)
    _, info = env.reset(seed=1, options={"start": start, "goal": goal})
    assert info["truth"]["lane_id"] == start[0]
    terminated = False
    for k in range(100):
        _, _, terminated, _, info = env.step(np.array([0.3 if k < 30 else -1.0, 0.0]))
        if terminated:
            break
    assert terminated
    assert abs(info["truth"]["lane_position_m"] - 15.0) < 3.0
    with pytest.raises(HippodromeError, match="options has 'begin'"):
        env.reset(options={"begin": start})


def test_the_lane_keeper_of_the_examples_runs_and_is_scored(tmp_path):
    """Thirty lines of a stranger, which know nothing but what is observed."""
    keeper = runpy.run_path(str(Path(__file__).parents[3] / "examples/loop/lane_keeper.py"))
    worth = keeper["main"](small.scenario(vehicles=2), seed=3, root=tmp_path, duration_s=8.0)
    assert worth > 10.0
