"""The navigator: from what the vehicle senses to what it does, on its own map and to a goal, from an unknown start.

Each step passes through it from top to bottom: the sensors are watched, the localizer is asked, the lane is read, the pose that
is steered by is corrected, and then one of the states of ``DrivingState`` decides:

    SEARCHING  no fix: on sight along the border of the own side (``searching``), until the localizer knows the place
    DRIVING    on the course of the plan (``pilot``, ``driving``, ``steering``)
    DOUBTING   the same, slowly, while the localizer doubts the place; after some way without its consent: searching
    HALTED     a sensor has failed, or no way leads to the goal: stands, and says why
    ARRIVED    stands at the goal, whose place is known well
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from hippodrome.core import se2
from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.navigation import motion as motions
from hippodrome.core.navigation import track as tracks
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import at, offset_and_turn, path_poses
from hippodrome.core.navigation.dashes import LEAST_M, MOST_M, LineView, driven_m, line_levels
from hippodrome.core.navigation.driving import BARRED, pace
from hippodrome.core.navigation.pilot import Plan, RoutePlanner, advanced, is_missed
from hippodrome.core.navigation.placing import keeps_left, lane_of, lane_that_is_read
from hippodrome.core.navigation.searching import LaneMemory, remembered, search_step
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.speed import approach_mps2, following_mps2, stop_mps2
from hippodrome.core.navigation.steering import path_curvature_1pm, steering_rad
from hippodrome.core.navigation.track import Track
from hippodrome.core.navigation.types import Command, DrivingState, Goal, Indicator, Lamp, Radar
from hippodrome.core.navigation.watch import SensorHealth, is_dark, watched
from hippodrome.core.reading.reader import RoadReader
from hippodrome.core.reading.types import RoadReading
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, LocalizationEstimate, LocalizationStatus, Observation

__all__ = ["Navigator", "NavigatorConfig", "PoseSource"]

LOOK_EVERY_S = 0.4  # the localizer's pose is taken in so often: its looks are as frequent
APART_M, APART_SIGMAS, APART_RAD = 4.0, 3.5, 0.5  # the localizer is elsewhere: so far off
APART_LOOKS = 12  # and for so many looks: what is steered by is the better of the two for a hundred metres without a view
VOUCHED_LOOKS = 2  # recognised views that a new fix needs beside the localizer's own word
BACK_ON_MAP_M = 10.0  # driven on the map again before the localizer is believed more than the lanes and dashes
FORGOTTEN_M = 6.0  # standard deviation from which on the pose that was steered by is given up
STANDING_MPS = 0.1
HOLD_MPS2 = -1.0  # what holds a vehicle that stands
OBSTACLE_M = 10.0  # who stands nearer than this before something waits for it
MISFITS = 3  # readings in a row that contradict the pose across the lane, before it is loosened
AHEAD_M, HALF_BODY_M = (5.0, 13.0), 0.7  # of the path ahead, which must not lead off the road
OFF_ROAD, OFF_ROAD_FRAMES = 0.3, 3  # share of it that is seen to be no road, in so many frames: the place is wrong ..
LEAST_SHIFT_M, MOST_SHIFT_M, SHIFT_SIGMA_M = 1.5, 6.0, 0.8  # .. unless the vehicle may be so much farther on, or less far
REFUTED_M = 80.0  # a refuted pose is not taken up again over this distance, unless the localizer has gone elsewhere
SHARP_1PM, SHARP_M = 0.2, 3.0  # the path through a sharper corner, so far ahead, keeps another distance from the border
BORDER_SIGMA_M = 0.3  # of the distance to a border in the ground's map of cells of .2 m
ROUND_M = 250.0  # searched round one block, then straight on to the next ones, and so in turn
ROUND_AGAIN_S = 3.0  # stood at a goal that cannot be vouched for, before going round


class PoseSource(Protocol):
    """What tells the pose: the localizer, or in experiments something else in its place."""

    @property
    def metres_per_unit(self) -> float:
        """Length of the odometry's unit."""

    def step(self, observation: Observation, /) -> LocalizationEstimate:
        """The estimate after an observation."""


