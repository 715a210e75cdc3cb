"""The localizer's parameters and the two small objects that travel inside it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, TypeAlias

from hippodrome.core.attractors.attractor import AttractorConfig, paper_config
from hippodrome.core.attractors.grid_cells import GRID_INFORMATION
from hippodrome.core.types import FloatArray
from hippodrome.core.views.descriptors import ViewCellConfig
from hippodrome.core.views.index import SearchConfig
from hippodrome.core.views.keyframes import KeyframeConfig
from hippodrome.core.views.odometry import CameraGeometry
from hippodrome.core.views.sequence import SequenceConfig

Mode: TypeAlias = Literal["coupled", "paper", "kalman", "lanes"]


@dataclass(frozen=True)
class MotionNoise:
    """What the vehicle's self-motion is trusted for; between the named noise levels "paper" and "realistic"."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    speed: float = 0.03  # relative, white, per square root of a second
    gyro_rad_per_sqrt_s: float = 0.002  # angle random walk at least, 0.1 deg per sqrt(s); more where the signal shows more
    gyro_gain: float = 0.01  # share of the turned angle
    scale_prior: float = 0.3  # sigma of ln(metres per unit) of this drive about the map's: two drives' spreads of 0.2
    scale_walk_per_sqrt_m: float = 0.004  # ln(scale) wanders 4 % in 100 m


VISUAL_NOISE = MotionNoise(  # of self-motion from the frames: 5 % per 50 m and 1 deg at its best, and turns that it loses
    speed=0.1, gyro_rad_per_sqrt_s=0.005, gyro_gain=0.15, scale_walk_per_sqrt_m=0.012
)


@dataclass(frozen=True)
class InjectionNoise:
    """How well a reactivated view tells the pose. The map's own error is the map's to state and cannot be averaged away."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    along_m: float = 1.2  # best match among views 5 m apart, parabola between them, 0.7 m; consecutive errors correlate
    across_m: float = 0.4  # two drivers' wander inside a lane, 0.2 to 0.5 m, correlated over tens of metres
    heading_rad: float = 0.05
    map_m: float = 0.4  # along the road, beyond what the map's covariance says: that takes self-motion's errors for white
    wander_m: float = (
        0.3  # of this driver in the lane, 0.2 to 0.5 m: slow, and no view shows it; it goes into the covariance only
    )
    gate: float = 12.0  # squared Mahalanobis distance beyond which an injection conflicts (3 dof: 99.3 %)


@dataclass(frozen=True)
class PaperNetworks:
    """Mode "paper": the printed networks on one torus, with strengths that give them their best chance.

    At 0.2 per update, as in a public descendant, no injection outlives a second and the read-out never follows the views; at
    0.02 the calibration cells win and stay.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    head: AttractorConfig = field(default_factory=lambda: paper_config(inhibition_calibration=0.02))
    grid: AttractorConfig = field(default_factory=lambda: paper_config(GRID_INFORMATION, 0.02))
    period_m: float = 150.0
    strength: float = 0.3  # of E, per injection: the family uses 0.1 to 0.4


@dataclass(frozen=True)
class LocalizerConfig:
    """The localizer's modes and constants.

    Mode "coupled": attractor networks that know how their errors hang together. Mode "paper": the networks as printed.
    Yardsticks, given the same injections: "kalman", an extended Kalman filter, and "lanes", a Bayes filter on the lanes.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    mode: Mode = "coupled"
    self_motion: Literal["wheel", "visual"] = "wheel"  # visual: from the frames alone, the observations' own is not looked at
    camera: CameraGeometry = field(default_factory=CameraGeometry)  # for self_motion "visual"
    views: ViewCellConfig = field(default_factory=ViewCellConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    steps: KeyframeConfig = field(default_factory=lambda: KeyframeConfig(interval_s=0.4))  # denser than the map: 15 % less error
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    motion: MotionNoise = field(default_factory=MotionNoise)
    injection: InjectionNoise = field(default_factory=InjectionNoise)
    head: AttractorConfig = field(default_factory=lambda: AttractorConfig(information=4e4))  # sigma 0.005 rad at best
    grid: AttractorConfig = field(default_factory=lambda: AttractorConfig(information=1e4))  # sigma 0.15 m at best
    smallest_period_m: float = 97.0  # of the grid modules; half of it must exceed the drift between two injections
    paper: PaperNetworks = field(default_factory=PaperNetworks)
    margin: float = 1.2  # filtered margin at which a view cell is reactivated: 87 % right on its own
    fix_evidence: float = 5.0  # summed margin that makes a fix or overturns one: looks of margin 2, as in a like street, never do
    independent_m: float = 3.0  # looks closer together, as in a slow turn, see nearly the same and count less as witnesses
    doubt_evidence: float = 1.5  # of a challenger, at which "localized" is taken back; the incumbent's own holds against it
    seen_z: float = 2.0  # z-score of the believed place below which it is not what is seen: 6 where it is, 1 by chance
    seen_memory: float = 0.8  # of that z-score per look: a lorry ahead or a turn hides a place for some looks
    evidence_memory: float = 0.6  # of either's evidence, per look that does not renew it: like the sequence filter's
    lost_sigma_m: float = 6.0  # "localized" is taken back when the position's standard deviation exceeds this
    lane_sigma_m: float = 0.5  # of a driver about the lane's centre; 0: no lane pull
    step_tolerance_m: float = 3.5  # of a look's travel along the map: scale and spacing differ between drives
    mean_trust: int = 16  # views that the map's mean descriptor counts for in the query's running mean


@dataclass(frozen=True, slots=True, eq=False)
class Injection:
    """A pose that something seen vouches for: ``pose`` (3,), ``covariance`` (3, 3), network frame."""

    pose: FloatArray
    covariance: FloatArray
