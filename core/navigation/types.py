"""What travels between the vehicle in the loop and its navigator."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum


class Lamp(IntEnum):
    """The state of the signal that applies to the vehicle's lane at the junction ahead."""

    NONE = 0  # no signal within the sensor's reach
    GREEN = 1
    YELLOW = 2
    RED = 3


class Indicator(IntEnum):
    """The turn indicator: what the driver means to do at the junction ahead, as other road users see it."""

    RIGHT = -1
    STRAIGHT = 0
    LEFT = 1


@dataclass(frozen=True, slots=True)
class Radar:
    """What driver assistance tells of the surroundings: noisy, and without any knowledge of a map or of the vehicle's place.

    Args:
        gap_m: from the front bumper to the nearest road user ahead in the vehicle's path; ``inf`` if there is none in reach.
        closing_mps: rate at which that gap shrinks; 0 without one.
        way_is_free: nobody who has the right of way is coming to the junction ahead, for the movement that is indicated.
        lamp: the signal ahead.
        blind: the sensor delivers nothing; the other fields then mean nothing.
        gap_behind_m: from the rear bumper to the nearest road user in the vehicle's path backwards; ``inf`` if there is none in
            reach.
        moving_m: from the body to the nearest road user that moves, in any direction; ``inf`` if there is none in reach.
    """

    gap_m: float = math.inf
    closing_mps: float = 0.0
    way_is_free: bool = True
    lamp: Lamp = Lamp.NONE
    blind: bool = False
    gap_behind_m: float = math.inf
    moving_m: float = math.inf


@dataclass(frozen=True, slots=True)
class Goal:
    """Where to stop, in the network frame: the rear axle's place, and the heading of the lane there."""

    x_m: float
    y_m: float
    heading_rad: float


class DrivingState(IntEnum):
    """What the navigator is doing, as it says itself."""

    SEARCHING = 0  # no fix: keeps its lane and looks for known ground
    DRIVING = 1  # follows its plan
    DOUBTING = 2  # doubts its place: slows down
    HALTED = 3  # stands because something is wrong: no frames, a blind radar, no way to the goal
    ARRIVED = 4  # stands at the goal, and says so


@dataclass(frozen=True, slots=True)
class Command:
    """What the vehicle is to do over the next step, and why.

    Args:
        acceleration_mps2: in the direction of the gear; negative brakes.
        steering_rad: of the road wheels, left positive.
        indicator: the turn indicator.
        state: what the navigator is doing.
        reason: one short sentence for people; empty where nothing is special.
        reverse: the reverse gear. A vehicle that still rolls forwards brakes first, with the acceleration's magnitude.
    """

    acceleration_mps2: float
    steering_rad: float
    indicator: Indicator = Indicator.STRAIGHT
    state: DrivingState = DrivingState.SEARCHING
    reason: str = ""
    reverse: bool = False
