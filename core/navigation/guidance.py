"""Driving by what all likely places have in common, before it is known which of them is the vehicle's.

Where the place is still ambiguous, most of what is left of the hypotheses agrees about the next 20 m: a right-hand bend, a
mouth in 8 m with a street to the right. The path of a plan from the likeliest place is driven as far as nine tenths of the weight have a
lane there, too; beyond that, nothing is known. Where that is too near, the vehicle is left to the search on sight.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core import se2
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import path_poses
from hippodrome.core.navigation.driving import pace
from hippodrome.core.navigation.pilot import Plan, RoutePlanner, advanced, is_missed
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.speed import approach_mps2, following_mps2, stop_mps2, stopping_mps
from hippodrome.core.navigation.steering import path_curvature_1pm, steering_rad
from hippodrome.core.navigation.types import Command, DrivingState, Radar
from hippodrome.core.navigation.whereabouts import Place, Whereabouts
from hippodrome.core.roads.geometry import RoadGeometry, project
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray

SAMPLES: Final = 48  # poses that stand for all hypotheses
LOOK_M: Final = 26.0  # of the path
AGREED: Final = 0.9  # share of the poses that have a lane where the path is
BESIDE_M, ASKEW_RAD = 1.1, 0.5  # so near to it, and of its direction
LEAST_M: Final = 7.0  # of the path that is agreed on
SPARE_M: Final = 4.0  # of it that is left over when the vehicle stops at its end
LEAST_SHARE: Final = 0.04  # of the likeliest place, for a plan to be made from it
RIVAL: Final = 0.25  # the place that is followed is given up where another has so many times its weight: 4
PULL: Final = 0.5  # by which the pose is taken to the particles' mean each time
TRY_EVERY_M: Final = 3.0  # a plan costs milliseconds
NEAR_GOAL_M: Final = 25.0  # whoever is not sure of the place does not stop at the goal
AHEAD_M, HALF_BODY_M = (4.0, 12.0), 0.6  # of the path, which must not lead off the road
OFF_ROAD, OFF_ROAD_LOOKS = 0.3, 2
REASON: Final = "drives where all likely places have a lane"
FIX_SHARE, FIX_SIGMA_M, FIX_FITS, FIX_M = 0.99, 1.8, 0.85, 12.0  # a place so sure, for so long, is a fix
GUIDED_MPS: Final = 6.0


class Guide:
    """The hypotheses, the place that is followed among them, and the plan from it.

    Args:
        config: all parameters.
        planner: makes the plans.
    """

    def __init__(self, config: NavigatorConfig, planner: RoutePlanner) -> None:
        self._config, self._planner = config, planner
        self.whereabouts = Whereabouts(planner.roads)
        self.plan: Plan | None = None
        self.pose: FloatArray | None = None
        self.place: Place | None = None  # the likeliest, when it was last looked for
        self.agreed_m = 0.0
        self._since_look_m = self._since_try_m = self._sure_m = 0.0
        self._off_road = 0

    @property
    def fix(self) -> Place | None:
        """The place, where it is sure."""
        return self.place if self._sure_m >= FIX_M else None

    def step(self, distance_m: float, turned_rad: float, senses: Senses, scale_sigma: float, searches: bool) -> None:
        """Take a step in; only where the vehicle ``searches`` a way is looked for."""
        self.whereabouts.step(distance_m, turned_rad, senses, scale_sigma)
        if self.pose is not None:
            chord = self.pose[2] + 0.5 * turned_rad
            step = np.array([distance_m * math.cos(chord), distance_m * math.sin(chord), turned_rad])
            self.pose = self.pose + step
        if self.place is not None:
            self.place = self.place.moved(distance_m, turned_rad)
        self._since_look_m += abs(distance_m)
        self._since_try_m += abs(distance_m)
        if self._since_look_m >= 1.0:
            self._look(senses, searches)
            self._since_look_m = 0.0
        if not searches:
            self.plan = self.pose = None
        elif self.plan is not None and self.pose is not None:
            self.plan = advanced(self.plan, self.pose)
            if is_missed(self.plan, self.pose):
                self.plan = None

    def _look(self, senses: Senses, searches: bool) -> None:
        where = self.whereabouts
        self.place = best = where.best()
        is_sure = best.share > FIX_SHARE and best.sigma_m < FIX_SIGMA_M and where.fits > FIX_FITS
        self._sure_m = self._sure_m + self._since_look_m if is_sure else 0.0
        self.agreed_m = 0.0
        if not searches:
            return
        if self.pose is not None:
            mine = where.near(self.pose)
            if mine.share < RIVAL * best.share:
                self.plan = self.pose = None
            else:
                self.pose = self.pose + PULL * se2_difference(mine.pose, self.pose)
        if self.plan is None:
            self._try(best)
        if self.plan is None or self.pose is None:
            return
        self._check_by_sight(senses)
        if self.plan is not None:
            ahead = path_poses(self.plan.course, self.plan.u_m, self.plan.u_m + LOOK_M)[::3]
            self.agreed_m = agreed_m(self._planner.roads, se2.between(self.pose, ahead), where.sample(SAMPLES))

    def _try(self, best: Place) -> None:
        """Plan from the likeliest place."""
        if best.share < LEAST_SHARE or self._since_try_m < TRY_EVERY_M:
            return
        self._since_try_m = 0.0
        self.pose = best.pose if self.pose is None else self.pose
        self.plan = self._planner.plan(self.pose, 0.0)
        if self.plan is not None and 0.0 < self.plan.to_goal_m < NEAR_GOAL_M:
            self.plan = self._planner.plan(self.pose, 0.0, beyond_goal=True)
        if self.plan is None:
            self.pose = None

    def _check_by_sight(self, senses: Senses) -> None:
        """Give up a plan whose path leads where no road is seen, and the place with it."""
        assert self.plan is not None and self.pose is not None
        ahead = se2.between(self.pose, path_poses(self.plan.course, self.plan.u_m + AHEAD_M[0], self.plan.u_m + AHEAD_M[1]))
        left = np.stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])], axis=1)
        points = np.concatenate([ahead[:, :2] + aside * left for aside in (-HALF_BODY_M, 0.0, HALF_BODY_M)])
        self._off_road = self._off_road + 1 if senses.ground.off_road_share(points) > OFF_ROAD else 0
        if self._off_road >= OFF_ROAD_LOOKS:
            self.plan = self.pose = None
            self._off_road = 0
            self._since_try_m = -TRY_EVERY_M

    def command(self, radar: Radar, speed_mps: float) -> Command | None:
        """What to do on the way that is agreed on; None where that is too short."""
        config = self._config
        need_m = LEAST_M + 0.5 * speed_mps**2 / config.drive.braking_mps2 * 0.5
        left_m = self.agreed_m - self._since_look_m
        if self.plan is None or self.pose is None or left_m < need_m:
            return None
        step = pace(self.plan.course, self.plan.u_m, speed_mps, radar, 0.0, config.drive, config.vehicle)
        wanted = min(step.speed_mps, GUIDED_MPS, stopping_mps(left_m - SPARE_M, config.drive.braking_mps2))
        accel = min(
            approach_mps2(speed_mps, wanted, config.drive), following_mps2(speed_mps, radar, config.drive, config.vehicle)
        )
        accel = min(accel, stop_mps2(speed_mps, step.to_stop_m, config.drive, config.vehicle))
        bend = path_curvature_1pm(self.plan.course, self.plan.u_m, self.pose, speed_mps, config.drive)
        wheel = steering_rad(bend, speed_mps, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, DrivingState.SEARCHING, step.reason or REASON)


def se2_difference(a: FloatArray, b: FloatArray) -> FloatArray:
    """The pose a less the pose b, with the angle wrapped."""
    difference = a - b
    difference[2] = wrap(difference[2])
    return difference


def agreed_m(roads: RoadGeometry, ahead: FloatArray, poses: FloatArray) -> float:
    """How far of a way ahead (n, 3), in the vehicle's axes, ``AGREED`` of the poses (k, 3) have a lane along it."""
    if len(ahead) < 2:
        return 0.0
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ahead[:, :2], axis=0).T))])
    cos, sin = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    x = poses[:, :1] + cos * ahead[None, :, 0] - sin * ahead[None, :, 1]
    y = poses[:, 1:2] + sin * ahead[None, :, 0] + cos * ahead[None, :, 1]
    heading = (poses[:, 2:] + ahead[None, :, 2]).ravel()
    near = project(roads, np.stack([x.ravel(), y.ravel()], axis=1), BESIDE_M)
    fits = np.zeros(len(heading), dtype=np.bool_)
    fits[near.point[np.abs(wrap(near.heading_rad - heading[near.point])) < ASKEW_RAD]] = True
    holds = np.logical_and.accumulate(fits.reshape(len(poses), len(ahead)), axis=1)
    enough = np.flatnonzero(holds.mean(axis=0) >= AGREED)
    return float(along_m[enough[-1]]) if len(enough) else 0.0
