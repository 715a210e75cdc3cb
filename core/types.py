"""The objects that travel through hippodrome.

Frames of reference. *Body*: rear axle of the vehicle, x forward, y left, heading counter-clockwise from x.
*Network*: the road network's metric frame (SUMO coordinates, x east, y north). *Semi-metric*: the mapper's own frame; it begins
at the first vertex and is measured in map units: one unit is an unknown, slowly varying number of metres (monocular scale).
A pose is ``(x, y, heading_rad)``. Arrays named ``*_m`` are metres in the network frame; poses without a unit are in map units.

Objects that hold arrays compare by identity: ``a == b`` asks whether both names mean the same object. Compare their arrays with
``numpy.array_equal``. Their ``repr`` shows the arrays' types and shapes, not their contents.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Float32Array: TypeAlias = NDArray[np.float32]
IntArray: TypeAlias = NDArray[np.int32]
Int8Array: TypeAlias = NDArray[np.int8]
UInt8Array: TypeAlias = NDArray[np.uint8]
Frame: TypeAlias = NDArray[np.uint8]  # (H, W, 3) RGB or (H, W) grey
PAINT_PLACES = 45  # places ahead of a visit at which paint along a border is kept
UNSEEN_PERCENT = 255  # in the place of a probability in per cent, of what was not seen


class HippodromeError(Exception):
    """Base of the errors a user can cause and cure. The message names the value, the limit and the place."""


class ObservationError(HippodromeError, ValueError):
    """A sensor reading that cannot be one. The message names the field, its value and what is expected."""


class ShortRepr:
    """A ``repr`` of one line: arrays by type and shape, long tuples by their length."""

    __slots__ = ()

    def __repr__(self) -> str:
        shown = (f"{field.name}={_short(getattr(self, field.name))}" for field in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    """One value in a ``repr`` of one line: an array by type and shape, a long tuple by its length."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    if isinstance(value, tuple) and len(value) > 4:
        return f"<{len(value)} items>"
    return repr(value)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Observation(ShortRepr):
    """What the vehicle senses over ``(t_s - dt_s, t_s]``: all that the mapper and the localizer ever receive.

    Args:
        t_s: time at the end of the interval, seconds, on any clock that does not jump.
        dt_s: length of the interval, seconds, positive.
        speed: mean forward speed over the interval, map units per second, negative where the vehicle drove backwards. Metres per
            map unit may be unknown and may drift.
        yaw_rate_radps: mean yaw rate over the interval, counter-clockwise positive.
        frame: camera frame taken at ``t_s``: (H, W, 3) RGB or (H, W) grey, 8 bits; None where the camera took none.

    Raises:
        ObservationError: a number is not finite, ``dt_s`` is not positive, or ``frame`` is not such an image.
    """

    t_s: float
    dt_s: float
    speed: float
    yaw_rate_radps: float
    frame: Frame | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.t_s) and math.isfinite(self.speed) and math.isfinite(self.yaw_rate_radps)):
            name = next(name for name in ("t_s", "speed", "yaw_rate_radps") if not math.isfinite(getattr(self, name)))
            raise ObservationError(
                f"observation at t_s={self.t_s}: {name} is {getattr(self, name)}, a finite number is expected; "
                "leave such a reading out and give the next one the longer dt_s"
            )
        if not 0.0 < self.dt_s < math.inf:
            raise ObservationError(
                f"observation at t_s={self.t_s}: dt_s is {self.dt_s}, a positive number of seconds is expected: "
                "the time since the observation before"
            )
        if self.frame is not None:
            _check_frame(self.frame, self.t_s)


