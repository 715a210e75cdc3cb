"""Constants of the mapper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from hippodrome.core.attractors.config import GRID_INFORMATION, AttractorConfig
from hippodrome.core.views.config import CameraGeometry, KeyframeConfig, SequenceConfig, ViewCellConfig


@dataclass(frozen=True)
class PlaceMemoryConfig:
    """When a view counts as one of a place seen before."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    view_cells: ViewCellConfig = field(default_factory=ViewCellConfig)
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    start_margin: float = 4.0  # least filtered margin on meeting an old road; strict, as a wrong closure breeds more of them
    closure_margin: float = 2.0  # least filtered margin once on an old road
    waiting_views: int = 16  # views that are pending before they are stored; the loop around the smallest block is longer
    support_z: float = 3.0  # least z-score of the view itself: the filter alone would run on past a junction, or back before one
    column_rad: float = 0.1  # heading per column of shift, between the mean (fov / columns) and the centre of a 90 deg image

    def __post_init__(self) -> None:
        if not 0.0 < self.closure_margin <= self.start_margin:
            raise ValueError("place memory: 0 < closure_margin <= start_margin is required")
        if self.waiting_views < 1 or self.column_rad <= 0.0:
            raise ValueError("place memory: waiting_views and column_rad must be positive")


@dataclass(frozen=True)
class PoseGraphConfig:
    """The robust loss of the closures, and when to stop."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    robust_scale: float = 3.0  # error of a closure in sigmas at which its weight has fallen to a quarter
    rounds: int = 15  # rounds of re-weighting the closures, each with one Gauss-Newton step
    anneal: float = 4.0  # factor by which the squared width of the loss shrinks in each round, down to robust_scale

    def __post_init__(self) -> None:
        if self.robust_scale <= 0.0 or self.rounds < 1 or self.anneal <= 1.0:
            raise ValueError("pose graph: robust_scale > 0, rounds >= 1 and anneal > 1 are required")


@dataclass(frozen=True)
class ExperienceMapConfig:
    """Standard deviations of the edges, and how the poses relax.

    Lengths are relative to the way driven or to the spacing of keyframes, so that no unit of length enters.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    relaxation: Literal["robust", "ratslam"] = "robust"
    pose_graph: PoseGraphConfig = field(default_factory=PoseGraphConfig)
    odometry_along: float = 0.1  # sigma of a driven step's length, as a share of it: covers the slow drift of the scale
    odometry_across: float = 0.02  # sigma of a driven step sideways, as a share of its length
    odometry_turn_rad: float = 0.02  # sigma of the turn of a driven step: some tens of degrees over a thousand steps
    closure_along: float = 0.2  # sigma of a closure along the road, in distances between two keyframes: 1 m at 5 m
    closure_across: float = 0.1  # sigma of a closure across the road, in distances between two keyframes
    closure_turn_rad: float = 0.06
    steady_reach: float = 3.0  # distances between keyframes over which closures share a median offset, before and after
    ratslam_correction: float = 0.5  # share of each edge's error that RatSLAM's relaxation corrects in one sweep
    ratslam_sweeps: int = 100  # sweeps of RatSLAM's relaxation; RatSLAM itself does a few a frame, thousands in a drive

    def __post_init__(self) -> None:
        odometry = (self.odometry_along, self.odometry_across, self.odometry_turn_rad)
        closure = (self.closure_along, self.closure_across, self.closure_turn_rad)
        if min(*odometry, *closure) <= 0.0:
            raise ValueError("experience map: standard deviations must be positive")
        if not 0.0 < self.ratslam_correction <= 1.0 or self.ratslam_sweeps < 1:
            raise ValueError("experience map: ratslam_correction must lie in (0, 1] and ratslam_sweeps be at least 1")


@dataclass(frozen=True)
class MapperAttractorConfig:
    """The mapper's networks, and how strongly a recognised place corrects them."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    head: AttractorConfig = field(default_factory=AttractorConfig)
    grid: AttractorConfig = field(default_factory=lambda: AttractorConfig(information=GRID_INFORMATION))
    injection_share: float = 0.1  # reliability that a recognised view injects, as a share of the information E
    period_spacings: float = 20.0  # smallest period of the tori, in distances between two keyframes: about 100 m at 5 m

    def __post_init__(self) -> None:
        if not 0.0 < self.injection_share <= 1.0 or self.period_spacings <= 0.0:
            raise ValueError("mapper attractor: injection_share must lie in (0, 1] and period_spacings be positive")


@dataclass(frozen=True)
class MapperConfig:
    """Every constant of the mapper."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    view_step: KeyframeConfig = field(default_factory=KeyframeConfig)
    memory: PlaceMemoryConfig = field(default_factory=PlaceMemoryConfig)
    experience_map: ExperienceMapConfig = field(default_factory=ExperienceMapConfig)
    attractor: MapperAttractorConfig = field(default_factory=MapperAttractorConfig)
    road_reading: bool = False  # keep what the keyframes show of the lane, for the refinement; the camera must be known
    camera: CameraGeometry = field(default_factory=CameraGeometry)  # for road_reading
