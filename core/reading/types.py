"""What one frame says about the lane that the vehicle is in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

STOP_LINE_BEFORE_END_M = 0.9  # from the near edge of a stop line to the end of its lane


class LaneEnd(IntEnum):
    """What is seen across the lane ahead."""

    NOTHING = 0
    STOP_LINE = 1
    MOUTH = 2  # the borders of the lane end: a junction begins


@dataclass(frozen=True, slots=True)
class RoadReading:
    """The lane ahead, in the vehicle's axes (rear axle, x forward, y left). A variance of ``inf`` means: nothing seen.

    Args:
        offset_m: of the rear axle from the middle of its lane, left positive.
        heading_rad: of the vehicle against the lane where the rear axle is, counter-clockwise positive.
        curvature_1pm: of the lane, left positive.
        curvature_change_1pm2: of the curvature along the lane.
        left_edge: probability that the left border is the edge of the road, with no lane beyond; nan where
            the border is not seen.
        right_edge: the same for the right one.
        lane_width_m: between the borders; nan if only one of them was seen.
        end_m: from the rear axle along the lane to the stop line or the junction's mouth.
        end: which of the two.
    """

    offset_m: float = math.nan
    offset_variance_m2: float = math.inf
    heading_rad: float = math.nan
    heading_variance_rad2: float = math.inf
    curvature_1pm: float = math.nan
    curvature_variance_1pm2: float = math.inf
    lane_width_m: float = math.nan
    end_m: float = math.nan
    end_variance_m2: float = math.inf
    end: LaneEnd = LaneEnd.NOTHING
    curvature_change_1pm2: float = 0.0
    left_edge: float = math.nan
    right_edge: float = math.nan

    @property
    def sees_lane(self) -> bool:
        """Whether the lateral place in the lane is known at all."""
        return self.offset_variance_m2 < math.inf
