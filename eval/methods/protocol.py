"""What a method is: what it declares, what it is given, what it answers. Everything that has a row is one, ours as well.

A method is an object with any of three functions; ``docs/methods.md`` shows each:

* ``map(observations, given)`` makes a trajectory of a drive, and with it a map, if it keeps one.
* ``localize(observations, given)`` finds a second drive in that map, from an unknown start, one answer per observation.
* ``describe(frame)`` makes a vector of a frame, for place recognition alone.

It receives observations and what it says that it needs. It is never given the truth: no argument has a place for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import (
    CognitiveMap,
    FloatArray,
    Frame,
    HippodromeError,
    LocalizationEstimate,
    Observation,
    StartPose,
    Trajectory,
)
from hippodrome.sim.render.camera import CameraSpec

COLUMNS = 4  # of a pose with its time
POSES_WANTED = "return a Trajectory, or yield (t_s, x, y, heading_rad) one by one"
ANSWERS_WANTED = "yield one Answer(t_s, x_m, y_m, heading_rad) per observation, with localized=False where it does not know"

TimedPose: TypeAlias = tuple[float, float, float, float]  # t_s, x, y, heading_rad


class MethodError(HippodromeError):
    """A method that cannot be found, cannot be made, or answers with something that is no answer."""


@dataclass(frozen=True, slots=True)
class Needs:
    """What a method is given beyond the speeds and yaw rates that every method has. The report prints it."""

    camera: bool = True  # frames; without them, the observations have none, and none is decoded
    road_network: bool = False
    start_pose: bool = False  # where the mapping drive began, in the network's frame
    stereo: bool = False  # the right image of a pair beside each frame: observations are ``StereoObservation``
    size_px: tuple[int, int] | None = None  # width and height that frames have at least
    grain: bool = False  # surfaces with the grain that trackers of corners live on
    metric_scale: bool = False  # how many metres a unit of the self-motion has, as ``Given.metres_per_unit``
    frames_optional: bool = False  # it does with self-motion alone where a drive has no frames

    def __post_init__(self) -> None:
        """Raise ValueError for what no drive can give."""
        size_px: object = self.size_px
        if size_px is not None and not (
            isinstance(size_px, tuple) and len(size_px) == 2 and all(isinstance(side, int) and side > 0 for side in size_px)
        ):
            raise ValueError(f"Needs: size_px is {size_px!r}; width and height in pixels are expected, as (640, 480)")
        if not self.camera and (self.stereo or self.grain or size_px is not None):
            raise ValueError("Needs: stereo, size_px and grain are of frames, and camera=False asks for none")

    def in_words(self) -> str:
        """What the report says: ``self-motion, frames of one camera, the road network``."""
        frames = "stereo pairs" if self.stereo else "frames of one camera"
        frames += f" of at least {self.size_px[0]}x{self.size_px[1]}" if self.size_px else ""
        frames += " with grain" if self.grain else ""
        parts = ["self-motion in metres" if self.metric_scale else "self-motion"]
        parts += [frames] if self.camera else []
        parts += ["the road network"] if self.road_network else []
        parts += ["the start pose"] if self.start_pose else []
        return ", ".join(parts)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StereoObservation(Observation):
    """What a method that needs stereo pairs is handed: ``frame`` is the left image, ``right`` the other one of the pair."""

    right: Frame | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Cost:
    """What a process of its own took, where that is not what our process spent on it."""

    cpu_s: float  # user and system time of all its processes, without its start if it says when it is ready
    peak_rss_bytes: int | None = None  # the most memory that one of its processes held
    step_s: FloatArray | None = None  # (N,) per observation, in s; None if it is not handed them one by one
    step_cpu_s: FloatArray | None = None  # (N,) the same of CPU time, all threads; None where that cannot be told apart
    loading_cpu_s: float = 0.0  # what its start took beside ``cpu_s``


@dataclass(frozen=True, slots=True, eq=False)
class Localized:
    """All answers of ``localize`` at once, for a method that has its costs measured elsewhere."""

    answers: Sequence[Answer | LocalizationEstimate]
    cost: Cost


@dataclass(frozen=True, slots=True, eq=False)
class Mapped:
    """What ``map`` made: a trajectory, and whatever else the method keeps of the drive."""

    trajectory: Trajectory  # in the frame that the method declares
    cognitive_map: CognitiveMap | None = None  # if its map is one of ours: it is saved, and its closures and lanes are scored
    state: Any = None  # anything that its ``localize`` wants to have back as ``given.mapped.state``
    figures: dict[str, Any] = field(default_factory=dict)  # further fields of its row
    save: Callable[[Path], int] | None = None  # writes its map file and answers with the size in bytes
    cost: Cost | None = None  # if it was measured elsewhere
    live: Trajectory | None = None  # its poses as it answered them on the way, where ``trajectory`` has later corrections


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What a method may know besides the observations. What it does not declare in its ``Needs`` is None."""

    camera: CameraSpec
    rate_hz: float  # of the observations
    duration_s: float  # of the drive
    seed: int  # for methods that draw numbers: the same seed is to give the same answer
    folder: Path  # an empty folder of its own, for whatever it wants to write
    roads: RoadNetwork | None = None
    start: StartPose | None = None
    metres_per_unit: float | None = None  # of the speeds
    frames: bool = True  # whether the drive has any
    base: Mapped | None = None  # the map of the method that it builds on, if it names one in ``builds_on``
    mapped: Mapped | None = None  # for ``localize``: what its own ``map`` returned, or else its ``base``
    concealed: tuple[Path, ...] = ()  # folders with the truth, which a program of its own is not to see


