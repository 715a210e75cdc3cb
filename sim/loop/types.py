"""What goes into the world in the loop, and what comes out of it at each step."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hippodrome.core.navigation.types import Indicator, Radar
from hippodrome.core.types import FloatArray, GroundTruth, Observation


@dataclass(frozen=True, slots=True)
class LanePlace:
    """A place on a lane: where the rear axle stands, in the lane's middle and along it.

    Args:
        lane_id: SUMO's name of the lane, as in ``RoadNetwork.lane_ids``.
        position_m: arc length of the rear axle along the lane's centreline as drawn.
    """

    lane_id: str
    position_m: float


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the ego really is and what it really does. It goes to the scoring only.

    Args:
        t_s: time since the reset, seconds.
        x_m, y_m, heading_rad: the rear axle's pose in the network frame.
        speed_mps: of the rear axle, along the slope, negative backwards.
        yaw_rate_radps: counter-clockwise positive.
        acceleration_mps2: what was carried out over the last step, after the vehicle's limits.
        steering_rad: where the road wheels are, left positive.
        indicator: the turn indicator that others see.
        lane: index into ``RoadNetwork.lane_ids`` of the lane that the rear axle is on, -1 off the road.
        lane_id: its name, empty off the road.
        lane_position_m: arc length of the rear axle's projection on that lane; nan off the road.
        offset_m: of the rear axle from the lane's middle, left positive; nan off the road.
        lane_heading_error_rad: heading of the vehicle against the lane's; nan off the road.
        wheel_outside_m: how far the worst wheel is outside of the lane and those beside it in the same direction or, in a
            junction and while it turns round, off the paving; 0 inside.
        off_paving_m: how far the worst wheel is off everything paved for cars: lanes, junctions, turning places; 0 on it.
        in_junction: whether the rear axle is on a lane inside a junction.
        driven_m: way of the rear axle since the reset, seen from above.
    """

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    yaw_rate_radps: float
    acceleration_mps2: float
    steering_rad: float
    indicator: Indicator
    lane: int
    lane_id: str
    lane_position_m: float
    offset_m: float
    lane_heading_error_rad: float
    wheel_outside_m: float
    off_paving_m: float
    in_junction: bool
    driven_m: float

    @property
    def pose_m(self) -> tuple[float, float, float]:
        """The rear axle's pose in the network frame."""
        return self.x_m, self.y_m, self.heading_rad

    @property
    def on_paving(self) -> bool:
        """Whether every wheel stands on a lane, a junction or a turning place."""
        return self.off_paving_m <= 0.0

    def ground_truth(self) -> GroundTruth:
        """The same as recordings have it."""
        return GroundTruth(self.t_s, self.x_m, self.y_m, self.heading_rad, self.speed_mps, self.lane_id, self.lane_position_m)


class EventKind(StrEnum):
    """What the world detects and logs; ``sim/loop/events.py`` defines each."""

    COLLISION = "collision"
    BUILDING = "building"
    KERB = "kerb"
    LEFT_LANE = "left lane"
    LEFT_ROAD = "left road"
    WRONG_WAY = "wrong way"
    RED_LIGHT = "red light"
    RIGHT_OF_WAY = "right of way"
    PUT_BACK = "put back"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened, logged once at its beginning.

    Args:
        kind: what.
        t_s: when, in seconds since the reset.
        x_m, y_m: where the ego's rear axle was, in the network frame.
        at_fault: whether the ego is to blame for it.
        lane_id: the ego's lane, empty off the road.
        other: SUMO's name of the other vehicle, lane or signal, empty where there is none.
        text: one short sentence for people.
    """

    kind: EventKind
    t_s: float
    x_m: float
    y_m: float
    at_fault: bool
    lane_id: str
    other: str = ""
    text: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """The answer to a step. Only ``observation`` and ``radar`` may reach a navigator.

    Args:
        observation: frame, speed and yaw rate as the vehicle senses them.
        radar: what driver assistance tells.
        truth: for the scoring.
        events: those that began in this step.
        traffic: poses (k, 3) of the centres of the vehicles near the ego, (k, 5) with height and pitch where roads climb;
            for pictures and the scoring.
    """

    observation: Observation
    radar: Radar
    truth: Truth
    events: tuple[Event, ...]
    traffic: FloatArray
