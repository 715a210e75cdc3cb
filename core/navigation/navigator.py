"""The navigator: from what the vehicle senses to what it does, on its own map and to a goal, from an unknown start.

Each step passes through it from top to bottom: the sensors are watched, the localizer is asked, the lane is read (``senses``),
the pose that is steered by is corrected (``belief``), and then one of the states of ``DrivingState`` decides:

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

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.navigation import motion as motions
from hippodrome.core.navigation.arrival import LOOKS, Arrival
from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.blockage import STANDING_MPS, Blockage
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.driving import BARRED, pace
from hippodrome.core.navigation.escape import Escape
from hippodrome.core.navigation.footing import Footing
from hippodrome.core.navigation.guidance import Guide
from hippodrome.core.navigation.pilot import Plan, RoutePlanner, is_missed
from hippodrome.core.navigation.places import Place
from hippodrome.core.navigation.placing import keeps_left, lane_of
from hippodrome.core.navigation.searching import search_step
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.speed import approach_mps2, following_mps2, stop_mps2, there_mps2
from hippodrome.core.navigation.steering import path_curvature_1pm, steering_rad
from hippodrome.core.navigation.streets import StreetMemory
from hippodrome.core.navigation.track import Track
from hippodrome.core.navigation.types import Command, DrivingState, Goal, Indicator, Radar
from hippodrome.core.navigation.watch import SensorHealth, is_dark, watched
from hippodrome.core.navigation.witnesses import measured
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, LocalizationEstimate, LocalizationStatus, Observation

__all__ = ["Navigator", "NavigatorConfig", "PoseSource"]

BLOCKED = "the street is blocked"
BESIDE_ROAD = "is beside the road"
MORE_M = 3.0  # backed off beyond where the vehicle came off the road
NO_ROOM = "no way leads on, and there is no room to turn round"
HOLD_MPS2 = -1.0  # what holds a vehicle that stands
ROUND_M = 250.0  # searched round one block, then straight on to the next ones, and so in turn
FOUND_AGAIN_M = 20.0  # driven before the localizer found the place again: it has yet to find the scale, and is heard anew


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
        self._senses = Senses(config, self._side, self._localizer.metres_per_unit)
        self._belief = Belief(config, self._planner, self._side)
        self._escape = Escape(config, self._senses, self._belief, self._planner, self._side)
        self._guide = Guide(config, self._planner) if config.search_network and poses is None else None
        self._blockage = Blockage(config, self._senses, self._belief, self._planner, self._escape, self._guide)
        self._arrival = Arrival(config, self._belief, self._planner, self._escape, self._guide)
        self._streets = None if config.exact_poses else StreetMemory(config.localizer.views)
        self._health = SensorHealth()
        self._has_goal = False
        self._search_stood_s = self._searched_m = self._unknown_m = 0.0
        self.estimate: LocalizationEstimate | None = None  # the localizer's last answer, for who looks on

    def set_goal(self, goal: Goal) -> None:
        """Drive to ``goal`` from now on. Raises HippodromeError if it lies on no lane of its direction."""
        self._planner.set_goal(goal)
        self._has_goal, self._arrival.arrived, self._belief.plan = True, False, None

    @property
    def track(self) -> Track | None:
        """The pose that is steered by; None without a fix."""
        return self._belief.track

    @property
    def plan(self) -> Plan | None:
        """The plan under way."""
        return self._belief.plan

    def step(self, observation: Observation, radar: Radar = Radar()) -> Command:
        """What to do over the next step, after what was sensed in the last one."""
        config, dt_s, senses = self._config, observation.dt_s, self._senses
        before = senses.motion
        self._health = watched(
            self._health, observation, radar, before.speed_mps, before.steering_rad, config.watch, config.vehicle
        )
        if observation.frame is not None and is_dark(observation.frame, config.watch.dark_level):
            observation = replace(observation, frame=None)
        self.estimate = self._localizer.step(observation)
        distance_m = senses.step(observation, radar, self._told_scale(self.estimate, dt_s))
        found = self._guess(observation, distance_m)
        where = None if self._guide is None else self._guide.whereabouts
        self._belief.step(observation, self.estimate, distance_m, senses, found, where)
        self._know_street(observation, distance_m)
        self._escape.moved(distance_m, observation.yaw_rate_radps * dt_s)
        command = self._decide(radar, dt_s)
        accel, wheel, reverse = command.acceleration_mps2, command.steering_rad, command.reverse
        senses.motion = motions.commanded(senses.motion, accel, wheel, dt_s, reverse)
        return command

    def _know_street(self, observation: Observation, distance_m: float) -> None:
        """Learn the street that is driven, or recognise it, where the map has no views of it."""
        belief, place = self._belief, None
        if self._streets is None:
            return
        if belief.track is not None and distance_m > 0.0 and not belief.turns_round:
            place = self._planner.lane_place(belief.plan, belief.track.pose)
            place = None if place is None or self._planner.roads.network.is_internal[place.lane] else place
        turned_rad = observation.yaw_rate_radps * observation.dt_s
        drift = self._senses.drift_sigma
        belief.track, sigma_m = self._streets.step(belief.track, place, observation.frame, distance_m, turned_rad, drift)
        if belief.track is not None and not math.isnan(sigma_m):
            belief.witnesses = measured(belief.witnesses, sigma_m, float(belief.track.pose[2]))

    def _told_scale(self, estimate: LocalizationEstimate, dt_s: float) -> float | None:
        """Metres per unit by the localizer where it knows the place, else by the hypotheses where they are sure."""
        if estimate.localized and estimate.status is LocalizationStatus.LOCALIZED:
            if self._unknown_m > FOUND_AGAIN_M:
                self._senses.motion = motions.untold(self._senses.motion)
            self._unknown_m = 0.0
            return self._localizer.metres_per_unit
        self._unknown_m += abs(self._senses.motion.speed_mps) * dt_s
        if self._guide is None or self._guide.fix is None:
            return None
        return self._senses.metres_per_unit * math.exp(self._guide.whereabouts.log_scale)

    def _guess(self, observation: Observation, distance_m: float) -> Place | None:
        """Take an observation into the hypotheses of the place: the place, where they are sure of it."""
        if self._guide is None:
            return None
        turned_rad = observation.yaw_rate_radps * observation.dt_s
        told = None if self.estimate is None else self._belief.recognised_pose(self.estimate)
        held = None if self._belief.track is None else self._belief.track.pose
        self._guide.step(distance_m, turned_rad, self._senses, told, held, self._belief.turns_round)
        return self._guide.fix

    def _decide(self, radar: Radar, dt_s: float) -> Command:
        """The command of the present state."""
        halt, complaint = self._health.complaint(self._config.watch)
        if not self._has_goal:
            return self._standing(DrivingState.HALTED, "has no goal")
        if self._arrival.arrived:
            return self._standing(DrivingState.ARRIVED, "has arrived")
        command = self._escape.step(radar, dt_s)
        if command is None and self._senses.footing.is_off_road:
            command = self._beside_road(radar, dt_s)
        if command is None:
            self._keep_plan()
            command = self._searching(radar, dt_s) if self._belief.plan is None else self._driving(radar, dt_s)
        speed = abs(self._senses.motion.speed_mps)
        if complaint:
            limit = 0.0 if halt else self._config.drive.search_mps / 2.0
            slowed = min(command.acceleration_mps2, self._config.drive.speed_gain_1ps * (limit - speed))
            if halt and speed < STANDING_MPS:
                slowed = HOLD_MPS2
            state = DrivingState.HALTED if halt else DrivingState.DOUBTING
            command = replace(command, acceleration_mps2=max(slowed, -3.0), state=state, reason=complaint)
        if not self._escape.is_under_way:
            self._blockage.step(radar, command.reason == BARRED, dt_s)
        if self._blockage.blocks and command.state in (DrivingState.DRIVING, DrivingState.DOUBTING):
            return replace(command, state=DrivingState.HALTED, reason=BLOCKED)
        return command

    def _beside_road(self, radar: Radar, dt_s: float) -> Command | None:
        """Stops beside the road, and backs off to it; None where it cannot: then it goes on by what it sees."""
        if self._belief.track is not None:
            return None  # exact poses are believed
        if self._senses.motion.speed_mps > STANDING_MPS:
            standing = self._standing(DrivingState.SEARCHING, BESIDE_ROAD)
            return replace(standing, steering_rad=0.0)  # the bend that led off the road would lead farther off
        back_m = self._senses.footing.beside_m + MORE_M
        self._senses.footing = Footing()
        return self._escape.step(radar, dt_s) if self._escape.to_road(back_m, radar) else None

    def _keep_plan(self) -> None:
        """Make a plan where there is none and there can be one; drop one that was missed."""
        if self._belief.track is None:
            self._belief.plan = None
            return
        if self._belief.plan is not None and is_missed(self._belief.plan, self._belief.track.pose):
            self._belief.plan = None
        if self._belief.plan is None and lane_of(self._planner.roads, self._belief.track.pose) is not None:
            self._belief.plan = self._planner.plan(self._belief.track.pose, self._senses.motion.speed_mps)

    def _searching(self, radar: Radar, dt_s: float) -> Command:
        """Where all likely places have a lane, or else on sight along the border."""
        config, speed = self._config, self._senses.motion.speed_mps
        guided = None if self._guide is None else self._guide.command(radar, speed)
        if guided is not None:
            return guided
        self._searched_m += speed * dt_s
        self._search_stood_s = self._search_stood_s + dt_s if speed < STANDING_MPS else max(self._search_stood_s - dt_s, 0.0)
        bend = math.tan(self._senses.motion.steering_rad) / config.vehicle.wheelbase_m
        straight_on = (int(self._searched_m / ROUND_M) % 2 == 1) != self._escape.passes_side_street
        step = search_step(
            self._senses.ground,
            self._senses.memory,
            self._senses.reading,
            radar,
            self._side,
            speed,
            bend,
            straight_on,
            self._search_stood_s,
            config.drive,
            config.vehicle,
        )
        if self._escape.no_road(self._search_stood_s, not step.may_creep, radar):
            self._search_stood_s = 0.0
        accel = min(
            approach_mps2(speed, step.speed_mps, config.drive), following_mps2(speed, radar, config.drive, config.vehicle)
        )
        wheel = steering_rad(step.curvature_1pm, speed, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, DrivingState.SEARCHING, step.reason)

    def _driving(self, radar: Radar, dt_s: float) -> Command:
        """On the course."""
        assert self._belief.plan is not None and self._belief.track is not None and self.estimate is not None
        config, speed, plan = self._config, self._senses.motion.speed_mps, self._belief.plan
        track = self._belief.track
        step = pace(plan.course, plan.u_m, speed, radar, track.sigma_m, config.drive, config.vehicle, track.along_sigma_m)
        wanted, reason, state = step.speed_mps, step.reason, DrivingState.DRIVING
        if self._belief.track.sigma_m > self._config.drive.doubt_sigma_m:
            state = DrivingState.DOUBTING
            if config.drive.doubt_mps < wanted:
                wanted, reason = config.drive.doubt_mps, "doubts its place"
        if self._arrival.looks(plan):
            look_mps = self._arrival.look_mps(plan, speed, radar)
            if look_mps is None:
                return self._standing(DrivingState.DRIVING, LOOKS)
            wanted, reason = (look_mps, LOOKS) if look_mps < wanted else (wanted, reason)
        if plan.to_goal_m < config.drive.goal_tolerance_m and speed < STANDING_MPS:
            return self._to_turn() if plan.turns else self._standing(*self._arrival.at_goal(dt_s))
        accel = min(approach_mps2(speed, wanted, config.drive), following_mps2(speed, radar, config.drive, config.vehicle))
        accel = min(accel, stop_mps2(speed, step.to_stop_m, config.drive, config.vehicle))
        accel = min(accel, there_mps2(plan.to_goal_m, config.drive))
        if wanted <= 0.0 and speed < STANDING_MPS:
            accel = HOLD_MPS2
        bend = path_curvature_1pm(plan.course, plan.u_m, self._belief.track.pose, speed, config.drive)
        wheel = steering_rad(bend, speed, config.drive, config.vehicle)
        return Command(accel, wheel, step.indicator, state, reason)

    def _to_turn(self) -> Command:
        """Stands where it is to turn round: begins to, if there is room."""
        begins = self._escape.barred(math.inf)
        state, reason = (DrivingState.DRIVING, "turns round") if begins else (DrivingState.HALTED, NO_ROOM)
        return self._standing(state, reason)

    def _standing(self, state: DrivingState, reason: str) -> Command:
        """Stop, and stand."""
        firm = self._config.drive.braking_mps2
        accel = HOLD_MPS2 if self._senses.motion.speed_mps < STANDING_MPS else -firm
        return Command(accel, self._senses.motion.steering_rad, Indicator.STRAIGHT, state, reason)
