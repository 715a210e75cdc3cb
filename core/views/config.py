"""The constants of this room: how frames become keyframes, view cells, evidence and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from hippodrome.core.views.egomotion.camera import RoadCamera


@dataclass(frozen=True)
class KeyframeConfig:
    """How densely keyframes follow one another."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    interval_s: float = 0.6  # between keyframes on a straight road at the median moving speed: about 5 m at 30 km/h
    turn_rad: float = math.radians(10.0)  # turn after which a keyframe is due anyway: turning changes the view faster than travel
    moving_share: float = 0.2  # share of the 90th percentile of speed below which the vehicle stands and speed is noise

    def __post_init__(self) -> None:
        if self.interval_s <= 0.0 or self.turn_rad <= 0.0 or not 0.0 < self.moving_share < 1.0:
            raise ValueError("view step: interval_s and turn_rad must be positive, moving_share within (0, 1)")


Kind: TypeAlias = Literal["gradient", "grey"]


@dataclass(frozen=True)
class ViewCellConfig:
    """How a frame becomes a template, and how two templates are compared."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    kind: Kind = "gradient"
    top: float = 0.2  # where the used part of the frame begins, as a share of its height; above is sky
    bottom: float = 0.7  # where the used part of the frame ends, as a share of its height; below is road, alike everywhere
    gradient_px: tuple[int, int] = (32, 64)  # rows and columns of the image that gradients are taken on
    cell_px: int = 4  # side of a histogram cell in pixels of that image; must divide both its sides
    bins: int = 8  # orientations of a histogram, over half a turn: opposite directions count as one
    contrast_floor: float = 4.0  # grey levels; gradients below it are noise and are not amplified by the normalisation
    gradient_shift: int = 1  # largest sideways shift in cells that is tried; 1 tolerates about 6 deg of yaw at 90 deg of view
    grey_px: tuple[int, int] = (10, 60)  # rows and columns of a grey template; RatSLAM's
    grey_patch_px: int = 7  # side of the neighbourhood that a grey pixel is normalised by
    grey_shift: int = 4  # largest sideways shift in columns that is tried with grey templates
    mean_horizon: int = 128  # views after which the running mean of the queries forgets: about 600 m, longer than a street

    def __post_init__(self) -> None:
        if not 0.0 <= self.top < self.bottom <= 1.0:
            raise ValueError(f"view cells: crop must satisfy 0 <= top < bottom <= 1, got top {self.top}, bottom {self.bottom}")
        if self.cell_px < 1 or any(side % self.cell_px or side <= 0 for side in self.gradient_px):
            raise ValueError(f"view cells: cell_px {self.cell_px} must divide gradient_px {self.gradient_px}")
        if self.bins < 2 or self.mean_horizon < 1 or min(self.gradient_shift, self.grey_shift) < 0:
            raise ValueError("view cells: bins >= 2, mean_horizon >= 1 and shifts >= 0 are required")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the descriptor before flattening: (columns, rows, bins) for "gradient", (columns, rows) for "grey"."""
        if self.kind == "grey":
            return self.grey_px[1], self.grey_px[0]
        return self.gradient_px[1] // self.cell_px, self.gradient_px[0] // self.cell_px, self.bins

    @property
    def max_shift(self) -> int:
        """Largest sideways shift, in columns of ``shape``, that is tried when two templates are compared."""
        return self.grey_shift if self.kind == "grey" else self.gradient_shift


