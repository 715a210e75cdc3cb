"""The navigator's parameters, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.views.config import CameraGeometry


@dataclass(frozen=True)
class VehicleShape:
    """The vehicle that is driven: a compact car."""

    wheelbase_m: float = 2.7
    half_track_m: float = 0.8  # from the middle to the outer face of a tyre
    front_m: float = 3.6  # from the rear axle to the front bumper
    max_steering_rad: float = 0.733  # of the road wheels: 42 degrees
    steering_rate_radps: float = 0.9  # at which they are turned at most
    max_acceleration_mps2: float = 4.0
    max_braking_mps2: float = 8.0


@dataclass(frozen=True)
class PlanConfig:
    """What the plan counts, in seconds."""

    speed_share: float = 0.85  # of the speed limit that is driven on average between junctions
    turn_mps: float = 5.0  # speed in junctions
    junction_s: float = 2.0  # wait at a junction, on average
    change_s: float = 4.0  # a lane change is avoided if that costs less
    change_room_m: float = 28.0  # a lane change needs so much road
    u_turn_s: float = 25.0  # turning round where the road ends
    turn_round_s: float = 40.0  # turning round in the street, to and fro; planned only where no other way is
    turn_stop_mps2: float = 1.2  # braking towards where it is done
    turn_room_m: float = 15.0  # from the beginning of a street to where one turns round in it, clear of the junction
    unmapped_factor: float = 1.6  # roads without views are driven by dead reckoning: half as fast, and the fix fades there
    mapped_within_m: float = 12.0  # a lane is mapped where a vertex lies this close along it
    backward_m: float = 6.0  # the path begins so far behind the vehicle, so that its first bend is smooth
    beyond_goal_m: float = 12.0  # and ends so far beyond the goal


@dataclass(frozen=True)
class DriveConfig:
    """How the vehicle is driven."""

    lateral_mps2: float = 2.5  # in bends, as passengers accept and recorded drives have it
    acceleration_mps2: float = 2.4  # as the briskest of SUMO's cars here
    braking_mps2: float = 2.0  # planned braking
    firm_braking_mps2: float = 4.0  # braking for what could not be foreseen; up to there one stops before a junction
    speed_share: float = 0.97  # of the speed limit: the speed is known to a few per cent only
    search_mps: float = 5.0  # without a fix
    doubt_mps: float = 4.0  # while the place is doubted
    unsure_m: float = 2.0  # standard deviation of the position from which on the vehicle slows down
    doubt_sigma_m: float = 3.0  # and from which on it doubts its place
    yaw_rate_radps: float = 0.6  # tight turns are driven slowly enough to turn the wheels in time
    creep_mps: float = 1.2
    error_decay_m: float = 3.0  # distance over which an offset from the path fades at low speed
    error_decay_s: float = 0.6  # and the time it takes at least
    preview_s: float = 0.15  # steering looks ahead by about its own delay
    speed_gain_1ps: float = 1.5
    headway_s: float = 1.4  # of the intelligent driver model (Treiber, Hennecke and Helbing, 2000)
    jam_gap_m: float = 2.5  # and its gap at rest
    following_mps2: float = 1.8  # and its acceleration: gentler than on a free road
    stop_before_m: float = 1.8  # the bumper stands so far before the end of the lane: a stop line begins .9 m before it
    goal_tolerance_m: float = 0.5  # the rear axle is held to stand at the goal within this
    goal_sigma_m: float = 1.5  # an arrival is said only if the position is known this well: twice that is the goal's 3 m
    settled_m: float = 30.0  # and if the fix has held over this distance
    blocked_s: float = 25.0  # standing so long before an obstacle, and not at a red light, the road counts as closed
    turns_round_s: float = 30.0  # and so long before one in the street itself, the vehicle turns round


@dataclass(frozen=True)
class WatchConfig:
    """When a sensor counts as failed."""

    frames_slow_s: float = 1.0  # without a usable frame the vehicle slows down from here on
    frames_halt_s: float = 3.0  # and stops from here on
    dark_level: float = 3.0  # mean level of 255 below which a frame is black: a street at night has 10 and more
    radar_slow_s: float = 0.5
    radar_halt_s: float = 1.5
    gyro_frozen_s: float = 2.0  # a gyro that says the very same so long while the vehicle drives
    gyro_off_radps: float = 0.25  # or differs so much from what the steering makes the vehicle turn


@dataclass(frozen=True)
class NavigatorConfig:
    """All parameters of the navigator."""

    localizer: LocalizerConfig = field(default_factory=LocalizerConfig)
    camera: CameraGeometry = field(default_factory=CameraGeometry)
    vehicle: VehicleShape = field(default_factory=VehicleShape)
    plan: PlanConfig = field(default_factory=PlanConfig)
    drive: DriveConfig = field(default_factory=DriveConfig)
    watch: WatchConfig = field(default_factory=WatchConfig)
    exact_poses: bool = False  # for upper bounds: what tells the pose is taken at its word, and nothing else corrects it
    read_road: bool = True  # whether the lane is read from the frames; False: only the localizer's pose counts
    search_network: bool = True  # whether hypotheses on the road network guide the search and find the place; False: sight alone