@dataclass(frozen=True, slots=True)
class Answer:
    """Where a localizer believes the vehicle to be after one observation, in the network's frame."""

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    localized: bool = True  # whether it stands by this pose
    covariance: FloatArray | None = None  # (3, 3) m, m, rad, if it knows one


Mapping: TypeAlias = Mapped | Trajectory | Iterable[TimedPose]
Localizing: TypeAlias = Iterable[Answer | LocalizationEstimate] | Localized


@runtime_checkable
class Maps(Protocol):
    """A method that makes a trajectory of a drive; it may also yield ``(t_s, x, y, heading_rad)`` one by one."""

    def map(self, observations: Iterator[Observation], given: Given) -> Mapping: ...


@runtime_checkable
class Localizes(Protocol):
    """A method that finds a second drive in a map."""

    def localize(self, observations: Iterator[Observation], given: Given) -> Localizing: ...


@runtime_checkable
class Describes(Protocol):
    """A method that makes a vector (D,) of a frame; near vectors mean the same place."""

    def describe(self, frame: Frame) -> FloatArray: ...


def as_mapped(answer: Mapping, label: str) -> Mapped:
    """What ``map`` returned, as one kind of object. Raises MethodError if it is nothing of the kind."""
    if isinstance(answer, Mapped):
        if answer.save is not None and not callable(answer.save):
            raise MethodError(f"{label}: its save is a {type(answer.save).__name__}, not a function")
        return answer
    if isinstance(answer, Trajectory):
        return Mapped(answer)
    if not isinstance(answer, Iterable):
        raise MethodError(f"{label}: map() gave {_kind(answer)}{_why(answer)}; {POSES_WANTED}")
    poses = list(answer)  # a method that yields its poses does its work here, and what it raises is its own
    table = np.array([_timed(pose, number, label) for number, pose in enumerate(poses)], dtype=np.float64)
    if len(table) == 0:
        raise MethodError(f"{label}: map() gave no poses; {POSES_WANTED}")
    return Mapped(Trajectory(table[:, 0], table[:, 1:]))


def _timed(pose: Any, number: int, label: str) -> tuple[float, ...]:
    """A pose that ``map`` gave, as four numbers. Raises MethodError if it is none."""
    where = f"{label}: map() gave no trajectory: its pose {number} is"
    if not isinstance(pose, Iterable) or isinstance(pose, str | bytes | dict):
        raise MethodError(f"{where} {_kind(pose)}; {POSES_WANTED}")
    values = list(islice(pose, COLUMNS + 1))
    if len(values) != COLUMNS:
        raise MethodError(f"{where} of {'more than 4' if len(values) > COLUMNS else len(values)} values; {POSES_WANTED}")
    try:
        return tuple(float(one) for one in values)
    except (TypeError, ValueError, OverflowError):
        kinds = ", ".join(type(one).__name__ for one in values)
        raise MethodError(f"{where} not made of numbers ({kinds}); {POSES_WANTED}") from None


def as_answers(found: Any, label: str) -> Iterable[Answer | LocalizationEstimate]:
    """What ``localize`` returned, as answers one by one. Raises MethodError if it is nothing of the kind."""
    if isinstance(found, Localized):
        return as_answers(found.answers, label)
    if not isinstance(found, Iterable) or isinstance(found, str | bytes | dict):
        raise MethodError(f"{label}: localize() gave {_kind(found)}{_why(found)}; {ANSWERS_WANTED}")
    return found


def _kind(value: Any) -> str:
    """What a value is, in a word."""
    return "None" if value is None else f"a {type(value).__name__}"


def _why(value: Any) -> str:
    """How a function comes to give None."""
    return ", as a function does that has no return and no yield" if value is None else ""


def as_estimate(answer: Answer | LocalizationEstimate, label: str) -> LocalizationEstimate:
    """An answer of ``localize`` as one kind of object. Raises MethodError if it is none, or has no finite pose."""
    if isinstance(answer, LocalizationEstimate):
        return answer
    if not isinstance(answer, Answer):
        raise MethodError(f"{label}: localize() gave {_kind(answer)} as an answer; {ANSWERS_WANTED}")
    try:
        pose = np.array([answer.x_m, answer.y_m, answer.heading_rad], dtype=np.float64)
        covariance = np.zeros((3, 3)) if answer.covariance is None else np.asarray(answer.covariance, dtype=np.float64)
        stands_by_it = bool(answer.localized)
    except (TypeError, ValueError, OverflowError) as error:
        raise MethodError(f"{label}: localize() gave an Answer that is not made of numbers: {error}") from None
    if stands_by_it and not np.isfinite(pose).all():
        raise MethodError(f"{label}: localize() stands by a pose that is not finite, at t_s={answer.t_s}")
    nothing = np.zeros((0, 2, 2))
    return LocalizationEstimate(
        t_s=answer.t_s,
        pose=np.nan_to_num(pose),
        covariance=covariance,
        localized=answer.localized,
        confidence=0.0,
        view_cell=-1,
        head_direction_rad=np.zeros(2),
        head_reliability=np.zeros(2),
        grid_phase_rad=nothing,
        grid_reliability=nothing,
    )
