"""How fast the vehicle is, in metres per second, though its odometry counts in units of unknown length.

Before views tell the scale, three things do: what is expected of it, the dashes that pass (``dashes``), and the vehicle
itself: in a steered turn the yaw rate is v tan(delta) / L (the single-track model), and the gyro measures it in radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.types import Observation

PRIOR_SIGMA = 0.28  # of ln(scale): two drives differ by a fifth each
GATE_SIGMAS, LEAST_SEEN_M = (
    2.5,
    0.5,
)  # what dashes told is dropped if it is farther from all else; from so many metres on it counts
VISUAL_SIGMA, VISUAL_M = 0.015, 15.0  # what passing dashes tell, once they have been seen over so many metres
TOLD_SIGMA, TOLD_PER_M = (
    0.03,
    0.02,
)  # what the localizer tells, and how fast it is followed: one wrong view moves its scale by a tenth
SETTLED_M, TOLD_AT_FIRST_PER_M = 20.0, 0.1  # after a fix the localizer finds the scale within some 20 m
STEERED_SIGMA, STEERED_RAD = 0.07, 0.4  # what turns tell, once the vehicle has turned so much
LEAST_BEND_1PM = 0.03  # straighter driving tells nothing of the scale
SEEN_MEMORY = 0.93  # of the sums of what was seen, per look: a look errs by 4 %, and in 25 m the scale wanders by 1 %
WANDER_PER_M = 6.4e-6  # variance of ln(scale) that each metre adds, until it is told again
MEMORY = 0.997  # of the sums, per step of a tenth of a second: the scale wanders over some hundred metres
WHEEL_RATE_RADPS = 0.9  # how fast the road wheels can be turned
SPEED_TRUST = 0.25  # weight of one speed measurement: its noise is 6 % at 10 Hz


@dataclass(frozen=True, slots=True)
class Motion:
    """What is known of the vehicle's motion."""

    speed_mps: float = 0.0  # negative backwards
    steering_rad: float = 0.0  # where the road wheels stand, as they were told to
    seen_m: float = 0.0  # sums over the drive: metres seen to pass, and units by the odometry meanwhile
    seen_units: float = 0.0
    turned: float = 0.0  # sum of yaw rate times what a unit turns: numerator of the least-squares scale
    turning: float = 0.0  # sum of the squares of the latter
    turned_rad: float = 0.0  # how much was turned in all, up to a bound
    told: float = math.nan  # ln(scale) as the localizer tells it, smoothed; nan until it does
    told_m: float = 0.0  # driven since it first did
    untold_m: float = 0.0  # driven since it last did
    unseen_m: float = 0.0  # driven since dashes told last

    def metres_per_unit(self, expected: float) -> float:
        """The scale: a mean of ln(scale) by what is expected, turns, the localizer, and dashes unless those contradict them."""
        mean, sigma = self.scale_without_dashes(expected)
        if not self.dashes_fit(expected):
            return math.exp(mean)
        trust, weight = self._visual_trust(), 1.0 / sigma**2
        return math.exp((weight * mean + trust * math.log(self.seen_m / self.seen_units)) / (weight + trust))

    def scale_sigma(self, expected: float) -> float:
        """Standard deviation of ln(scale), with all that is known of it."""
        _, sigma = self.scale_without_dashes(expected)
        if not self.dashes_fit(expected):
            return sigma
        return 1.0 / math.sqrt(1.0 / sigma**2 + self._visual_trust())

    def _visual_trust(self) -> float:
        """Inverse variance of ln(scale) by dashes; it fades with the metres since the last one."""
        return min(self.seen_m / VISUAL_M, 1.0) ** 2 / (VISUAL_SIGMA**2 + WANDER_PER_M * self.unseen_m)

    def dashes_fit(self, expected: float) -> bool:
        """Whether dashes told something that the rest does not contradict: one dash is easily taken for the next."""
        if self.seen_m <= LEAST_SEEN_M or self.seen_units <= 0.0:
            return False
        mean, sigma = self.scale_without_dashes(expected)
        return abs(math.log(self.seen_m / self.seen_units) - mean) < GATE_SIGMAS * math.hypot(sigma, VISUAL_SIGMA)

    def scale_without_dashes(self, expected: float) -> tuple[float, float]:
        """Mean and standard deviation of ln(scale) by what is expected, by turns, and by the localizer."""
        total, weight = math.log(expected) / PRIOR_SIGMA**2, 1.0 / PRIOR_SIGMA**2
        if self.turned > 0.0 and self.turning > 0.0:
            trust = min(self.turned_rad / STEERED_RAD, 1.0) ** 2 / STEERED_SIGMA**2
            total, weight = total + trust * math.log(self.turned / self.turning), weight + trust
        if not math.isnan(self.told):
            wandered = WANDER_PER_M * self.untold_m
            trust = 1.0 / (TOLD_SIGMA**2 + wandered + PRIOR_SIGMA**2 * math.exp(-self.told_m / SETTLED_M))
            total, weight = total + trust * self.told, weight + trust
        return total / weight, weight**-0.5


