"""Missions in the loop over the stream: what is sensed, roads and commands, to and from messages of ``method_stream.proto``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np

from hippodrome.core.navigation.types import Command, DrivingState, Goal, Indicator, Lamp, Radar
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, Observation
from hippodrome.proto import method_stream_pb2 as pb

INDICATORS: Final = {
    Indicator.STRAIGHT: pb.Command.STRAIGHT,
    Indicator.LEFT: pb.Command.LEFT,
    Indicator.RIGHT: pb.Command.RIGHT,
}
MOST_REASON: Final = 200  # characters of a reason that are kept


def observation_message(one: Observation) -> pb.Observation:
    """An observation, with its frame where it has one."""
    message = pb.Observation(t_s=one.t_s, dt_s=one.dt_s, speed=one.speed, yaw_rate_radps=one.yaw_rate_radps)
    if one.frame is not None:
        message.height, message.width = one.frame.shape[:2]
        message.channels = 1 if one.frame.ndim == 2 else 3
        message.pixels = one.frame.tobytes()
    return message


def observation_of(message: pb.Observation) -> Observation:
    """The observation of a message; its frame may be written to."""
    frame = None
    if message.width:
        shape = (message.height, message.width) if message.channels == 1 else (message.height, message.width, message.channels)
        frame = np.frombuffer(message.pixels, np.uint8).reshape(shape).copy()
    return Observation(message.t_s, message.dt_s, message.speed, message.yaw_rate_radps, frame)


def radar_message(radar: Radar) -> pb.Radar:
    """What the radar says."""
    return pb.Radar(
        gap_m=radar.gap_m,
        closing_mps=radar.closing_mps,
        way_is_free=radar.way_is_free,
        lamp=int(radar.lamp),
        blind=radar.blind,
        gap_behind_m=radar.gap_behind_m,
        moving_m=radar.moving_m,
    )


def radar_of(message: pb.Radar) -> Radar:
    """The radar of a message."""
    return Radar(
        message.gap_m,
        message.closing_mps,
        message.way_is_free,
        Lamp(message.lamp),
        message.blind,
        message.gap_behind_m,
        message.moving_m,
    )


def goal_of(message: pb.Pose) -> Goal:
    """The goal of a message."""
    return Goal(message.x, message.y, message.heading_rad)


def command_message(command: Command) -> pb.Command:
    """A command. Raises HippodromeError unless it is a whole one."""
    if not isinstance(command, Command):
        raise HippodromeError(f"step() gave a {type(command).__name__}; a hippodrome Command is expected")
    return pb.Command(
        acceleration_mps2=command.acceleration_mps2,
        steering_rad=command.steering_rad,
        indicator=INDICATORS[Indicator(command.indicator)],
        state=int(command.state),  # type: ignore[arg-type]
        reason=command.reason,
        reverse=command.reverse,
    )


def command_of(message: pb.Command) -> Command:
    """The command of a message. Raises HippodromeError if it is none."""
    numbers = message.acceleration_mps2, message.steering_rad
    if not all(map(math.isfinite, numbers)):
        raise HippodromeError(f"it commanded an acceleration of {numbers[0]} and a steering of {numbers[1]}; both must be finite")
    try:
        indicator = {number: name for name, number in INDICATORS.items()}[message.indicator]
        state = DrivingState(message.state)
    except (KeyError, ValueError):
        raise HippodromeError(f"it sent indicator {message.indicator} and state {message.state}, which are unknown") from None
    return Command(*numbers, indicator, state, _printable(message.reason[:MOST_REASON]), message.reverse)


def _printable(text: str) -> str:
    """Text that cannot command a terminal: it is a stranger's, and shown in the progress, the page and films."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def lane_messages(roads: RoadNetwork) -> Iterator[pb.Lane]:
    """All lanes with all that is known of them, in their order."""
    for lane in range(roads.lane_count):
        points_m = roads.lane_points_m(lane)
        message = pb.Lane(
            x_m=points_m[:, 0].tolist(),
            y_m=points_m[:, 1].tolist(),
            id=roads.lane_ids[lane],
            edge=roads.edge_ids[roads.lane_edge[lane]],
            internal=bool(roads.is_internal[lane]),
            width_m=float(roads.width_m[lane]),
            speed_limit_mps=float(roads.speed_limit_mps[lane]),
            successors=roads.successors(lane).tolist(),
        )
        if roads.left_lane[lane] >= 0:
            message.left = int(roads.left_lane[lane])
        if roads.right_lane[lane] >= 0:
            message.right = int(roads.right_lane[lane])
        yield message


def network_of(lanes: Sequence[pb.Lane], survey_sigma_m: float) -> RoadNetwork:
    """The road network of all its lanes."""
    edge_ids = tuple(dict.fromkeys(lane.edge for lane in lanes))
    place = {name: number for number, name in enumerate(edge_ids)}
    points = [np.column_stack([lane.x_m, lane.y_m]) for lane in lanes]
    return RoadNetwork(
        lane_ids=tuple(lane.id for lane in lanes),
        edge_ids=edge_ids,
        lane_edge=_numbers(place[lane.edge] for lane in lanes),
        is_internal=np.array([lane.internal for lane in lanes], dtype=bool),
        width_m=np.array([lane.width_m for lane in lanes]),
        speed_limit_mps=np.array([lane.speed_limit_mps for lane in lanes]),
        points_m=np.concatenate(points),
        point_start=_starts(len(part) for part in points),
        successor=_numbers(after for lane in lanes for after in lane.successors),
        successor_start=_starts(len(lane.successors) for lane in lanes),
        left_lane=_numbers(lane.left if lane.HasField("left") else -1 for lane in lanes),
        right_lane=_numbers(lane.right if lane.HasField("right") else -1 for lane in lanes),
        survey_sigma_m=survey_sigma_m,
    )


def _numbers(values: Iterable[int]) -> Any:
    return np.array(list(values), dtype=np.int32)


def _starts(lengths: Iterable[int]) -> Any:
    return np.concatenate([[0], np.cumsum(list(lengths))]).astype(np.int32)