class Navigator:
    """Drives to a goal on a topometric map: ``set_goal``, then ``step`` with what is sensed, ten times a second.

    Args:
        cognitive_map: a refined map, in the network frame.
        network: the road network of the map.
        config: all parameters.
        poses: what tells the pose; None: a ``Localizer`` in the map, which is what there is on a road.

    Raises:
        HippodromeError: the map cannot be localized in.
    """

    def __init__(
        self,
        cognitive_map: CognitiveMap,
        network: RoadNetwork,
        config: NavigatorConfig = NavigatorConfig(),
        poses: PoseSource | None = None,
    ) -> None:
        self._config = config
        self._localizer: PoseSource = Localizer(cognitive_map, network, config.localizer) if poses is None else poses
        self._planner = RoutePlanner(cognitive_map, network, config)
        self._side = 1.0 if keeps_left(self._planner.roads) else -1.0
        self._reader: RoadReader | None = None
        self._line: LineView | None = None
        self._ground = Ground(config.camera)
        self._motion, self._health = motions.Motion(), SensorHealth()
        self._expected_scale = self._localizer.metres_per_unit
        self._reading: RoadReading | None = None
        self._memory = LaneMemory()
        self._since_frame = np.zeros(2)  # metres and rad
        self._track: Track | None = None
        self._plan: Plan | None = None
        self._has_goal = False
        self._since_look_s = self._standing_s = self._at_goal_s = self._search_stood_s = 0.0
        self._since_fix_m = 0.0
        self._apart_looks = self._vouched = 0
        self._misfits = self._off_road = 0
        self._searched_m = self._on_map_m = 0.0
        self._refuted: Track | None = None  # a pose of the localizer's that what is seen contradicts, moved along
        self._refuted_m = 0.0
        self._arrived = False
        self.estimate: LocalizationEstimate | None = None  # the localizer's last answer, for who looks on

    def set_goal(self, goal: Goal) -> None:
        """Drive to ``goal`` from now on. Raises HippodromeError if it lies on no lane of its direction."""
        self._planner.set_goal(goal)
        self._has_goal, self._arrived, self._plan = True, False, None

    @property
    def track(self) -> Track | None:
        """The pose that is steered by; None without a fix."""
        return self._track

    @property
    def plan(self) -> Plan | None:
        """The plan under way."""
        return self._plan

    def step(self, observation: Observation, radar: Radar = Radar()) -> Command:
        """What to do over the next step, after what was sensed in the last one."""
        config, dt_s = self._config, observation.dt_s
        self._health = watched(
            self._health, observation, radar, self._motion.speed_mps, self._motion.steering_rad, config.watch, config.vehicle
        )
        if observation.frame is not None and is_dark(observation.frame, config.watch.dark_level):
            observation = replace(observation, frame=None)
        self.estimate = self._localizer.step(observation)
        distance_m = self._move(observation, radar)
        self._read(observation, distance_m)
        self._follow_localizer(distance_m, dt_s)
        self._correct_by_lane(observation)
        command = self._decide(radar, dt_s)
        self._motion = motions.commanded(self._motion, command.acceleration_mps2, command.steering_rad, dt_s)
        return command

    def _move(self, observation: Observation, radar: Radar) -> float:
        """Take the self-motion in: the metres that were driven."""
        config = self._config
        known = self.estimate is not None and self.estimate.localized
        if known and self.estimate is not None and self.estimate.status is LocalizationStatus.LOCALIZED:
            driven_m = self._motion.speed_mps * observation.dt_s
            self._motion = motions.told(self._motion, self._localizer.metres_per_unit, driven_m)
        scale = self._motion.metres_per_unit(self._expected_scale)
        self._motion = motions.sensed(self._motion, observation, scale, config.vehicle)
        distance_m = scale * observation.speed * observation.dt_s
        turned_rad = observation.yaw_rate_radps * observation.dt_s
        self._ground.move(distance_m, turned_rad)
        if observation.frame is not None:
            self._ground.see(observation.frame, radar.gap_m)
        if self._track is not None:
            self._track = tracks.moved(self._track, distance_m, turned_rad)
        if self._refuted is not None:
            self._refuted = tracks.moved(self._refuted, distance_m, turned_rad)
        self._since_fix_m += distance_m
        return distance_m

    def _read(self, observation: Observation, distance_m: float) -> None:
        """Read the lane in a new frame; between frames there is no reading."""
        self._reading = None
        self._since_frame = self._since_frame + np.array([distance_m, observation.yaw_rate_radps * observation.dt_s])
        if observation.frame is not None and self._config.read_road:
            if self._reader is None:
                size_px = observation.frame.shape[1], observation.frame.shape[0]
                self._reader = RoadReader(self._config.camera.on_road(*size_px))
            self._reading = self._reader.read(observation.frame, *self._since_frame.tolist())
            self._since_frame = np.zeros(2)
        turned_rad = observation.yaw_rate_radps * observation.dt_s
        border_m = self._ground.border_m(self._side)
        self._memory = remembered(self._memory, self._reading, distance_m, turned_rad, border_m, self._side)
        self._see_dashes(observation)

    def _see_dashes(self, observation: Observation) -> None:
        """Let the dashes of the centre line tell the scale, as long as no view does."""
        units = observation.speed * observation.dt_s
        if self._line is not None:
            self._line = LineView(self._line.levels, self._line.units + units)
        memory = self._memory
        if observation.frame is None or not memory.is_fresh:
            return
        levels = line_levels(
            observation.frame, self._config.camera, memory.offset_m, memory.heading_rad, memory.curvature_1pm, -self._side
        )
        scale = self._motion.metres_per_unit(self._expected_scale)
        line = self._line
        if line is not None and scale * line.units < LEAST_M:
            return
        if line is not None and scale * line.units < MOST_M:
            metres = driven_m(line.levels, levels, scale * line.units)
            if math.isfinite(metres):
                self._motion = motions.seen(self._motion, metres, line.units)
        self._line = LineView(levels, 0.0)

    def _follow_localizer(self, distance_m: float, dt_s: float) -> None:
        """Begin, correct, or give up the pose that is steered by, as the localizer says."""
        estimate = self.estimate
        assert estimate is not None
        if self._track is not None and self._track.sigma_m > FORGOTTEN_M:
            self._track, self._plan = None, None
        if estimate.status is not LocalizationStatus.LOCALIZED or self._is_refuted(estimate, distance_m):
            self._on_map_m, self._vouched = 0.0, 0
            return  # off the map the localizer has dead reckoning alone, and here there are lanes and dashes beside it
        self._on_map_m += distance_m
        recognised = estimate.confidence >= self._config.localizer.margin
        self._since_look_s, looked = (self._since_look_s + dt_s, False) if self._since_look_s < LOOK_EVERY_S else (0.0, True)
        self._vouched += int(looked and recognised and distance_m > 0.0)
        if self._track is None:
            if self._vouched >= VOUCHED_LOOKS:
                self._restart(estimate)
            return
        if self._on_map_m < BACK_ON_MAP_M:
            return
        if not self._is_elsewhere(estimate, self._track):
            self._apart_looks = 0
            if looked and recognised and distance_m > 0.0:
                self._track = tracks.with_localizer(self._track, estimate.pose, estimate.covariance)
        elif looked and recognised:
            self._apart_looks += 1
            if self._apart_looks >= APART_LOOKS:
                self._restart(estimate)

    def _is_elsewhere(self, estimate: LocalizationEstimate, track: Track) -> bool:
        """Whether the localizer believes in another place than the one that is steered by."""
        apart_m = float(np.hypot(*(estimate.pose[:2] - track.pose[:2])))
        turned = abs(math.remainder(float(estimate.pose[2] - track.pose[2]), 2.0 * math.pi))
        sigma_m = track.sigma_m + math.sqrt(max(0.5 * float(np.trace(estimate.covariance[:2, :2])), 0.0))
        return apart_m > max(APART_M, APART_SIGMAS * sigma_m) or turned > APART_RAD

    def _is_refuted(self, estimate: LocalizationEstimate, distance_m: float) -> bool:
        """Whether the localizer still says what was seen to be wrong."""
        if self._refuted is None:
            return False
        self._refuted_m += distance_m
        apart_m = float(np.hypot(*(estimate.pose[:2] - self._refuted.pose[:2])))
        if apart_m > APART_M or self._refuted_m > REFUTED_M:
            self._refuted = None
        return self._refuted is not None

    def _restart(self, estimate: LocalizationEstimate) -> None:
        self._track, self._plan = tracks.begun(estimate.pose, estimate.covariance), None
        self._since_fix_m = 0.0
        self._apart_looks = self._vouched = 0

    def _correct_by_lane(self, observation: Observation) -> None:
        """Correct the pose by the lane, where the vehicle is on one that is no way through a junction."""
        if self._track is None:
            return
        if self._plan is not None:
            self._plan = advanced(self._plan, self._track.pose)
        reading = self._reading
        if observation.frame is None or observation.speed == 0.0:
            return
        self._check_by_sight()
        if reading is None or self._track is None:
            return
        place = self._planner.lane_place(self._plan, self._track.pose)
        network = self._planner.roads.network
        if place is None or network.is_internal[place.lane]:
            return
        read = lane_that_is_read(self._planner.roads, self._track.pose, place, reading) if reading.sees_lane else place
        left = np.array([-math.sin(read.heading_rad), math.cos(read.heading_rad)])
        point_m = self._track.pose[:2] - read.offset_m * left
        self._track, fits = tracks.with_lane(self._track, reading, point_m, read.heading_rad)
        self._misfits = 0 if fits else self._misfits + 1
        if self._misfits >= MISFITS:
            self._track, self._misfits = tracks.loosened(self._track, read.heading_rad), 0
        if not len(network.successors(place.lane)) or network.is_internal[network.successors(place.lane)].any():
            to_end_m = float(self._planner.roads.lane_length_m[place.lane]) - place.position_m
            self._track, _ = tracks.with_end(self._track, reading, to_end_m, read.heading_rad)

    def _check_by_sight(self) -> None:
        """Compare the path with the ground: it must not lead off the road, and in a near turn the border tells the offset."""
        plan, track = self._plan, self._track
        if plan is None or track is None:
            return
        ahead = se2.between(track.pose, path_poses(plan.course, plan.u_m + AHEAD_M[0], plan.u_m + AHEAD_M[1]))
        left = np.stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])], axis=1)
        points = np.concatenate([ahead[:, :2] + aside * left for aside in (-HALF_BODY_M, 0.0, HALF_BODY_M)])
        shift_m, share = self._ground.best_shift_m(points, min(LEAST_SHIFT_M + 2.0 * track.sigma_m, MOST_SHIFT_M))
        self._off_road = self._off_road + 1 if share > OFF_ROAD else 0
        if shift_m != 0.0 and self._off_road == 0:
            self._track, _ = tracks.farther_on(track, shift_m, SHIFT_SIGMA_M)
        if self._off_road >= OFF_ROAD_FRAMES:
            assert self.estimate is not None
            self._refuted, self._refuted_m = tracks.begun(self.estimate.pose, self.estimate.covariance), 0.0
            self._track = self._plan = None
            self._off_road = 0
            return
        gate = plan.gate()
        near_turn = Indicator.RIGHT if self._side < 0.0 else Indicator.LEFT
        if gate is None or gate.indicator is not near_turn or not gate.entry_u_m - 1.0 < plan.u_m < gate.exit_u_m + 1.0:
            return
        border_m = self._ground.border_m(self._side)
        bend = at(plan.course.path.curvature_1pm, plan.u_m), at(plan.course.path.curvature_1pm, plan.u_m + SHARP_M)
        if math.isfinite(border_m) and max(map(abs, bend)) < SHARP_1PM:  # sharp corners are cut on purpose
            offset_m, turn_rad = offset_and_turn(plan.course, track.pose, plan.u_m)
            seen_m = self._side * (self._memory.beside_m - border_m)
            heading = float(track.pose[2]) - turn_rad
            self._track, _ = tracks.beside_border(track, seen_m - offset_m, heading, BORDER_SIGMA_M)

    def _decide(self, radar: Radar, dt_s: float) -> Command:
        """The command of the present state."""
        halt, complaint = self._health.complaint(self._config.watch)
        if not self._has_goal:
            return self._standing(DrivingState.HALTED, "has no goal")
        if self._arrived:
            return self._standing(DrivingState.ARRIVED, "has arrived")
        self._keep_plan()
        command = self._searching(radar, dt_s) if self._plan is None else self._driving(radar, dt_s)
        if complaint:
            limit = 0.0 if halt else self._config.drive.search_mps / 2.0
            slowed = min(command.acceleration_mps2, self._config.drive.speed_gain_1ps * (limit - self._motion.speed_mps))
            if halt and self._motion.speed_mps < STANDING_MPS:
                slowed = HOLD_MPS2
            state = DrivingState.HALTED if halt else DrivingState.DOUBTING
            command = replace(command, acceleration_mps2=max(slowed, -3.0), state=state, reason=complaint)
        self._look_for_blockage(radar, command.reason == BARRED, dt_s)
        return command

    def _keep_plan(self) -> None:
        """Make a plan where there is none and there can be one; drop one that was missed."""
        if self._track is None:
            self._plan = None
            return
        if self._plan is not None and is_missed(self._plan, self._track.pose):
            self._plan = None
        if self._plan is None and lane_of(self._planner.roads, self._track.pose) is not None:
            self._plan = self._planner.plan(self._track.pose, self._motion.speed_mps)

    def _searching(self, radar: Radar, dt_s: float) -> Command:
        """On sight along the border."""
        config, speed = self._config, self._motion.speed_mps
        self._searched_m += speed * dt_s
        self._search_stood_s = self._search_stood_s + dt_s if speed < STANDING_MPS else max(self._search_stood_s - dt_s, 0.0)
        bend = math.tan(self._motion.steering_rad) / config.vehicle.wheelbase_m
        straight_on = int(self._searched_m / ROUND_M) % 2 == 1
        step = search_step(
            self._ground,
            self._memory,
            self._reading,
            radar,
            self._side,
            speed,
            bend,
            straight_on,
            self._search_stood_s,
            config.drive,
            config.vehicle,
        )
        accel = min(
            approach_mps2(speed, step.speed_mps, config.drive), following_mps2(speed, radar, config.drive, config.vehicle)
        )
        wheel = steering_rad(step.curvature_1pm, speed, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, DrivingState.SEARCHING, step.reason)

    def _driving(self, radar: Radar, dt_s: float) -> Command:
        """On the course."""
        assert self._plan is not None and self._track is not None and self.estimate is not None
        config, speed, plan = self._config, self._motion.speed_mps, self._plan
        step = pace(plan.course, plan.u_m, speed, radar, self._track.sigma_m, config.drive, config.vehicle)
        wanted, reason, state = step.speed_mps, step.reason, DrivingState.DRIVING
        if self._track.sigma_m > self._config.drive.doubt_sigma_m:
            state = DrivingState.DOUBTING
            if config.drive.doubt_mps < wanted:
                wanted, reason = config.drive.doubt_mps, "doubts its place"
        if plan.to_goal_m < config.drive.goal_tolerance_m and speed < STANDING_MPS:
            return self._at_goal(dt_s)
        accel = min(approach_mps2(speed, wanted, config.drive), following_mps2(speed, radar, config.drive, config.vehicle))
        accel = min(accel, stop_mps2(speed, step.to_stop_m, config.drive, config.vehicle))
        if wanted <= 0.0 and speed < STANDING_MPS:
            accel = HOLD_MPS2
        bend = path_curvature_1pm(plan.course, plan.u_m, self._track.pose, speed, config.drive)
        wheel = steering_rad(bend, speed, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, state, reason)

    def _at_goal(self, dt_s: float) -> Command:
        """Stands at the goal: says so if the place is known well, and else goes round once more."""
        assert self._track is not None and self.estimate is not None
        drive = self._config.drive
        self._at_goal_s += dt_s
        if self._track.along_sigma_m < drive.goal_sigma_m and self._since_fix_m > drive.settled_m:
            self._arrived = True
            return self._standing(DrivingState.ARRIVED, "has arrived")
        if self._at_goal_s > ROUND_AGAIN_S:
            self._at_goal_s = 0.0
            self._plan = self._planner.plan(self._track.pose, 0.0, beyond_goal=True)
        return self._standing(DrivingState.DOUBTING, "cannot vouch for the goal's place")

    def _look_for_blockage(self, radar: Radar, barred: bool, dt_s: float) -> None:
        """A road counts as closed where the vehicle has stood long before something, though no lamp is red."""
        waits = (barred or radar.gap_m < OBSTACLE_M) and radar.lamp not in (Lamp.RED, Lamp.YELLOW) and not radar.blind
        standing = self._motion.speed_mps < STANDING_MPS
        self._standing_s = self._standing_s + dt_s if standing and waits else 0.0
        if self._plan is None or self._track is None or self._standing_s < self._config.drive.blocked_s:
            return
        self._standing_s = 0.0
        gate = self._plan.gate()
        if gate is not None and gate.edge >= 0 and gate.entry_u_m - self._plan.u_m < OBSTACLE_M + self._config.vehicle.front_m:
            self._planner.close(gate.edge)
            self._plan = self._planner.plan(self._track.pose, 0.0)
            if self._plan is None:
                self._planner.open_all()

    def _standing(self, state: DrivingState, reason: str) -> Command:
        """Stop, and stand."""
        firm = self._config.drive.braking_mps2
        accel = HOLD_MPS2 if self._motion.speed_mps < STANDING_MPS else -firm
        return Command(accel, self._motion.steering_rad, Indicator.STRAIGHT, state, reason)
