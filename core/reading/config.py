"""What the reader assumes of roads and how far it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class ReaderConfig:
    """Sizes of what is painted on roads, and the range in which it is looked for. Lengths are in metres."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    far_m: float = 18.0  # ahead of the rear axle; beyond it a line is narrower than a pixel and roads have bent
    line_m: float = 0.14  # width of a painted line
    edge_inset_m: float = 0.2  # a line at the road's edge is painted this far inside of the lane's border, others lie on it
    longest_dash_m: float = 6.3  # what goes on for longer is a solid line
    stop_line_m: float = 0.4  # depth of a stop line
    lane_width_m: float = 3.2  # expected while no lane of which both borders were seen has been driven
    lane_width_sigma_m: float = 0.25
    paint_m: float = 0.05  # height of the painted surface above the plane that the camera's height is measured from
    largest_sigma_m: float = 0.3  # a lateral place that is known no better than this is not told

    def __post_init__(self) -> None:
        for name in ("far_m", "line_m", "longest_dash_m", "stop_line_m", "lane_width_m", "lane_width_sigma_m", "largest_sigma_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"reading: {name} must be positive, got {getattr(self, name)}")
