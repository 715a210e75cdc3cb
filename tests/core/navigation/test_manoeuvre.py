"""Manoeuvres, driven by a bicycle that is not quite what they expect: they end where they should, and stop for others."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation import motion as motions
from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.navigation.manoeuvre import BackOff, Sensed, Turn
from hippodrome.core.navigation.motion import Motion
from hippodrome.core.navigation.turning import Clearance, is_clear, plan_turn, poses_along
from hippodrome.core.navigation.types import DrivingState, Radar
from tests.core.navigation.roads import Bicycle

VEHICLE = VehicleShape()


def driven(manoeuvre, car, seconds, radar=lambda car: Radar()):
    """Poses (n, 3) until the manoeuvre is over, and whether it was."""
    motion, poses, before = Motion(steering_rad=car.wheels), [car.pose.copy()], car.pose.copy()
    for _ in range(round(10 * seconds)):
        step = math.copysign(math.dist(car.pose[:2], before[:2]), car.speed)
        command = manoeuvre.step(Sensed(motion, radar(car), car.pose.copy(), step, car.pose[2] - before[2], 0.1))
        if command is None:
            return np.array(poses), True
        before = car.pose.copy()
        motion = motions.commanded(motion, command.acceleration_mps2, command.steering_rad, 0.1, command.reverse)
        car.drive(command)
        motion = Motion(car.speed, motion.steering_rad)
        poses.append(car.pose.copy())
    return np.array(poses), False


@pytest.mark.parametrize("width_m", [6.4, 10.0])
@pytest.mark.parametrize("lock", [0.95, 1.0])
def test_a_turn_with_a_car_that_turns_less_than_it_should_stays_on_the_paving(width_m, lock):
    class Lazy(Bicycle):
        def drive(self, command, dt_s=0.1):
            turned = type(command)(command.acceleration_mps2, lock * command.steering_rad, reverse=command.reverse)
            super().drive(turned, dt_s)

    def room(points):
        return np.minimum(points[:, 1] + 0.25 * width_m, 0.75 * width_m - points[:, 1])

    car = Lazy((0.0, 0.0, 0.02))

    def replan(first):
        return plan_turn(car.pose.tolist(), (0.0, 0.5 * width_m, math.pi), room, VEHICLE, Clearance(0.2, 0.0), first)

    def is_free(leg):
        return bool(is_clear(poses_along(car.pose, leg)[1:], room, VEHICLE, Clearance(0.05, -0.2)).all())

    poses, over = driven(Turn(replan, is_free, replan(0), DrivingState.DRIVING, VEHICLE), car, 90.0)
    assert over and abs(math.remainder(poses[-1, 2] - math.pi, math.tau)) < 0.1
    assert is_clear(poses, room, VEHICLE, Clearance(0.0, -0.25)).all()
    assert abs(poses[-1, 1] - 0.5 * width_m) < 1.6


def test_a_turn_waits_for_who_moves_near_and_for_who_stands_in_its_way():
    car = Bicycle((0.0, 0.0, 0.0))

    def replan(first):
        return plan_turn(car.pose.tolist(), (0.0, 3.2, math.pi), lambda p: np.minimum(p[:, 1] + 1.6, 4.8 - p[:, 1]), VEHICLE)

    turn = Turn(replan, lambda leg: True, replan(0), DrivingState.DRIVING, VEHICLE)
    poses, over = driven(turn, car, 20.0, lambda car: Radar(moving_m=8.0))
    assert not over and np.ptp(poses, axis=0).max() == 0.0
    poses, over = driven(turn, car, 5.0, lambda car: Radar(gap_m=0.7, gap_behind_m=0.7))
    assert not over and np.ptp(poses[:, :2], axis=0).max() < 0.05


def test_it_backs_along_the_bend_that_it_came():
    angle = np.linspace(0.0, 1.2, 40)
    trail = np.stack([8.0 * np.sin(angle), 8.0 - 8.0 * np.cos(angle), angle], axis=1)
    car = Bicycle(trail[-1] + [0.1, -0.1, 0.05])
    poses, over = driven(BackOff(trail, 5.0, DrivingState.SEARCHING, VEHICLE), car, 30.0)
    assert over and math.dist(poses[0, :2], poses[-1, :2]) == pytest.approx(5.0, abs=0.3)
    off = np.abs(np.hypot(poses[:, 0], poses[:, 1] - 8.0) - 8.0)
    assert off[-1] < 0.1 and off.max() < 0.3


def test_it_backs_no_farther_than_it_came_nor_into_somebody():
    trail = np.stack([np.linspace(0.0, 3.0, 13), np.zeros(13), np.zeros(13)], axis=1)
    car = Bicycle(trail[-1])
    poses, over = driven(BackOff(trail, 8.0, DrivingState.SEARCHING, VEHICLE), car, 30.0)
    assert over and -0.5 < poses[-1, 0] < 0.3
    back = BackOff(trail, 8.0, DrivingState.SEARCHING, VEHICLE)
    car = Bicycle(trail[-1])
    poses, over = driven(back, car, 30.0, lambda car: Radar(gap_behind_m=max(car.pose[0] - 1.0, 0.0)))
    assert over and back.failed and poses[-1, 0] > 1.4


def test_the_motion_counts_backwards_and_brakes_before_it_changes():
    motion = motions.commanded(Motion(speed_mps=1.0), 2.0, 0.0, 0.1, reverse=True)
    assert motion.speed_mps == pytest.approx(0.8)
    for _ in range(10):
        motion = motions.commanded(motion, 2.0, 0.0, 0.1, reverse=True)
    assert motion.speed_mps == pytest.approx(-1.0)
    assert motions.commanded(motion, -3.0, 0.0, 1.0, reverse=True).speed_mps == 0.0
    assert motions.commanded(motion, 3.0, 0.0, 0.1).speed_mps == pytest.approx(-0.7)


def test_a_turn_lets_those_pass_who_come_while_it_is_under_way():
    car = Bicycle((0.0, 0.0, 0.0))

    def replan(first):
        return plan_turn(car.pose.tolist(), (0.0, 3.2, math.pi), lambda p: np.minimum(p[:, 1] + 1.6, 4.8 - p[:, 1]), VEHICLE)

    turn, clock = Turn(replan, lambda leg: True, replan(0), DrivingState.DRIVING, VEHICLE), [0.0]

    def comes(car):
        """Somebody comes at 7 m/s from 4 s on, passes at 8.5 s, and is gone."""
        clock[0] += 0.1
        away_m = 7.0 * abs(8.5 - clock[0])
        return Radar(moving_m=away_m if 4.0 < clock[0] < 12.0 and away_m < 50.0 else math.inf)

    poses, _ = driven(turn, car, 16.0, comes)
    speed = np.hypot(*np.diff(poses[:, :2], axis=0).T) / 0.1
    assert speed[40:55].max() > 0.3  # far away it does not matter
    assert speed[70:84].max() < 0.05  # it stands as he passes
    assert speed[95:].max() > 0.3
