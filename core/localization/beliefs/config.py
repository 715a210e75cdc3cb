"""What the pose beliefs need to know: which one to use, the noise of self-motion and views, and the networks' constants."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, TypeAlias

from hippodrome.core.attractors.config import GRID_INFORMATION, AttractorConfig, paper_config

Mode: TypeAlias = Literal["coupled", "paper", "kalman", "lanes"]


@dataclass(frozen=True)
class MotionNoise:
    """Noise of the self-motion, between the simulator's noise levels "paper" and "realistic"."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    speed: float = 0.03  # standard deviation of the speed, relative to it: white noise, per square root of a second
    gyro_rad_per_sqrt_s: float = 0.002  # random walk of the heading, 0.1 deg per sqrt(s); more where the signal shows more
    gyro_gain: float = 0.01  # error of each turn, as a share of the turned angle
    scale_prior: float = 0.3  # standard deviation of ln(metres per unit) between the mapping drive and this one, 0.2 each
    scale_walk_per_sqrt_m: float = 0.004  # random walk of ln(metres per unit): 4 % in 100 m


# For self-motion from the frames: 5 % of the distance in 50 m, the heading to 1 deg at best, and turns that are missed in part.
VISUAL_NOISE = MotionNoise(speed=0.1, gyro_rad_per_sqrt_s=0.005, gyro_gain=0.15, scale_walk_per_sqrt_m=0.012)


@dataclass(frozen=True)
class InjectionNoise:
    """How well a recognised view tells the pose. The map's own error is stated by the map and cannot be averaged away."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    along_m: float = 1.2  # standard deviation along the road: 0.7 m between views 5 m apart, and more as errors repeat
    across_m: float = 0.4  # standard deviation across the road: two drivers' wander in a lane, 0.2 to 0.5 m over tens of metres
    heading_rad: float = 0.05  # standard deviation of the heading
    map_m: float = 0.4  # error of the map along the road beyond its covariance, for which errors of self-motion are white noise
    wander_m: float = 0.3  # wander of this driver in the lane, 0.2 to 0.5 m: no view shows it, so it is added to the covariance
    gate: float = 12.0  # squared Mahalanobis distance up to which a view agrees with the belief: 99.3 % of right ones (3 dof)


@dataclass(frozen=True)
class PaperNetworks:
    """Mode "paper": the printed networks on one torus, with strengths that give them their best chance.

    With an inhibition of 0.2 per update, as in a public descendant, no injection outlives a second and the read-out never follows
    the views; with 0.02 the calibration cells win and stay.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    head: AttractorConfig = field(default_factory=lambda: paper_config(inhibition_calibration=0.02))
    grid: AttractorConfig = field(default_factory=lambda: paper_config(GRID_INFORMATION, 0.02))
    period_m: float = 150.0  # period of the single grid module
    strength: float = 0.3  # reliability of an injection, as a share of the networks' information E: the family uses 0.1 to 0.4


@dataclass(frozen=True)
class BeliefConfig:
    """Which belief to use, and the constants of all of them."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    mode: Mode = "coupled"  # coupled: attractors with covariances between them; paper: as printed; kalman, lanes: yardsticks
    motion: MotionNoise = field(default_factory=MotionNoise)
    injection: InjectionNoise = field(default_factory=InjectionNoise)
    head: AttractorConfig = field(default_factory=lambda: AttractorConfig(information=4e4))  # sigma 0.005 rad at best
    grid: AttractorConfig = field(default_factory=lambda: AttractorConfig(information=1e4))  # sigma 0.15 m at best
    smallest_period_m: float = 97.0  # smallest period of the grid modules; half of it must exceed the drift between two fixes
    paper: PaperNetworks = field(default_factory=PaperNetworks)
