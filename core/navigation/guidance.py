"""Driving by what all likely places have in common, before it is known which of them is the vehicle's.

Where the place is still ambiguous, most of what is left of the hypotheses agrees about the next 20 m: a right-hand bend, a
mouth in 8 m with a street to the right. Of the ways that lead on from likely places the one is driven along which nine tenths of
the weight have a lane for longest, and as far as they have; beyond that, nothing is known. Once a place is likelier than all
others together, it is the way to the goal from there. Where nothing is agreed on, the vehicle is left to the search on sight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from hippodrome.core import se2
from hippodrome.core.navigation.agreement import WAY_STEP_M, LaneField, agreed_m, lane_field
from hippodrome.core.navigation.caution import guess_mps, leads_off_road, seen_ahead, turn_mps
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import Course, make_course, path_poses, place_on
from hippodrome.core.navigation.driving import pace
from hippodrome.core.navigation.junctions import gate_speed_mps
from hippodrome.core.navigation.pilot import Plan, RoutePlanner, advanced, is_missed
from hippodrome.core.navigation.places import Place
from hippodrome.core.navigation.placing import keeps_left, lane_of
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.speed import approach_mps2, following_mps2, stop_mps2, stopping_mps
from hippodrome.core.navigation.steering import path_curvature_1pm, steering_rad
from hippodrome.core.navigation.track import Track
from hippodrome.core.navigation.types import Command, DrivingState, Radar
from hippodrome.core.navigation.ways import drawn_on, moved, way_poses, ways_ahead
from hippodrome.core.navigation.whereabouts import Whereabouts
from hippodrome.core.navigation.witnesses import Witnesses
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.roads.paths import Piece
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray

SAMPLES: Final = 64  # poses that stand for all hypotheses ..
TRIED: Final = 8  # .. and those whose ways ahead are tried
LOOK_M: Final = 26.0  # of a way
WAY_M: Final = 45.0  # of a way that is driven: another one is looked for before its end
AGREED, GUESSED = 0.9, 0.6  # share of the poses that have a lane where the way is; with less, it is driven at a walk
GUESS_FITS: Final = 0.85  # where the ground fits worse, even what all places agree on is a guess
SEEN_M, CAUTION_M = (2.0, 14.0), (1.0, 14.0)  # of a guess what may have been seen to be road; where the road may bend away
NEW_M, NEW_AFTER_M = 12.0, 3.0  # so much of it must be a way to be driven sooner after driving on sight: they come and go
BEFORE_END_M: Final = 0.3  # the bumper stops so far before a stop line or a junction's mouth that is seen
LEAST_M, SPARE_M = 5.0, 2.5  # of a way that is agreed on; and what is left over of it when the vehicle stops
LIKELY: Final = 0.5  # share of a place from which the way to the goal is driven
RIVAL: Final = 0.25  # the place that is followed is given up where another has four times its weight
PULL: Final = 0.5  # by which the pose is taken to the particles' mean each time
TRY_EVERY_M: Final = 2.0  # trying ways costs milliseconds
NEAR_GOAL_M, OFF_ROAD_LOOKS = 25.0, 2  # who is not sure of the place does not stop there; looks that tell a way off the road
FIX_SHARE, FIX_SIGMA_M, FIX_FITS, FIX_M = 0.99, 1.8, 0.85, 30.0  # a place so sure over so much way is a fix
SAME_PLACE_M, GUIDED_MPS = 12.0, 6.0  # hypotheses so near to the goal are of one place
REASON, GUESS = "drives where all likely places have a lane", "creeps where most likely places have a lane"


class Guide:
    """The hypotheses, the place that is followed among them, and the way on from it.

    Args:
        config: all parameters.
        planner: knows the roads, and makes plans.
    """

    def __init__(self, config: NavigatorConfig, planner: RoutePlanner) -> None:
        self._config, self._planner = config, planner
        self._field: LaneField = lane_field(planner.roads.network)
        self.whereabouts = Whereabouts(planner.roads)
        self.plan: Plan | None = None
        self.pose: FloatArray | None = None  # in the place that is followed
        self.place: Place | None = None  # the likeliest, moved on since it was last looked for
        self.agreed_m = self.guessed_m = 0.0
        self._to_goal = False
        self._since_look_m, self._since_try_m, self._sure_m = 0.0, TRY_EVERY_M, 0.0
        self._off_road, self._is_off_road = 0, False
        self._turned_round = self._sees_road = False
        self._end_m = math.inf  # to the end of the lane that was seen last
        self._most_mps, self._road_m = math.inf, 0.0  # where the road may bend away; of the way that is seen to be road
        self._side = 1.0 if keeps_left(planner.roads) else -1.0
        self._on_sight_m = 0.0  # since a way was driven last
        self.places_given_up = 0  # that were followed

    @property
    def fix(self) -> Place | None:
        """The place, where it is sure."""
        return self.place if self._sure_m >= FIX_M else None

    def vouches(self, track: Track, witnesses: Witnesses, goal_sigma_m: float) -> bool:
        """Whether the vehicle is at the place that it is taken to be at, and known so well along the way."""
        share, spread_m = self.whereabouts.about(track.pose, SAME_PLACE_M)
        return witnesses.vouch(share, self.whereabouts.fits) and witnesses.along_sigma_m(track, spread_m) < goal_sigma_m

    @property
    def way_to_goal(self) -> tuple[Plan | None, FloatArray | None]:
        """The way to the goal from the likeliest place and the pose there, where that is what is driven."""
        return (self.plan, self.pose) if self._to_goal and self.plan is not None else (None, None)

    def _check_footing(self, is_off_road: bool) -> None:
        """Give up the place that was followed, or was sure, where the vehicle comes to be beside the road."""
        if is_off_road and not self._is_off_road:
            self.whereabouts.spread()
            self.pose, self._sure_m = None, 0.0
            self.plan_anew()
        self._is_off_road = is_off_road

    def plan_anew(self) -> None:
        """Look for another way at once: a road was closed."""
        self.plan, self.agreed_m, self.guessed_m = None, 0.0, 0.0
        self._since_try_m, self._since_look_m = TRY_EVERY_M, 1.0

    def step(
        self,
        distance_m: float,
        turned_rad: float,
        senses: Senses,
        told: FloatArray | None,
        held: FloatArray | None,
        turns_round: bool = False,
    ) -> None:
        """Take a step in; only where the vehicle has no pose to steer by a way is looked for.

        Args:
            distance_m: driven.
            turned_rad: meanwhile.
            senses: what is sensed.
            told: (3,) the pose by the localizer, where it recognised a view.
            held: (3,) the pose that is steered by; None while the vehicle searches.
            turns_round: whether it is about to turn round in the street.
        """
        if self._turned_round and not turns_round:
            self.whereabouts.turn_round()
        self._turned_round = turns_round
        self.whereabouts.step(distance_m, turned_rad, senses, senses.scale_sigma, told, held)
        if self.pose is not None:
            self.pose = moved(self.pose, distance_m, turned_rad)
        if self.place is not None:
            self.place = self.place.at(moved(self.place.pose, distance_m, turned_rad))
        self._check_footing(senses.footing.is_off_road)
        self._see_end(senses.reading, distance_m)
        self._since_look_m, self._since_try_m = self._since_look_m + abs(distance_m), self._since_try_m + abs(distance_m)
        ahead = self._ahead(*CAUTION_M)
        self._most_mps = math.inf if ahead is None else turn_mps(senses.ground, ahead, self._side)
        self._on_sight_m += abs(distance_m) if self._on_sight_m > 0.0 else 0.0
        if self._since_look_m >= 1.0:
            self._look(senses, held is None)
            self._since_look_m = 0.0
        if held is not None:
            self.plan = self.pose = None
        elif self.plan is not None and self.pose is not None:
            plan = advanced(self.plan, self.pose)
            self.plan = None if is_missed(plan, self.pose) else plan

    def _look(self, senses: Senses, searches: bool) -> None:
        """Look for the likeliest place, and for what can be driven from there."""
        where = self.whereabouts
        self.place = best = where.best()
        is_sure = best.share > FIX_SHARE and best.sigma_m < FIX_SIGMA_M and not senses.footing.is_doubtful
        self._sure_m = self._sure_m + self._since_look_m if is_sure and where.fits > FIX_FITS else 0.0
        self.agreed_m = self.guessed_m = 0.0
        if not searches:
            return
        self._follow(best)
        poses = where.sample(SAMPLES)
        if self.plan is not None:
            self._keep(senses, poses)
        ends = self.plan is not None and self.plan.course.last_u_m - self.plan.u_m < LOOK_M
        wants_goal = best.share > LIKELY and not self._to_goal
        if (self.agreed_m < LEAST_M or ends or wants_goal) and self._since_try_m >= TRY_EVERY_M:
            self._since_try_m = 0.0
            self._try(best, poses, senses)
        ahead = self._ahead(*SEEN_M)
        self._sees_road, self._road_m = (False, 0.0) if ahead is None else seen_ahead(senses.ground, ahead, SEEN_M[0])

    def _see_end(self, reading: RoadReading | None, distance_m: float) -> None:
        """Remember the end of the lane that was seen."""
        self._end_m -= distance_m
        if reading is not None and reading.end is not LaneEnd.NOTHING and math.isfinite(reading.end_m):
            self._end_m = reading.end_m
        elif self._end_m < 0.0:
            self._end_m = math.inf

    def _ahead(self, from_m: float, to_m: float) -> FloatArray | None:
        """The way ahead (n, 3), in the vehicle's axes."""
        if self.plan is None or self.pose is None:
            return None
        return se2.between(self.pose, path_poses(self.plan.course, self.plan.u_m + from_m, self.plan.u_m + to_m))

    def _follow(self, best: Place) -> None:
        """Take the pose to the particles about it, or give it up for a place that is much likelier."""
        if self.pose is None:
            return
        mine = self.whereabouts.near(self.pose)
        if mine.share < RIVAL * best.share:
            self.plan = self.pose = None
            self.places_given_up += 1
            return
        off = mine.pose - self.pose
        off[2] = wrap(off[2])
        self.pose = self.pose + PULL * off

    def _keep(self, senses: Senses, poses: FloatArray) -> None:
        """See how far the present way is agreed on; give it up where it leads off the road."""
        ahead = self._ahead(0.0, LOOK_M)
        assert ahead is not None
        self.agreed_m, self.guessed_m = self._reach_m(self._field.agreed(ahead[::4].copy()[None], poses)[0])
        self._off_road = self._off_road + 1 if leads_off_road(senses.ground, ahead[::4]) else 0
        if self._off_road >= OFF_ROAD_LOOKS:
            self.plan, self.agreed_m, self.guessed_m, self._off_road = None, 0.0, 0.0, 0

    def _try(self, best: Place, poses: FloatArray, senses: Senses) -> None:
        """Look for a way that is agreed on for longer than the present one."""
        if best.share > LIKELY and self._try_goal(best, poses, senses):
            return
        network, lengths_m = self._planner.roads.network, self._planner.roads.lane_length_m
        starts = [best.pose, *poses[:: max(len(poses) // TRIED, 1)]]
        grid_m = np.arange(0.0, LOOK_M + 0.1, WAY_STEP_M)
        found: list[tuple[FloatArray, list[Piece], FloatArray, float]] = []
        for pose in starts:
            place = lane_of(self._planner.roads, pose)
            if place is None:
                continue
            for pieces in ways_ahead(network, lengths_m, place.lane, place.position_m, LOOK_M):
                if not pieces or pieces[0].lane != place.lane:
                    continue
                way = way_poses(network, pieces, grid_m, place.position_m)
                ahead = se2.between(pose, way)
                if len(way) > 1 and not leads_off_road(senses.ground, ahead):
                    found.append((pose, pieces, ahead, place.position_m))
        if not found:
            return
        ways = np.full((len(found), len(grid_m), 3), 1e6)
        for k, (_, _, ahead, _) in enumerate(found):
            ways[k, : len(ahead)] = ahead
        far = [self._reach_m(share) for share in self._field.agreed(ways, poses)]
        k = max(range(len(far)), key=lambda one: (far[one][0] >= LEAST_M, sum(far[one])))
        now = self.agreed_m >= LEAST_M, self.agreed_m + self.guessed_m
        if far[k][1] >= LEAST_M and (far[k][0] >= LEAST_M, sum(far[k])) > now:
            pose, pieces, _, position_m = found[k]
            self._drive(pose, pieces, position_m, far[k])

    @staticmethod
    def _reach_m(share: FloatArray) -> tuple[float, float]:
        """How far a way is agreed on, and how far it is a guess."""
        return agreed_m(share, AGREED), agreed_m(share, GUESSED)

    def _try_goal(self, best: Place, poses: FloatArray, senses: Senses) -> bool:
        """Plan from the likeliest place; whether that is agreed on."""
        plan = self._planner.plan(best.pose, 0.0)
        if plan is not None and plan.to_goal_m < NEAR_GOAL_M:
            plan = self._planner.plan(best.pose, 0.0, beyond_goal=True)
        if plan is None:
            return False
        ahead = se2.between(best.pose, path_poses(plan.course, plan.u_m, plan.u_m + LOOK_M)[::4])
        far_m = self._reach_m(self._field.agreed(ahead[None], poses)[0])
        if far_m[0] < LEAST_M or leads_off_road(senses.ground, ahead):
            return False
        self.plan, self.pose, self._to_goal, (self.agreed_m, self.guessed_m) = plan, best.pose, True, far_m
        return True

    def _drive(self, pose: FloatArray, pieces: Sequence[Piece], position_m: float, far_m: tuple[float, float]) -> None:
        """Take a way."""
        network = self._planner.roads.network
        pieces = drawn_on(network, self._planner.roads.lane_length_m, pieces, WAY_M)
        course: Course = make_course(network, pieces, pieces[-1].lane, pieces[-1].end_m, self._config.drive, self._config.vehicle)
        u_m = place_on(course, pose, min(position_m - pieces[0].begin_m, course.last_u_m))
        self.plan, self.pose, self._to_goal = Plan(course, u_m), pose, False
        self.agreed_m, self.guessed_m = far_m

    def command(self, radar: Radar, speed_mps: float) -> Command | None:
        """What to do on the way that is agreed on; None where that is too short."""
        config = self._config
        left_m, most_mps, reason = self.agreed_m - self._since_look_m, GUIDED_MPS, REASON
        is_agreed = left_m >= LEAST_M - 1.0
        if not is_agreed or self.whereabouts.fits < GUESS_FITS:
            left_m = max(left_m, self.guessed_m - self._since_look_m) if self._sees_road else 0.0
            most_mps, reason = guess_mps(is_agreed, self._road_m - self._since_look_m, config), GUESS
        is_new = 0.0 < self._on_sight_m < NEW_AFTER_M and left_m < NEW_M
        if self.plan is None or self.pose is None or left_m < LEAST_M - 1.0 or is_new:
            self._on_sight_m = max(self._on_sight_m, 0.01)
            return None
        self._on_sight_m = 0.0
        step = pace(self.plan.course, self.plan.u_m, speed_mps, radar, 0.0, config.drive, config.vehicle)
        agreed_mps = max(stopping_mps(left_m - SPARE_M, config.drive.braking_mps2), config.drive.creep_mps)
        seen_m = self._end_m - config.vehicle.front_m - BEFORE_END_M
        seen_mps, why = gate_speed_mps(seen_m, speed_mps, radar, config.drive)
        wanted = min(step.speed_mps, most_mps, agreed_mps, seen_mps, self._most_mps)
        if wanted < min(most_mps, agreed_mps):
            reason = (why if seen_mps <= step.speed_mps else step.reason) or reason
        accel = min(
            approach_mps2(speed_mps, wanted, config.drive), following_mps2(speed_mps, radar, config.drive, config.vehicle)
        )
        to_stop_m = min(step.to_stop_m, seen_m) if math.isfinite(seen_mps) else step.to_stop_m
        accel = min(accel, stop_mps2(speed_mps, to_stop_m, config.drive, config.vehicle))
        bend = path_curvature_1pm(self.plan.course, self.plan.u_m, self.pose, speed_mps, config.drive)
        wheel = steering_rad(bend, speed_mps, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, DrivingState.SEARCHING, reason)