def sensed(motion: Motion, observation: Observation, metres_per_unit: float, vehicle: VehicleShape) -> Motion:
    """The motion after an observation."""
    dt_s, units = observation.dt_s, observation.speed * observation.dt_s
    speed = metres_per_unit * observation.speed
    smooth = speed if speed == 0.0 else motion.speed_mps + SPEED_TRUST * (speed - motion.speed_mps)
    bend = math.tan(motion.steering_rad) / vehicle.wheelbase_m
    turned, turning, turned_rad = motion.turned, motion.turning, motion.turned_rad
    if abs(bend) > LEAST_BEND_1PM and units > 0.0:
        turned = MEMORY * turned + observation.yaw_rate_radps * dt_s * bend * units
        turning = MEMORY * turning + (bend * units) ** 2
        turned_rad = min(turned_rad + abs(observation.yaw_rate_radps) * dt_s, 1.0)
    untold_m, unseen_m = (before_m + abs(metres_per_unit * units) for before_m in (motion.untold_m, motion.unseen_m))
    return replace(
        motion, speed_mps=smooth, turned=turned, turning=turning, turned_rad=turned_rad, untold_m=untold_m, unseen_m=unseen_m
    )


def seen(motion: Motion, metres: float, units: float) -> Motion:
    """The motion after frames told that so many units of the odometry were so many metres."""
    seen_m, seen_units = SEEN_MEMORY * motion.seen_m + metres, SEEN_MEMORY * motion.seen_units + units
    return replace(motion, seen_m=seen_m, seen_units=seen_units, unseen_m=0.0)


def unseen(motion: Motion) -> Motion:
    """The motion without what frames told."""
    return replace(motion, seen_m=0.0, seen_units=0.0)


def commanded(motion: Motion, acceleration_mps2: float, steering_rad: float, dt_s: float, reverse: bool = False) -> Motion:
    """The motion as a command makes it: the wheels turn as fast as they can, the speed changes as it was told to.

    Accelerations are along the gear; a vehicle that rolls the other way brakes first.
    """
    most = WHEEL_RATE_RADPS * dt_s
    wheels = motion.steering_rad + min(max(steering_rad - motion.steering_rad, -most), most)
    gear = -1.0 if reverse else 1.0
    along = gear * motion.speed_mps
    if along < 0.0:
        along = min(along + abs(acceleration_mps2) * dt_s, 0.0)
    else:
        along = max(along + acceleration_mps2 * dt_s, 0.0)
    return replace(motion, speed_mps=gear * along, steering_rad=wheels)


def told(motion: Motion, metres_per_unit: float, distance_m: float) -> Motion:
    """The motion after the localizer told its scale, over a distance in which it was sure of its place."""
    new = math.log(metres_per_unit)
    if math.isnan(motion.told):
        return replace(motion, told=new, untold_m=0.0)
    share = TOLD_PER_M if motion.told_m > 2.0 * SETTLED_M else TOLD_AT_FIRST_PER_M
    far_m = abs(distance_m)
    smooth = motion.told + min(share * far_m, 1.0) * (new - motion.told)
    return replace(motion, told=smooth, told_m=motion.told_m + far_m, untold_m=0.0)


def untold(motion: Motion) -> Motion:
    """The motion without what the localizer told of the scale."""
    return replace(motion, told=math.nan, told_m=0.0)