@dataclass(frozen=True)
class SearchConfig:
    """When views are searched by sketches, and how thoroughly."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    exhaustive_cells: int = 12_000  # maps of up to this many views are searched exhaustively, which then is as fast: 4 ms
    sketch_size: int = 96  # bytes per sketch; 32 lose one best match in ten, 64 one in fifty, 128 one in two hundred
    candidates: int = 2_000  # views with the best sketches that are scored in full: one in fifty at 100,000 views
    hypotheses: int = 256  # best cells after the last view whose successors along the road are scored in full, too
    sample: int = 2_000  # evenly spread views that tell the mean and spread of all scores, to 2 % of a standard deviation

    def __post_init__(self) -> None:
        if min(self.exhaustive_cells, self.sketch_size, self.candidates, self.hypotheses, self.sample) < 1:
            raise ValueError("search: exhaustive_cells, sketch_size, candidates, hypotheses and sample must be at least 1")


@dataclass(frozen=True)
class SequenceConfig:
    """Constants of the sequence filter. Lengths are in units of the view spacing, so that nothing depends on the map's scale."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    memory: float = 0.6  # lambda, the weight of earlier evidence: about three views; longer chains run straight on at junctions
    length_tolerance: float = 0.6  # largest difference of a path's length to the way driven: 2 to 8 m fit at a spacing of 5 m
    turn_tolerance_rad: float = 0.5  # largest difference of a path's turn to the turn driven: tells the legs of a junction apart
    neighbourhood: float = 3.0  # cells closer than this to the best one show the same place and are no rivals
    min_cells: int = 30  # fewer cells make no statistics, and give no evidence: the spread of a handful is next to nothing
    sigma_floor: float = 0.03  # smallest spread of cosine similarities to divide by: that of pure noise in 1,024 dimensions
    grey_sigma_floor: float = 1.0  # smallest spread of similarities of kind "grey" to divide by, in grey levels

    def __post_init__(self) -> None:
        if not 0.0 <= self.memory < 1.0:
            raise ValueError(f"sequence: memory must lie in [0, 1), got {self.memory}")
        if min(self.length_tolerance, self.turn_tolerance_rad, self.neighbourhood, self.sigma_floor, self.grey_sigma_floor) <= 0:
            raise ValueError("sequence: tolerances, neighbourhood and floors must be positive")
        if self.min_cells < 2:
            raise ValueError(f"sequence: min_cells must be at least 2, got {self.min_cells}")

    def floor(self, kind: str) -> float:
        """Smallest standard deviation to divide similarities by, for view cells of this kind."""
        return self.sigma_floor if kind == "gradient" else self.grey_sigma_floor


NEAR_M = 2.4  # ahead of the rear axle, from which on the road is seen from above
LEVEL_SIGMA = 0.01  # tangent by which a camera that is said to look straight ahead and level does not


@dataclass(frozen=True)
class CameraGeometry:
    """Where the camera sits on the vehicle. It looks straight ahead and level."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    fov_deg: float = 90.0  # horizontal field of view
    height_m: float = 1.4  # height of the camera above the road; it gives the distances their unit
    forward_m: float = 1.6  # distance of the camera ahead of the rear axle

    def __post_init__(self) -> None:
        if not 0.0 < self.fov_deg < 180.0 or self.height_m <= 0.0:
            raise ValueError(f"camera: fov_deg must lie in (0, 180), height_m be positive, got {self.fov_deg}, {self.height_m}")

    def focal_px(self, width_px: int) -> float:
        """Focal length in pixels of frames of this width."""
        return 0.5 * width_px / math.tan(0.5 * math.radians(self.fov_deg))

    def sees_road_ahead(self, width_px: int, height_px: int) -> bool:
        """Whether frames of this size show the road from ``NEAR_M`` on."""
        return self.focal_px(width_px) * self.height_m / NEAR_M <= 0.5 * (height_px - 1)

    def on_road(self, width_px: int, height_px: int) -> RoadCamera:
        """The camera, with frames of this size, as the room ``egomotion`` takes it. It is known to be mounted straight."""
        from hippodrome.core.views.egomotion.camera import RoadCamera  # which loads OpenCV

        focal_px = self.focal_px(width_px)
        matrix = np.array([[focal_px, 0.0, 0.5 * (width_px - 1)], [0.0, focal_px, 0.5 * (height_px - 1)], [0.0, 0.0, 1.0]])
        return RoadCamera(matrix, self.height_m, self.forward_m, heading_sigma=LEVEL_SIGMA)
