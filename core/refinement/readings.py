"""The road as the camera read it, as factors on the keyframes: the place in the lane, the heading against it, the lane's end.

A driver is somewhere in his lane; the reader (``core.reading``) says where, to centimetres. As a corner turns across into along,
the place across one street also tells how far along the next one the vehicle is. Stop lines and junction mouths tell it directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.reading.types import STOP_LINE_BEFORE_END_M, LaneEnd
from hippodrome.core.refinement.factors import State, UnaryFactors
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.solvers.robust import geman_mcclure_weight
from hippodrome.core.types import Float32Array, FloatArray, LaneReadings

LANE_SIGMA_M: Final = 0.06  # errors that the readings of one street share
LANE_SIGMA_RAD: Final = 0.03  # lanes are drawn in straight pieces, whose directions jump
END_SIGMA_M: Final = {LaneEnd.STOP_LINE: 0.1, LaneEnd.MOUTH: 0.3}  # errors of where the network ends a lane, and of the reading
BEND_SHIFT_M: Final = 0.3  # along a bend, between the lane as it is drawn, in straight pieces, and as it is painted
LOOSE_RAD_PER_M: Final = 0.1  # of the heading, for each metre by which the keyframes may be elsewhere on the line
LOSES_AT: Final = 3.0  # error in sigmas at which a reading has lost three quarters of its weight


@dataclass(frozen=True, slots=True, eq=False)
class ReadTargets:
    """What was read at the S keyframes, laid on the line of the route; an infinite sigma where nothing was read."""

    across_m: FloatArray  # (S,) left of the line
    across_sigma_m: FloatArray  # (S,)
    turned_rad: FloatArray  # (S,) against the line's heading
    turned_sigma_rad: FloatArray  # (S,)
    along_m: FloatArray  # (S,) ahead of the road target
    along_sigma_m: FloatArray  # (S,)


@dataclass(frozen=True, slots=True, eq=False)
class ReadLanes:
    """What was read at the S keyframes, and the route's line and network that it is compared with."""

    readings: LaneReadings
    line: RouteLine
    network: RoadNetwork
    survey_slope: float  # by how much a drawn lane's direction may differ from the true one, rad

    def at(self, arc_m: FloatArray, curvature_1pm: FloatArray, added_lateral_m: FloatArray, loose_m: float) -> ReadTargets:
        """What the readings say of keyframes that lie at the arc lengths ``arc_m`` (S,) of the line.

        Within junctions nothing is painted, and what was read there is another lane's.

        Args:
            arc_m: (S,) present place of each keyframe on the line.
            curvature_1pm: (S,) of the line, without sign.
            added_lateral_m: (S,) lateral sigma where it is unknown which of several lanes is driven.
            loose_m: sigma that is added to all places as long as the keyframes are not where they belong yet.
        """
        read, line, network = self.readings, self.line, self.network
        sample = np.clip(np.searchsorted(line.arc_m, arc_m), 0, len(line.arc_m) - 1)
        lane = np.maximum(line.lane[sample], 0)
        painted = (line.lane[sample] >= 0) & ~network.is_internal[lane]
        slope = np.hypot(np.hypot(BEND_SHIFT_M * curvature_1pm, self.survey_slope), loose_m * LOOSE_RAD_PER_M)
        across = _sigma(read.offset_variance_m2, painted, LANE_SIGMA_M, np.hypot(added_lateral_m, loose_m))
        turned = _sigma(read.heading_variance_rad2, painted, LANE_SIGMA_RAD, slope)
        to_end_m = network.lane_lengths_m()[lane] - (line.position_m[sample] + arc_m - line.arc_m[sample])
        stop = read.end == LaneEnd.STOP_LINE
        own = np.where(stop, END_SIGMA_M[LaneEnd.STOP_LINE], END_SIGMA_M[LaneEnd.MOUTH])
        along = _sigma(read.end_variance_m2, painted & (read.end != LaneEnd.NOTHING), own, loose_m)
        nearer_m = to_end_m - read.end_m - np.where(stop, STOP_LINE_BEFORE_END_M, 0.0)
        known = np.isfinite(np.stack([across, turned, along]))
        values = np.where(known, np.stack([read.offset_m, read.heading_rad, nearer_m]), 0.0)
        return ReadTargets(values[0], across, values[1], turned, values[2], along)


def _sigma(variance: Float32Array, holds: BoolArray, own: FloatArray | float, added: FloatArray | float) -> FloatArray:
    """Sigma (S,) of what was read with a variance (S,), with errors of its own kind; infinite where it does not hold."""
    sigma: FloatArray = np.where(holds, np.sqrt(variance.astype(np.float64) + np.square(own) + np.square(added)), np.inf)
    return sigma


def reading_factors(state: State, points_m: FloatArray, heading_rad: FloatArray, read: ReadTargets) -> UnaryFactors:
    """The readings at each keyframe: across the lane, heading against it, and along it; each with a Geman-McClure weight.

        r = ((n . (p + e - q) - a) / sigma_a,  warp(psi - theta - h) / sigma_h,  (t . (p + e - q) - b) / sigma_b)

    q, theta, n and t are as in ``residuals.road_factors``; a and h are the place and heading in the lane that were read, b is how
    far ahead of q the keyframe lies by the end of the lane that was read.
    """
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    off = state.drawn_points_m - points_m
    residual = np.column_stack(
        [
            (-sin * off[:, 0] + cos * off[:, 1] - read.across_m) / read.across_sigma_m,
            wrap(state.poses[:, 2] - heading_rad - read.turned_rad) / read.turned_sigma_rad,
            (cos * off[:, 0] + sin * off[:, 1] - read.along_m) / read.along_sigma_m,
        ]
    )
    jacobian = np.zeros((len(off), 3, state.width))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -sin / read.across_sigma_m, cos / read.across_sigma_m
    jacobian[:, 1, 2] = 1.0 / read.turned_sigma_rad
    jacobian[:, 2, 0], jacobian[:, 2, 1] = cos / read.along_sigma_m, sin / read.along_sigma_m
    jacobian[:, :, 4:] = jacobian[:, :, : state.width - 4]
    weight = geman_mcclure_weight(residual**2, LOSES_AT**2)
    gain = np.sqrt(weight)
    return UnaryFactors(residual * gain, jacobian * gain[..., None], weight)
