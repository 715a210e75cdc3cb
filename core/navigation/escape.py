"""The way out of where no way leads on: backing off and trying again, or turning round.

On a known place the vehicle turns on the paving that the network knows, into the lane of the opposite direction. Without a fix it
turns on the ground that it has seen; first it backs off along its own way, since a corner is seen better from farther away.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.manoeuvre import BackOff, Manoeuvre, Sensed, Turn
from hippodrome.core.navigation.pilot import RoutePlanner
from hippodrome.core.navigation.rooms import RoomMap, before_obstacle, room_on_roads, room_on_seen_ground
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.turning import Clearance, Leg, is_clear, plan_turn, poses_along
from hippodrome.core.navigation.types import Command, DrivingState, Radar
from hippodrome.core.types import FloatArray

TRAIL_STEP_M: Final = 0.25
TRAIL_M: Final = 20.0  # remembered of the way behind: farther back nobody backs
NO_ROAD_S: Final = 10.0  # stood so long without a road ahead: by then the search takes the least room
AGAIN_S: Final = 5.0  # later an attempt that found no room is made again
FAR_M: Final = 30.0  # driven since the last attempt: what is met there is something new
ATTEMPTS: Final = 8  # at one place: after that it stands, and says so
BACK_M: Final = (4.0, 8.0, 6.0)  # backed off at the first attempts
BEHIND_M: Final = 2.0  # with somebody so near behind, nobody backs off
TURNS_FROM: Final = 2  # attempts that only back off
FLIPS_AT: Final = 2  # the attempt after which the next side street is passed
OBSTACLE_M: Final = 15.0  # who stands nearer ahead bars the street
OBSTACLE_KEPT_M: Final = 0.5
CLEARANCES: Final[tuple[Clearance, ...]] = (
    Clearance(0.3, 0.2),
    Clearance(0.2, 0.0),
    Clearance(0.12, -0.25),
)  # of several the best that there is room for
ON_SIGHT: Final[tuple[Clearance, ...]] = (
    Clearance(0.5, 0.2),
    Clearance(0.3, 0.0),
    Clearance(0.15, -0.25),
)  # borders seen are rough
LEAST: Final = Clearance(0.05, -0.4)  # a leg that would leave less than this ends early
SURE_M: Final = 1.5  # standard deviation of the place from which on the ground that was seen counts, and not the network's
WIDEST_M: Final = 8.0  # from the vehicle to the far border: a wider road is turned round in with what it needs
ASIDE_STEP_M: Final = 0.1


class Escape:
    """Watches for being stuck, and drives out of it.

    Args:
        config: all parameters.
        senses: the ground that was seen, and the motion.
        belief: where the vehicle takes itself to be.
        planner: knows the roads.
        side: 1 where traffic keeps left, -1 where it keeps right.
    """

    def __init__(self, config: NavigatorConfig, senses: Senses, belief: Belief, planner: RoutePlanner, side: float) -> None:
        self._config, self._senses, self._belief, self._planner, self._side = config, senses, belief, planner, side
        self._trail: list[FloatArray] = []
        self._current: Manoeuvre | None = None
        self._turn_next: float | None = None  # turn once it has backed off: the gap ahead at its beginning, inf if none counts
        self._known = False  # whether the manoeuvre was begun with a fix
        self._attempts, self._since_m = 0, math.inf
        self._moved = (0.0, 0.0)
        self._again_s = NO_ROAD_S
        self.passes_side_street = False  # the search is to go straight on the next time

    @property
    def is_under_way(self) -> bool:
        """Whether a manoeuvre is being driven."""
        return self._current is not None

    def moved(self, distance_m: float, turned_rad: float) -> None:
        """Remember the way: poses of the ground's map, a step apart, and none of those that were backed over."""
        self._moved = distance_m, turned_rad
        self._since_m += max(distance_m, 0.0)
        pose = self._senses.ground.pose
        if distance_m < 0.0:
            while len(self._trail) > 1 and _ahead_m(pose, self._trail[-1]) > 0.0:
                self._trail.pop()
        elif not self._trail or math.dist(pose[:2], self._trail[-1][:2]) >= TRAIL_STEP_M:
            self._trail.append(pose.copy())
            del self._trail[: max(len(self._trail) - int(TRAIL_M / TRAIL_STEP_M), 0)]

    def step(self, radar: Radar, dt_s: float) -> Command | None:
        """The command of the manoeuvre under way; None if there is none."""
        if self._current is None:
            return None
        command = self._current.step(Sensed(self._senses.motion, radar, self._senses.ground.pose, *self._moved, dt_s))
        lost = self._known and self._belief.track is None
        if command is not None and not lost:
            return command
        failed, turned = self._current.failed, isinstance(self._current, Turn)
        self._current = None
        self._belief.turns_round = False
        if turned:
            self._trail.clear()
        if not failed and not turned and self._turn_next is not None and self._turn(self._turn_next):
            return self.step(radar, dt_s)
        return None

    def no_road(self, stood_s: float, waits: bool, radar: Radar) -> bool:
        """Whether a manoeuvre begins, as the search has stood so long because of the road itself, and not because it waits."""
        if stood_s < NO_ROAD_S:
            self._again_s = NO_ROAD_S
        if waits or stood_s < self._again_s or self._attempts_left() <= 0:
            return False
        self._again_s = stood_s + AGAIN_S
        back_m = BACK_M[min(self._attempts, len(BACK_M) - 1)]
        turns = self._attempts >= TURNS_FROM
        self._attempts += 1
        self.passes_side_street ^= self._attempts == FLIPS_AT
        if radar.gap_behind_m < BEHIND_M:
            return self._turn(math.inf)
        return self._back(back_m, math.inf if turns else None)

    def to_road(self, back_m: float, radar: Radar) -> bool:
        """Whether it begins to back off along its own way, which was on the road before."""
        if radar.gap_behind_m < BEHIND_M or self._attempts_left() <= 0:
            return False
        self._attempts += 1
        return self._back(back_m, None)

    def barred(self, gap_m: float) -> bool:
        """Whether a turn begins before something that bars the street, or, with an infinite gap, because no way leads on."""
        track = self._belief.track
        leads_nowhere = track is not None and self._planner.opposite(track.pose) is None
        if leads_nowhere or self._attempts_left() <= 0:
            return False
        self._attempts += 1
        return self._turn(gap_m) or self._back(BACK_M[-1], gap_m)

    def _attempts_left(self) -> int:
        if self._since_m > FAR_M:
            self._attempts = 0
        self._since_m = 0.0
        return ATTEMPTS - self._attempts

    def _back(self, back_m: float, turn_next: float | None) -> bool:
        """Begin to back off along the trail."""
        if len(self._trail) < 3:
            return turn_next is not None and self._turn(turn_next)
        self._known = self._belief.track is not None
        self._turn_next = turn_next if turn_next is None else turn_next + back_m
        self._current = BackOff(np.array(self._trail), back_m, self._state, self._config.vehicle)
        return True

    @property
    def _state(self) -> DrivingState:
        return DrivingState.SEARCHING if self._belief.track is None else DrivingState.DRIVING

    def _turn(self, gap_m: float) -> bool:
        """Begin to turn round, if there is room; ``gap_m`` is that to something that bars the street."""
        self._turn_next, track = None, self._belief.track
        place = None if track is None else self._planner.opposite(track.pose)
        if track is not None and place is None:
            return False
        self._known = track is not None and track.sigma_m < SURE_M
        if self._known and track is not None and place is not None:
            room, line, clearances = room_on_roads(self._planner.roads, track.pose), place, CLEARANCES
        else:
            room, clearances = room_on_seen_ground(self._senses.ground), ON_SIGHT
            line = _far_lane(room, self._senses.ground.pose, self._side, self._senses.memory.beside_m)
        if gap_m < OBSTACLE_M:
            room = before_obstacle(room, self._pose(), self._config.vehicle.front_m + gap_m - OBSTACLE_KEPT_M)

        def replan(first: int) -> list[Leg] | None:
            for clearance in clearances:
                legs = plan_turn(self._pose().tolist(), line.tolist(), room, self._config.vehicle, clearance, first)
                if legs is not None:
                    return legs
            return None

        def is_free(leg: Leg) -> bool:
            return bool(is_clear(poses_along(self._pose().tolist(), leg)[1:], room, self._config.vehicle, LEAST).all())

        legs = replan(0)
        if not legs:
            return False
        self._current = Turn(replan, is_free, legs, self._state, self._config.vehicle)
        self._belief.turns_round, self._belief.plan = True, None
        return True

    def _pose(self) -> FloatArray:
        """The pose in whose frame the turn is planned."""
        track = self._belief.track
        return track.pose if self._known and track is not None else self._senses.ground.pose


def _ahead_m(pose: FloatArray, other: FloatArray) -> float:
    """How far another pose lies ahead of a pose, along its heading."""
    return float(math.cos(pose[2]) * (other[0] - pose[0]) + math.sin(pose[2]) * (other[1] - pose[1]))


def _far_lane(room: RoomMap, pose: FloatArray, side: float, beside_m: float) -> FloatArray:
    """The line (3,) of the lane at the far border, of the opposite direction, as the ground shows it beside the vehicle."""
    aside = np.arange(0.0, WIDEST_M, ASIDE_STEP_M)
    left = -side * np.array([-math.sin(pose[2]), math.cos(pose[2])])
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    widths = []
    for ahead_m in (-1.0, 0.5, 2.0):
        blocked = np.flatnonzero(room(pose[:2] + ahead_m * ahead + aside[:, None] * left) < ASIDE_STEP_M)
        widths.append(float(aside[blocked[0]]) if len(blocked) else WIDEST_M)
    return np.array([*(pose[:2] + max(float(np.median(widths)) - beside_m, 0.5) * left), pose[2] + math.pi])
