"""A block of one-way streets with lanes through its junctions, a bicycle that drives there, and a pose source that knows all."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import LocalizationEstimate, LocalizationStatus, Observation

WHEELBASE_M = 2.7
GREY = np.full((120, 160, 3), 100, dtype=np.uint8)


def network_of(lines, successor, internal=(), left=None, right=None, edges=None, speed=10.0):
    """A network of centrelines; ``successor``: pairs; ``internal``: lanes inside junctions; ``edges``: edge of each lane."""
    count = len(lines)
    starts = np.cumsum([0] + [len(line) for line in lines]).astype(np.int32)
    onward = [[b for a, b in successor if a == lane] for lane in range(count)]
    owner = np.arange(count) if edges is None else np.asarray(edges)
    none = np.full(count, -1, dtype=np.int32)
    return RoadNetwork(
        lane_ids=tuple(f"l{i}" for i in range(count)),
        edge_ids=tuple(f"e{i}" for i in range(int(owner.max()) + 1)),
        lane_edge=owner.astype(np.int32),
        is_internal=np.isin(np.arange(count), internal),
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, speed),
        points_m=np.concatenate([np.asarray(line, dtype=float) for line in lines]),
        point_start=starts,
        successor=np.array([b for after in onward for b in after], dtype=np.int32),
        successor_start=np.cumsum([0] + [len(after) for after in onward]).astype(np.int32),
        left_lane=none.copy() if left is None else np.asarray(left, dtype=np.int32),
        right_lane=none.copy() if right is None else np.asarray(right, dtype=np.int32),
    )


def arc(centre, radius, begin_deg, end_deg):
    """Points of an arc."""
    angle = np.radians(np.linspace(begin_deg, end_deg, 10))
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1)


def ring(side=100.0, radius=8.0):
    """A square driven counter-clockwise: lanes 0-3 are its sides, lanes 4-7 its corners."""
    s, r = side, radius
    sides = [
        [(r, 0.0), (s - r, 0.0)], [(s, r), (s, s - r)], [(s - r, s), (r, s)], [(0.0, s - r), (0.0, r)],
    ]  # fmt: skip
    corners = [
        arc((s - r, r), r, -90, 0), arc((s - r, s - r), r, 0, 90), arc((r, s - r), r, 90, 180), arc((r, r), r, 180, 270),
    ]  # fmt: skip
    onward = [(k, 4 + k) for k in range(4)] + [(4 + k, (k + 1) % 4) for k in range(4)]
    return network_of([*sides, *corners], onward, internal=(4, 5, 6, 7))


def street(length=80.0, width=3.2, onward=True):
    """A two-way street along the x axis that ends in nothing: lane 0 leads there, lane 1 back, to lane 2 if ``onward``."""
    half = 0.5 * width
    lines = [[(0.0, -half), (length, -half)], [(length, half), (0.0, half)], [(0.0, half), (-60.0, half)]]
    network = network_of(lines, [(1, 2)] if onward else [])
    network.width_m[:] = width
    return network


def two_ways(detour=3):
    """From lane 0 to lane 4 by lane 1, which is short, or by lanes 2 and 3, which take 200 m more."""
    lines = [
        [(0.0, 0.0), (50.0, 0.0)], [(50.0, 0.0), (150.0, 0.0)], [(50.0, 0.0), (50.0, 150.0)], [(50.0, 150.0), (150.0, 0.0)],
        [(150.0, 0.0), (250.0, 0.0)],
    ]  # fmt: skip
    return network_of(lines, [(0, 1), (0, 2), (1, 4), (2, detour), (detour, 4)])


def map_along(network):
    """What the planner needs of a map that knows every lane: vertices 2 m apart."""
    poses = []
    for lane in range(network.lane_count):
        points = network.lane_points_m(lane)
        for a, b in pairwise(points):
            step = b - a
            for share in np.arange(0.0, 1.0, 2.0 / max(np.hypot(*step), 2.0)):
                poses.append([*(a + share * step), math.atan2(step[1], step[0])])
    return SimpleNamespace(poses=np.array(poses).reshape(-1, 3))


class Bicycle:
    """A kinematic bicycle and what it senses; it is its own pose source, with metres for units."""

    metres_per_unit = 1.0

    def __init__(self, pose):
        self.pose, self.speed, self.wheels, self.t_s = np.array(pose, dtype=float), 0.0, 0.0, 0.0
        self.yaw = 0.0

    def drive(self, command, dt_s=0.1):
        gear, accel = -1.0 if command.reverse else 1.0, min(max(command.acceleration_mps2, -8.0), 4.0)
        along = gear * self.speed
        along = max(0.0, along + dt_s * accel) if along >= 0.0 else min(0.0, along + dt_s * abs(accel))
        self.speed = gear * along
        self.wheels += min(max(command.steering_rad - self.wheels, -0.09), 0.09)
        turned = self.speed * dt_s * math.tan(self.wheels) / WHEELBASE_M
        chord = self.pose[2] + 0.5 * turned
        self.pose += [self.speed * dt_s * math.cos(chord), self.speed * dt_s * math.sin(chord), turned]
        self.yaw, self.t_s = turned / dt_s, self.t_s + dt_s

    def sense(self, frame=GREY, noise=1e-4):
        jitter = noise * math.sin(17.0 * self.t_s)
        return Observation(self.t_s + 0.1, 0.1, self.speed, self.yaw + jitter, frame)

    def step(self, observation):
        none = np.zeros((0, 2, 2))
        return LocalizationEstimate(
            observation.t_s, self.pose.copy(), np.diag([0.01, 0.01, 1e-4]), True, 9.0, -1, np.zeros(2), np.ones(2), none, none,
            LocalizationStatus.LOCALIZED,
        )  # fmt: skip