def _check_frame(frame: Frame, t_s: float) -> None:
    """Raise ObservationError unless the frame is an image of 8 bits, grey (H, W) or RGB (H, W, 3), and not empty."""
    shape = getattr(frame, "shape", None)
    if isinstance(frame, np.ndarray) and frame.dtype == np.uint8 and frame.size and (frame.ndim == 2 or frame.shape[2:] == (3,)):
        return
    found = f"{frame.dtype} of shape {shape}" if isinstance(frame, np.ndarray) else type(frame).__name__
    raise ObservationError(
        f"observation at t_s={t_s}: frame is {found}; an array of uint8 of shape (H, W, 3), RGB, or (H, W), grey, is expected"
    )


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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trajectory(ShortRepr):
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
    """How far the localizer trusts its own estimate."""

    UNKNOWN = 0  # no fix yet
    LOCALIZED = 1
    OFF_MAP = 2  # dead reckoning from the last fix has left every mapped road
    DOUBTED = 3  # views vouch for another place more than for this one
    LOST = 4  # the fix is too old to say where


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ViewCells(ShortRepr):
    """Local view cells: C stored views of dimension D."""

    kind: Literal["gradient", "grey"]
    templates: Int8Array | UInt8Array  # (C, D)
    mean: Float32Array  # (D,) mean descriptor of the map, subtracted before matching ("gradient"); zeros for "grey"
    shape: tuple[int, ...]  # the descriptor before flattening, e.g. (rows, columns, bins)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Edges(ShortRepr):
    """E edges of the experience map; ``motion`` is (p_ab, psi_ab) of Eq. (11), target seen from source, map units and rad."""

    source: IntArray  # (E,)
    target: IntArray  # (E,)
    motion: FloatArray  # (E, 3)
    sigma: FloatArray  # (E, 3) standard deviations along, across, heading
    kind: UInt8Array  # (E,) EdgeKind
    margin: Float32Array  # (E,) evidence of a closure (filtered margin); 0 for odometry


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LaneReadings(ShortRepr):
    """The lane as it was read in the frame of each visit; a variance of inf and a value of nan where nothing was read."""

    offset_m: Float32Array  # (S,) of the rear axle from the middle of its lane, left positive
    offset_variance_m2: Float32Array  # (S,)
    heading_rad: Float32Array  # (S,) of the vehicle against the lane, counter-clockwise positive
    heading_variance_rad2: Float32Array  # (S,)
    curvature_1pm: Float32Array  # (S,) of the lane, left positive
    curvature_change_1pm2: Float32Array  # (S,) of the curvature along the lane
    end_m: Float32Array  # (S,) from the rear axle along the lane to its stop line or its junction's mouth
    end_variance_m2: Float32Array  # (S,)
    end: UInt8Array  # (S,) 0 nothing, 1 stop line, 2 mouth
    # (S, 2) probability that the left and the right border are the edge of the road, with no lane beyond, or UNSEEN_PERCENT.
    edge_percent: UInt8Array | None = None  # None in maps from before it was kept
    # (S, 2, PAINT_PLACES) paint ahead along the left and the right border (``core.reading.dashes``); 0 where there is none.
    paint: UInt8Array | None = None  # None in maps from before it was kept


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Visits(ShortRepr):
    """The time-ordered visit sequence with *raw* relative motions, undistorted by closures or the attractor read-out."""

    t_s: FloatArray  # (S,)
    vertex: IntArray  # (S,)
    motion: FloatArray  # (S, 3) body motion since the previous visit, map units and rad; row 0 is zero
    lane: LaneReadings | None = None  # what was read of the road, if it was


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AttractorStates(ShortRepr):
    """Head-direction and grid-cell networks at each vertex (Eqs. 1, 2). M grid modules.

    Populations: 0 integrator, 1 calibration.
    """

    head_mean_rad: Float32Array  # (V, 2)
    head_reliability: Float32Array  # (V, 2) 1/sigma^2, 1/rad^2
    grid_period: Float32Array  # (M,) torus period, map units
    grid_mean_rad: Float32Array  # (V, M, 2 populations, 2 axes) phase on the torus
    grid_reliability: Float32Array  # (V, M, 2 populations, 2 axes) 1/rad^2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RoadMatch(ShortRepr):
    """Where each vertex lies on the road network, or why it does not."""

    lane_ids: tuple[str, ...]  # names that ``lane`` indexes
    lane: IntArray  # (V,) -1: unmatched
    position_m: FloatArray  # (V,) arc length on the lane; nan: unmatched
    status: UInt8Array  # (V,) MatchStatus


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CognitiveMap:
    """The cognitive map, semi-metric as built or topometric ("network") as refined. V vertices, one per visit of a place."""

    frame: Literal["semi-metric", "network"]
    t_s: FloatArray  # (V,) when the vertex was made
    poses: FloatArray  # (V, 3) map units in the semi-metric frame; metres in the network frame
    view_cell: IntArray  # (V,) index into view_cells; several vertices may share a cell; -1 if there are none
    view_cells: ViewCells
    edges: Edges
    visits: Visits
    attractors: AttractorStates
    log_scale: FloatArray | None = None  # (V,) ln(metres per map unit); network frame only
    covariance: FloatArray | None = None  # (V, 3, 3) m, m, rad; network frame only
    road_match: RoadMatch | None = None  # network frame only

    def __repr__(self) -> str:
        vertices, edges, cells = len(self.poses), len(self.edges.source), len(self.view_cells.templates)
        return f"CognitiveMap(frame={self.frame!r}, {vertices} vertices, {edges} edges, {cells} view cells)"


@dataclass(frozen=True, slots=True)
class StartPose:
    """A prior on the first vertex's pose in the network frame, when the user knows where the drive began."""

    x_m: float
    y_m: float
    heading_rad: float
    sigma_m: float = 5.0
    sigma_rad: float = 0.2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LocalizationEstimate(ShortRepr):
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
    """A stretch of vertices whose place on the roads is uncertain, and why. It is reported, and no place is guessed."""

    first_vertex: int
    last_vertex: int  # inclusive
    status: MatchStatus
    cause: str


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """A semi-metric map turned topometric, with everything a user needs in order to trust it."""

    cognitive_map: CognitiveMap  # frame "network"
    breaks: tuple[MatchBreak, ...]
    estimates: dict[str, float]  # parameters estimated from the data, units in the names: sigma_z_m, beta_m, ...
    map_error_m: FloatArray | None = None  # (V, 2) drawn place of the road less its true one; None: the roads are taken as exact
