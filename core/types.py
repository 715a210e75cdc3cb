"""The objects that travel through hippodrome.

Frames of reference. *Body*: rear axle of the vehicle, x forward, y left, heading counter-clockwise from x.
*Network*: the road network's metric frame (SUMO coordinates, x east, y north). *Semi-metric*: the mapper's own frame; it begins
at the first vertex and is measured in map units: one unit is an unknown, slowly varying number of metres (monocular scale).
A pose is ``(x, y, heading_rad)``. Arrays named ``*_m`` are metres in the network frame; poses without a unit are in map units.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Float32Array: TypeAlias = NDArray[np.float32]
IntArray: TypeAlias = NDArray[np.int32]
Int8Array: TypeAlias = NDArray[np.int8]
UInt8Array: TypeAlias = NDArray[np.uint8]
Frame: TypeAlias = NDArray[np.uint8]  # (H, W, 3) RGB or (H, W) grey


class HippodromeError(Exception):
    """Base of the errors a user can cause and cure. The message names the value, the limit and the place."""


@dataclass(frozen=True, slots=True)
class Observation:
    """What the vehicle senses over ``(t_s - dt_s, t_s]``: all that the mapper and the localizer ever receive."""

    t_s: float
    dt_s: float
    speed: float  # mean forward speed, map units per second; metres per unit are unknown and drift
    yaw_rate_radps: float  # mean, counter-clockwise positive
    frame: Frame | None  # taken at t_s; None when the camera is slower than the odometry


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """Where the vehicle really is at ``t_s`` (network frame). It goes to ``eval`` only."""

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    lane_id: str
    lane_position_m: float  # arc length along the lane's centreline


Step: TypeAlias = tuple[Observation, GroundTruth]
Episode: TypeAlias = Iterable[Step]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Time-stamped poses. ``t_s`` (N,) strictly increasing; ``poses`` (N, 3)."""

    t_s: FloatArray
    poses: FloatArray


class EdgeKind(IntEnum):
    """How an edge of the experience map came about."""

    ODOMETRY = 0
    CLOSURE = 1


class MatchStatus(IntEnum):
    """What the refinement says about a vertex."""

    MATCHED = 0
    AMBIGUOUS = 1
    OFF_NETWORK = 2
    NO_ROUTE = 3


class LocalizationStatus(IntEnum):
    """How the localizer stands to its own answer."""

    UNKNOWN = 0  # no fix yet
    LOCALIZED = 1
    OFF_MAP = 2  # dead reckoning from the last fix has left every mapped road
    DOUBTED = 3  # views vouch for another place more than for this one
    LOST = 4  # the fix is too old to say where


@dataclass(frozen=True, slots=True)
class ViewCells:
    """Local view cells: C stored views of dimension D."""

    kind: Literal["gradient", "grey"]
    templates: Int8Array | UInt8Array  # (C, D)
    mean: Float32Array  # (D,) mean descriptor of the map, subtracted before matching ("gradient"); zeros for "grey"
    shape: tuple[int, ...]  # the descriptor before flattening, e.g. (rows, columns, bins)


@dataclass(frozen=True, slots=True)
class Edges:
    """E edges of the experience map; ``motion`` is (p_ab, psi_ab) of Eq. (11), target seen from source, map units and rad."""

    source: IntArray  # (E,)
    target: IntArray  # (E,)
    motion: FloatArray  # (E, 3)
    sigma: FloatArray  # (E, 3) standard deviations along, across, heading
    kind: UInt8Array  # (E,) EdgeKind
    margin: Float32Array  # (E,) evidence of a closure (filtered margin); 0 for odometry


@dataclass(frozen=True, slots=True)
class Visits:
    """The time-ordered visit sequence with *raw* relative motions, undistorted by closures or the attractor read-out."""

    t_s: FloatArray  # (S,)
    vertex: IntArray  # (S,)
    motion: FloatArray  # (S, 3) body motion since the previous visit, map units and rad; row 0 is zero


@dataclass(frozen=True, slots=True)
class AttractorStates:
    """Head-direction and grid-cell networks at each vertex (Eqs. 1, 2). M grid modules.

    Populations: 0 integrator, 1 calibration.
    """

    head_mean_rad: Float32Array  # (V, 2)
    head_reliability: Float32Array  # (V, 2) 1/sigma^2, 1/rad^2
    grid_period: Float32Array  # (M,) torus period, map units
    grid_mean_rad: Float32Array  # (V, M, 2 populations, 2 axes) phase on the torus
    grid_reliability: Float32Array  # (V, M, 2 populations, 2 axes) 1/rad^2


@dataclass(frozen=True, slots=True)
class RoadMatch:
    """Where each vertex lies on the road network, or why it does not."""

    lane_ids: tuple[str, ...]  # names that ``lane`` indexes
    lane: IntArray  # (V,) -1: unmatched
    position_m: FloatArray  # (V,) arc length on the lane; nan: unmatched
    status: UInt8Array  # (V,) MatchStatus


@dataclass(frozen=True, slots=True)
class CognitiveMap:
    """The cognitive map, semi-metric as built or topometric ("network") as refined. V vertices, one per visit of a place."""

    frame: Literal["semi-metric", "network"]
    t_s: FloatArray  # (V,) when the vertex was made
    poses: FloatArray  # (V, 3) map units in the semi-metric frame; metres in the network frame
    view_cell: IntArray  # (V,) index into view_cells; several vertices may share a cell
    view_cells: ViewCells
    edges: Edges
    visits: Visits
    attractors: AttractorStates
    log_scale: FloatArray | None = None  # (V,) ln(metres per map unit); network frame only
    covariance: FloatArray | None = None  # (V, 3, 3) m, m, rad; network frame only
    road_match: RoadMatch | None = None  # network frame only


@dataclass(frozen=True, slots=True)
class StartPose:
    """A prior on the first vertex's pose in the network frame, when the user knows where the drive began."""

    x_m: float
    y_m: float
    heading_rad: float
    sigma_m: float = 5.0
    sigma_rad: float = 0.2


@dataclass(frozen=True, slots=True)
class LocalizationEstimate:
    """The localizer's answer after one observation, in the network frame."""

    t_s: float
    pose: FloatArray  # (3,) m, m, rad
    covariance: FloatArray  # (3, 3)
    localized: bool  # declared by the localizer itself, and taken back when the evidence is gone
    confidence: float  # filtered match margin of the last frame, 0 when none
    view_cell: int  # the active local view cell, -1 when none
    head_direction_rad: FloatArray  # (2,) integrator, calibration means
    head_reliability: FloatArray  # (2,) 1/rad^2
    grid_phase_rad: FloatArray  # (M, 2 populations, 2 axes)
    grid_reliability: FloatArray  # (M, 2 populations, 2 axes) 1/rad^2
    status: LocalizationStatus = LocalizationStatus.UNKNOWN  # why ``localized`` is what it is


@dataclass(frozen=True, slots=True)
class MatchBreak:
    """A stretch of vertices that the road match could not vouch for, and why. Never silent, never guessed."""

    first_vertex: int
    last_vertex: int  # inclusive
    status: MatchStatus
    cause: str


@dataclass(frozen=True, slots=True)
class Refinement:
    """A semi-metric map turned topometric, with everything a user needs in order to trust it."""

    cognitive_map: CognitiveMap  # frame "network"
    breaks: tuple[MatchBreak, ...]
    estimates: dict[str, float]  # parameters estimated from the data, units in the names: sigma_z_m, beta_m, ...
