"""Missions in the loop with a policy of others, and with sensors that fail in the middle: no crash, a stop, and a reason."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.types import DrivingState, Radar
from hippodrome.eval.drive import flight
from hippodrome.eval.drive.flight import fly
from hippodrome.eval.drive.foreign import Policy
from hippodrome.eval.drive.rows import policy_row, row_named
from tests.eval.drive.test_foreign import EXAMPLES

FAILS_S, WHOLE_S = 6.0, 17.0


@pytest.fixture
def world(hamlet):
    with hamlet.world() as world:
        yield world


def test_the_lane_keeper_of_the_examples_drives_a_mission(hamlet, world, monkeypatch):
    monkeypatch.setattr(flight, "LONGEST_S", 12.0)
    monkeypatch.chdir(EXAMPLES)
    flown = fly(world, hamlet.mission(), hamlet.cockpit(policy_row(Policy("keeper", "lane_keeper:policy"))))
    assert flown.cause.startswith("time is up") and not flown.failure and not flown.arrived
    assert flown.column("driven_m")[-1] > 8.0 and flown.cpu_s > 0.0
    assert np.isnan(flown.column("estimate_x_m")).all() and not flown.column("localized").any()


@pytest.mark.parametrize(
    ("sensed", "reason"),
    [
        (lambda observation, radar: (replace(observation, frame=None), radar), "there are no frames"),
        (lambda observation, radar: (_black(observation), radar), "the frames are black"),
        (lambda observation, radar: (replace(observation, yaw_rate_radps=0.0123), radar), "the gyro is frozen"),
        (lambda observation, radar: (observation, Radar(blind=True)), "the radar is blind"),
    ],
    ids=["missing", "black", "gyro", "radar"],
)
def test_a_sensor_that_fails_for_five_seconds_stops_the_vehicle_which_says_why(hamlet, world, monkeypatch, sensed, reason):
    monkeypatch.setattr(flight, "LONGEST_S", WHOLE_S)
    said, step = [], Navigator.step

    def failing(navigator, observation, radar):
        fails = FAILS_S < observation.t_s <= FAILS_S + 5.0
        command = step(navigator, *(sensed(observation, radar) if fails else (observation, radar)))
        said.append((command.state, command.reason))
        return command

    monkeypatch.setattr(Navigator, "step", failing)
    flown = fly(world, hamlet.mission(), hamlet.cockpit(row_named("truth")))
    assert (DrivingState.HALTED, reason) in said
    t_s, speed = flown.column("t_s"), flown.column("speed_mps")
    fast, slow = (float(speed[np.abs(t_s - when) < 0.06].max()) for when in (FAILS_S, FAILS_S + 5.0))
    assert slow < 0.5 < 2.0 < fast
    assert speed[-1] > 1.0  # and goes on when the sensor is back
    assert not [event for event in flown.events if event.at_fault]


def _black(observation):
    return observation if observation.frame is None else replace(observation, frame=np.zeros_like(observation.frame))
