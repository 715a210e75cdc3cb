"""The pose that is steered by: when it begins, what corrects it, and when it is given up. The filter itself is in ``track``."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hippodrome.core import se2
from hippodrome.core.navigation import track as tracks
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import at, offset_and_turn, path_poses
from hippodrome.core.navigation.ground_fit import GroundFit
from hippodrome.core.navigation.paving import paving
from hippodrome.core.navigation.pilot import Plan, RoutePlanner, advanced
from hippodrome.core.navigation.places import Place
from hippodrome.core.navigation.placing import LanePlace, lane_that_is_read, oncoming_place, speaks_for_oncoming
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.track import Track
from hippodrome.core.navigation.types import Indicator
from hippodrome.core.navigation.whereabouts import Whereabouts
from hippodrome.core.navigation.witnesses import Witnesses, heard, measured
from hippodrome.core.reading.types import RoadReading
from hippodrome.core.types import FloatArray, LocalizationEstimate, LocalizationStatus, Observation

LOOK_EVERY_S = 0.4  # the localizer's pose is taken in so often: its looks are as frequent
APART_LOOKS = 12  # and for so many looks: what is steered by is the better of the two for a hundred metres without a view
VOUCHED_LOOKS = 2  # recognised views that a new fix needs beside the localizer's own word
BACK_ON_MAP_M = 10.0  # driven on the map again before the localizer is believed more than the lanes and dashes
FORGOTTEN_M = 6.0  # standard deviation from which on the pose that was steered by is given up
MISFITS = 3  # readings in a row that contradict the pose across the lane, before it is loosened
AHEAD_M, HALF_BODY_M = (5.0, 13.0), 0.7  # of the path ahead, which must not lead off the road
OFF_ROAD, OFF_ROAD_FRAMES = 0.3, 3  # share of it that is seen to be no road, in so many frames: the place is wrong ..
LEAST_SHIFT_M, MOST_SHIFT_M, SHIFT_SIGMA_M = 1.5, 6.0, 0.8  # .. unless the vehicle may be so much farther on, or less far
TRUSTED_SHIFT_M = 2.0  # smaller shifts are the ground's own error: borders are seen to half a metre, and always to one side
ONCOMING_M = 8.0  # driven where the borders are those of the oncoming lane: then that is where the vehicle is
READ_APART_M = 3.0  # of this way a reading may tell at most: between frames one drives less
REFUTED_M = 80.0  # a refuted pose is not taken up again over this distance, unless the localizer has gone elsewhere
SHARP_1PM, SHARP_M = 0.2, 3.0  # the path through a sharper corner, so far ahead, keeps another distance from the border
FOUND_EVERY_M, FOUND_REPEATS = 1.0, 10.0  # the place by the road network is taken in so often, and repeats its errors over 10 m
FOUND_SIGMAS, ELSEWHERE_M = 4.0, 10.0  # driven while that place is so far elsewhere, before it is believed more
BACKED_SHARE = 0.7  # of the hypotheses that must be where the localizer is, before that is believed
FOUND_FLOOR = 0.2, 0.2, 0.02  # m along, m across, rad: deviations that a place by hypotheses has at least ..
FOUND_ALONG_M = 1.0  # .. and along the way, where no view was recognised: errors after a fix were 2.2 times what was thought
BORDER_SIGMA_M = 0.3  # of the distance to a border in the ground's map of cells of .2 m


class Belief:
    """Where the vehicle takes itself to be, between and beside the localizer's fixes.

    Args:
        config: all parameters.
        planner: knows the roads.
        side: 1 where traffic keeps left, -1 where it keeps right.
    """

    def __init__(self, config: NavigatorConfig, planner: RoutePlanner, side: float) -> None:
        self._config, self._planner, self._side = config, planner, side
        self.track: Track | None = None  # None without a fix
        self.since_fix_m = 0.0
        self.plan: Plan | None = None  # given up with the pose that it was made for
        self.turns_round = False  # across the road no lane is read, and no path lies ahead
        self._since_look_s = 0.0
        self._apart_looks = self._vouched = 0
        self._since_found_m = self._elsewhere_m = 0.0
        self._misfits = self._off_road = 0
        self._on_map_m = self._oncoming_m = self._since_read_m = 0.0
        self._refuted: Track | None = None  # a pose of the localizer's that what is seen contradicts, moved along
        self._refuted_m = 0.0
        self.witnesses, self._end_off_m = Witnesses(), math.nan  # and how far off an end of the lane is seen
        self._ground = GroundFit(paving(planner.roads.network))

    def step(
        self,
        observation: Observation,
        estimate: LocalizationEstimate,
        distance_m: float,
        senses: Senses,
        found: Place | None = None,
        where: Whereabouts | None = None,
    ) -> None:
        """Take an observation in.

        Args:
            observation: what was sensed.
            estimate: what the localizer makes of it.
            distance_m: the metres driven since the observation before.
            senses: what else is made of it.
            found: the place by the road network, where it is sure.
            where: the hypotheses of it.
        """
        self._move(distance_m, observation.yaw_rate_radps * observation.dt_s, senses.drift_sigma)
        if self._config.exact_poses:
            self._take_over(estimate)
            return
        self._follow_network(found, distance_m)
        self._follow_localizer(estimate, distance_m, observation.dt_s, found, where)
        if self.track is not None and senses.footing.is_off_road:
            self.lose(estimate)
        self._correct_by_lane(observation, estimate, senses, distance_m, where)
        told = self.recognised_pose(estimate)
        self.witnesses = heard(self.witnesses, self.track, distance_m, senses.drift_sigma, told, self._end_off_m)

    def lose(self, estimate: LocalizationEstimate) -> None:
        """Give the pose up, and do not take it from the localizer again: what is seen contradicts it."""
        self._refuted, self._refuted_m = tracks.begun(estimate.pose, estimate.covariance), 0.0
        self.track = self.plan = None
        self._off_road = 0

    def recognised_pose(self, estimate: LocalizationEstimate) -> FloatArray | None:
        """The localizer's pose, where it has just recognised a view."""
        is_recognised = estimate.confidence >= self._config.localizer.margin
        return estimate.pose if is_recognised and estimate.status is LocalizationStatus.LOCALIZED else None

    def _move(self, distance_m: float, turned_rad: float, scale_sigma: float) -> None:
        if self.track is not None:
            self.track = tracks.moved(self.track, distance_m, turned_rad, scale_sigma)
        if self._refuted is not None:
            self._refuted = tracks.moved(self._refuted, distance_m, turned_rad)
        self.since_fix_m += abs(distance_m)

    def _take_over(self, estimate: LocalizationEstimate) -> None:
        """Steer by the very pose that was told."""
        self.track = tracks.begun(estimate.pose, estimate.covariance)
        if self.plan is not None:
            self.plan = advanced(self.plan, self.track.pose)

    def _follow_network(self, found: Place | None, distance_m: float) -> None:
        """Begin at the place by the road network, be corrected by it, or go over to it where it has been elsewhere for long."""
        self._since_found_m += distance_m
        if found is None:
            return
        covariance = tracks.widened(found.covariance, found.pose, FOUND_ALONG_M, *FOUND_FLOOR[1:])
        if self.track is None:
            self._restart(found.pose, covariance)
            return
        if tracks.sigmas_apart(self.track, found.pose, covariance) > FOUND_SIGMAS:
            self._elsewhere_m += distance_m
            if self._elsewhere_m > ELSEWHERE_M:
                self._restart(found.pose, covariance)
            return
        self._elsewhere_m = max(self._elsewhere_m - distance_m, 0.0)
        if self._since_found_m > FOUND_EVERY_M:
            self._since_found_m = 0.0
            across_only = self.witnesses.know_better(covariance, float(self.track.pose[2]))
            self.track = tracks.with_found(self.track, found.pose, FOUND_REPEATS * covariance, across_only)

    def _follow_localizer(
        self, estimate: LocalizationEstimate, distance_m: float, dt_s: float, found: Place | None, where: Whereabouts | None
    ) -> None:
        """Begin, correct, or give up the pose that is steered by, as the localizer says."""
        if self.track is not None and self.track.sigma_m > FORGOTTEN_M:
            self.track, self.plan = None, None
        if estimate.status is not LocalizationStatus.LOCALIZED or self._is_refuted(estimate, distance_m):
            self._on_map_m, self._vouched = 0.0, 0
            return  # off the map the localizer has dead reckoning alone, and here there are lanes and dashes beside it
        self._on_map_m += abs(distance_m)
        recognised = estimate.confidence >= self._config.localizer.margin
        self._since_look_s, looked = (self._since_look_s + dt_s, False) if self._since_look_s < LOOK_EVERY_S else (0.0, True)
        self._vouched += int(looked and recognised and distance_m > 0.0)
        if self.track is None:
            self._begin_as_told(estimate, where)
            return
        if self._on_map_m < BACK_ON_MAP_M:
            return
        if not tracks.is_elsewhere(self.track, estimate):
            self._apart_looks = 0
            if looked and recognised and distance_m > 0.0:
                self.track = tracks.with_localizer(self.track, estimate.pose, estimate.covariance)
        elif looked and recognised:
            self._apart_looks += 1
            if self._apart_looks >= APART_LOOKS and found is None:  # else two stand against one
                self._restart(estimate.pose, estimate.covariance)

    def _begin_as_told(self, estimate: LocalizationEstimate, where: Whereabouts | None) -> None:
        """Begin where the localizer is, if it has recognised enough, and where most hypotheses are there, as they have it."""
        if self._vouched < VOUCHED_LOOKS:
            return
        if where is None:
            self._restart(estimate.pose, estimate.covariance)
            return
        near = where.near(estimate.pose)
        if near.share > BACKED_SHARE:
            self._restart(near.pose, tracks.widened(near.covariance, near.pose, *FOUND_FLOOR))

    def _is_refuted(self, estimate: LocalizationEstimate, distance_m: float) -> bool:
        """Whether the localizer still says what was seen to be wrong."""
        if self._refuted is None:
            return False
        self._refuted_m += abs(distance_m)
        apart_m = float(np.hypot(*(estimate.pose[:2] - self._refuted.pose[:2])))
        if apart_m > tracks.APART_M or self._refuted_m > REFUTED_M:
            self._refuted = None
        return self._refuted is not None

    def _restart(self, pose: FloatArray, covariance: FloatArray) -> None:
        self.track, self.plan = tracks.begun(pose, covariance), None
        self.since_fix_m = self._elsewhere_m = 0.0
        self.witnesses = Witnesses()
        self._apart_looks = self._vouched = 0

    def _correct_by_lane(
        self,
        observation: Observation,
        estimate: LocalizationEstimate,
        senses: Senses,
        distance_m: float,
        where: Whereabouts | None,
    ) -> None:
        """Correct the pose by the lane, where the vehicle is on one that is no way through a junction."""
        self._end_off_m = math.nan
        if self.track is None:
            return
        if self.plan is not None:
            self.plan = advanced(self.plan, self.track.pose)
        reading = senses.reading
        self._since_read_m += distance_m
        if observation.frame is None or observation.speed <= 0.0 or self.turns_round:
            return
        before, self.track = self.track, self._ground.step(self.track, senses.ground, self._since_read_m)
        told_m = tracks.told_along_m(before, self.track)
        self.witnesses = measured(self.witnesses, told_m, float(self.track.pose[2]))
        self._check_by_sight(estimate, senses)
        since_read_m, self._since_read_m = min(self._since_read_m, READ_APART_M), 0.0
        if reading is None or self.track is None:
            return
        place = self._planner.lane_place(self.plan, self.track.pose)
        network = self._planner.roads.network
        if place is None or network.is_internal[place.lane]:
            return
        read = lane_that_is_read(self._planner.roads, self.track.pose, place, reading, self._side) if reading.sees_lane else place
        if self._is_on_oncoming(place, read, reading, since_read_m):
            self._go_over(reading, estimate, where)
            return
        left = np.array([-math.sin(read.heading_rad), math.cos(read.heading_rad)])
        point_m = self.track.pose[:2] - read.offset_m * left
        self.track, fits = tracks.with_lane(self.track, reading, point_m, read.heading_rad)
        self._misfits = 0 if fits else self._misfits + 1
        if self._misfits >= MISFITS:
            self.track, self._misfits = tracks.loosened(self.track, read.heading_rad), 0
        if not len(network.successors(place.lane)) or network.is_internal[network.successors(place.lane)].any():
            to_end_m = float(self._planner.roads.lane_length_m[place.lane]) - place.position_m
            self.track, _ = tracks.with_end(self.track, reading, to_end_m, read.heading_rad)
            self._end_off_m = tracks.end_off_m(reading, to_end_m)

    def _is_on_oncoming(self, place: LanePlace, read: LanePlace, reading: RoadReading, since_m: float) -> bool:
        """Whether the borders of the lane that is read have been those of the oncoming lane for long."""
        if read.lane != place.lane:
            self._oncoming_m = 0.0
            return False
        speaks = speaks_for_oncoming(self._planner.roads, place, reading, self._side)
        self._oncoming_m = max(self._oncoming_m + speaks * since_m, 0.0)
        return self._oncoming_m > ONCOMING_M

    def _go_over(self, reading: RoadReading, estimate: LocalizationEstimate, where: Whereabouts | None) -> None:
        """Take the pose and all hypotheses of it over to the oncoming lane: that is where the vehicle is."""
        assert self.track is not None
        self._oncoming_m = 0.0
        oncoming = oncoming_place(self._planner.roads, self.track.pose)
        if oncoming is None:
            return
        aside_m = reading.offset_m - oncoming.offset_m
        left = np.array([-math.sin(oncoming.heading_rad), math.cos(oncoming.heading_rad)])
        pose = np.array([*(self.track.pose[:2] + aside_m * left), self.track.pose[2]])
        self.track, self.plan = tracks.loosened(replace(self.track, pose=pose), oncoming.heading_rad), None
        self._refuted, self._refuted_m = tracks.begun(estimate.pose, estimate.covariance), 0.0
        if where is not None:
            where.move_aside(aside_m)

    def _check_by_sight(self, estimate: LocalizationEstimate, senses: Senses) -> None:
        """Compare the path with the ground: it must not lead off the road, and in a near turn the border tells the offset."""
        plan, track = self.plan, self.track
        if plan is None or track is None:
            return
        ahead = se2.between(track.pose, path_poses(plan.course, plan.u_m + AHEAD_M[0], plan.u_m + AHEAD_M[1]))
        left = np.stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])], axis=1)
        points = np.concatenate([ahead[:, :2] + aside * left for aside in (-HALF_BODY_M, 0.0, HALF_BODY_M)])
        shift_m, share = senses.ground.best_shift_m(points, min(LEAST_SHIFT_M + 2.0 * track.sigma_m, MOST_SHIFT_M))
        self._off_road = self._off_road + 1 if share > OFF_ROAD else 0
        if abs(shift_m) >= TRUSTED_SHIFT_M and self._off_road == 0:
            self.track, _ = tracks.farther_on(track, shift_m, SHIFT_SIGMA_M)
        if self._off_road >= OFF_ROAD_FRAMES:
            self.lose(estimate)
            return
        gate = plan.gate()
        near_turn = Indicator.RIGHT if self._side < 0.0 else Indicator.LEFT
        if gate is None or gate.indicator is not near_turn or not gate.entry_u_m - 1.0 < plan.u_m < gate.exit_u_m + 1.0:
            return
        border_m = senses.ground.border_m(self._side)
        bend = at(plan.course.path.curvature_1pm, plan.u_m), at(plan.course.path.curvature_1pm, plan.u_m + SHARP_M)
        if math.isfinite(border_m) and max(map(abs, bend)) < SHARP_1PM:  # sharp corners are cut on purpose
            offset_m, turn_rad = offset_and_turn(plan.course, track.pose, plan.u_m)
            seen_m = self._side * (senses.memory.beside_m - border_m)
            heading = float(track.pose[2]) - turn_rad
            self.track, _ = tracks.beside_border(track, seen_m - offset_m, heading, BORDER_SIGMA_M)
