"""The navigator drives a kinematic bicycle: to its goal, round what is closed, and to a stop where a sensor fails."""

import subprocess
import sys

import numpy as np
import pytest

from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.types import DrivingState, Goal, Lamp, Radar
from hippodrome.core.types import HippodromeError
from tests.core.navigation.roads import GREY, Bicycle, map_along, ring


def started(goal, pose=(20.0, 0.0, 0.0)):
    network, car = ring(), Bicycle(pose)
    navigator = Navigator(map_along(network), network, NavigatorConfig(read_road=False), poses=car)
    navigator.set_goal(goal)
    return navigator, car


def driven(navigator, car, seconds, radar=lambda car: Radar(), frame=lambda car: GREY, noise=1e-4):
    for _ in range(round(10 * seconds)):
        command = navigator.step(car.sense(frame(car), noise), radar(car))
        if command.state is DrivingState.ARRIVED and car.speed == 0.0:
            break
        car.drive(command)
    return command


def test_it_arrives_within_a_metre_and_says_so():
    navigator, car = started(Goal(0.0, 60.0, -0.5 * np.pi))
    command = driven(navigator, car, 120.0)
    assert command.state is DrivingState.ARRIVED
    assert np.hypot(car.pose[0], car.pose[1] - 60.0) < 1.0


def test_it_keeps_its_lane_round_the_corners():
    navigator, car = started(Goal(0.0, 60.0, -0.5 * np.pi))
    worst = 0.0
    for _ in range(600):
        command = navigator.step(car.sense(), Radar())
        car.drive(command)
        x, y = car.pose[:2]
        inside = min(x, y, 100.0 - x, 100.0 - y)  # the sides lie on the square's rim
        corner = max(abs(x - 50.0), abs(y - 50.0)) > 40.0 and min(abs(x - 50.0), abs(y - 50.0)) > 40.0
        worst = worst if corner or car.speed < 0.5 else max(worst, abs(inside))
    assert worst < 0.5


def test_it_stops_before_a_red_light_and_goes_on_at_green():
    navigator, car = started(Goal(100.0, 60.0, 0.5 * np.pi))
    driven(navigator, car, 25.0, radar=lambda car: Radar(lamp=Lamp.RED if car.pose[0] > 60.0 else Lamp.NONE))
    assert car.speed == 0.0 and 92.0 - 4.0 < car.pose[0] + 3.6 < 92.0
    assert driven(navigator, car, 60.0).state is DrivingState.ARRIVED


def test_it_stays_behind_who_stands_ahead():
    navigator, car = started(Goal(0.0, 60.0, -0.5 * np.pi))
    driven(navigator, car, 25.0, radar=lambda car: Radar(max(70.0 - car.pose[0] - 3.6, 0.0), car.speed))
    assert car.speed < 1e-3 and 0.5 < 70.0 - car.pose[0] - 3.6 < 5.0


@pytest.mark.parametrize(
    ("frame", "radar", "reason"),
    [
        (None, Radar(), "there are no frames"),
        (np.zeros_like(GREY), Radar(), "the frames are black"),
        (GREY, Radar(blind=True), "the radar is blind"),
    ],
)
def test_it_halts_and_says_why_where_a_sensor_fails_and_goes_on_afterwards(frame, radar, reason):
    navigator, car = started(Goal(0.0, 60.0, -0.5 * np.pi))
    driven(navigator, car, 5.0)
    assert car.speed > 3.0
    command = driven(navigator, car, 8.0, radar=lambda car: radar, frame=lambda car: frame)
    assert command.state is DrivingState.HALTED and command.reason == reason and car.speed == 0.0
    assert driven(navigator, car, 90.0).state is DrivingState.ARRIVED


def test_it_halts_where_the_gyro_freezes():
    navigator, car = started(Goal(0.0, 60.0, -0.5 * np.pi))
    driven(navigator, car, 5.0)
    for _ in range(90):
        sensed = car.sense()
        frozen = type(sensed)(sensed.t_s, sensed.dt_s, sensed.speed, 0.0123, sensed.frame)
        command = navigator.step(frozen, Radar())
        car.drive(command)
    assert command.state is DrivingState.HALTED and command.reason == "the gyro is frozen" and car.speed == 0.0


def test_a_goal_off_the_roads_is_refused():
    with pytest.raises(HippodromeError, match="no lane of this direction"):
        started(Goal(50.0, 50.0, 0.0))


def test_without_a_goal_it_stands():
    network, car = ring(), Bicycle((20.0, 0.0, 0.0))
    navigator = Navigator(map_along(network), network, poses=car)
    command = navigator.step(car.sense(), Radar())
    assert command.state is DrivingState.HALTED and command.acceleration_mps2 < 0.0


def test_nothing_that_drives_reaches_the_simulator_or_the_truth():
    code = (
        "import sys; import hippodrome.core.navigation.navigator, hippodrome.core.reading.reader, "
        "hippodrome.core.localization.localizer; "
        "print([m for m in sys.modules if m.startswith(('hippodrome.sim', 'hippodrome.eval', 'libsumo', 'highway_env'))])"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip() == "[]"
