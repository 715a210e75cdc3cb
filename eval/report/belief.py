"""What the report's player shows of the second drive, as files beside the results: ``belief.json`` and ``frames-second.jpg``.

The belief is sampled: often in the first seconds, in which the localizer finds itself, and twice a second afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import cv2
import numpy as np
from pydantic import Field

from hippodrome._files import write_atomically
from hippodrome.core.attractors.grid_cells import module_periods
from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.types import CognitiveMap, FloatArray, IntArray, LocalizationEstimate, Observation, Trajectory
from hippodrome.eval.methods.materials import Materials, Outcome
from hippodrome.eval.methods.method import TOPOMETRIC, Method
from hippodrome.eval.methods.stages import localize_recording
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.report.candidates import Look, looks_at
from hippodrome.eval.report.evidence import (
    DECIMALS_M,
    JPEG_QUALITY,
    EvidenceModel,
    Thumbnails,
    TimedPath,
    frame_sheet,
    frame_times_s,
    rounded,
    timed_columns,
    timed_path,
    worst_places,
)
from hippodrome.eval.results.kept import read_kept
from hippodrome.eval.results.model import ResultsError, Row, summarize_localization
from hippodrome.sim.recording import Recording

AS_PRINTED: Final = "topometric, networks as printed"
BELIEF_JSON: Final = "belief.json"
SECOND_FRAMES: Final = "frames-second.jpg"
SETTLING_S: Final = 20.0  # the initial localization of the paper takes less; in it the belief changes from step to step
SETTLING_STEP_S, STEP_S = (
    0.2,
    0.5,
)  # between two samples of the belief, while it settles and afterwards: a car drives 5 m in 0.5 s
FRAMES: Final = 120  # thumbnails of the second drive, which is shorter than the first
SETTLING_FRAMES: Final = 20  # of them in the first seconds: one a second
UNKNOWN_M2: Final = 1e8  # variances above (10 km)^2 say "anywhere"
WORST_STEPS: Final = 4  # that are shown
APART_STEPS: Final = 10  # samples (5 s) between two of them at least
DIGITS: Final = 4  # significant digits of what is drawn as activity


class Belief(TimedPath):
    """What a localizer believed at each time: N samples."""

    name: str  # label of the method in whose map the drive was localized
    heading_rad: list[float]
    covariance_m2: list[tuple[float, float, float] | None]  # xx, xy, yy; None for a method that states none
    error_m: list[float | None]  # None where there is no truth
    localized: list[bool]
    status: list[Annotated[int, Field(ge=0, le=4)]]  # value of core.types.LocalizationStatus
    confidence: list[float]
    view_s: list[float | None]  # time in the mapping drive at which the view that fired was first stored
    view_m: list[tuple[float, float] | None]  # and where the map has it
    head_rad: list[list[float]]  # (2,) per sample: integrator, calibration
    head_reliability: list[list[float]]
    grid_rad: list[list[float]]  # (modules x 2 populations x 2 axes,) per sample
    grid_reliability: list[list[float]]
    periods_m: tuple[float, ...] = ()  # of the grid modules; empty where there are none, or the file is an older one
    map: str | None = None  # label of the method whose map it was localized in, where that is not ``name``


class SecondDrive(EvidenceModel):
    """The content of ``belief.json``."""

    truth: TimedPath
    frames: Thumbnails
    beliefs: list[Belief]
    looks: tuple[Look, ...] = ()  # at the worst moments of each


def write_second_drive(materials: Materials, localized: Mapping[Method, Outcome]) -> Row | None:
    """Write the second drive: where it really was, what its camera saw, and what each localizer believed.

    Args:
        materials: What was evaluated.
        localized: The methods that localized the second drive.

    Returns:
        The figures of the networks as the paper prints them, which are shown beside our methods; None where they were not tried.
    """
    if not localized:
        return None
    drive, truth = materials.drive, materials.drive.ground_truth()
    frames = _spread(drive)
    sheet, columns = frame_sheet(drive, frames)
    height = sheet.shape[0] // -(-len(frames) // columns)
    tiles = Thumbnails(t_s=rounded(frame_times_s(drive)[frames]), columns=columns, width=sheet.shape[1] // columns, height=height)
    config = materials.scenario.localizer
    beliefs = [
        belief_of(method.label, outcome.localization.estimates, truth, outcome.refined, _periods_m(config))
        for method, outcome in localized.items()
        if outcome.localization is not None and outcome.localization.estimates
    ]
    if (printed := _as_printed(materials, localized)) is not None:
        beliefs.insert(0, printed[0])  # the page shows the last one first
    _, jpeg = cv2.imencode(".jpg", sheet[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_atomically(materials.folder / SECOND_FRAMES, jpeg.tobytes())
    maps = {method.label: outcome.refined for method, outcome in localized.items() if outcome.refined is not None}
    looks = tuple(
        look
        for belief in beliefs
        if belief.name in maps
        for look in looks_at(belief.name, [belief.t_s[i] for i in worst_steps(belief)], drive, truth, maps[belief.name], config)
    )
    content = SecondDrive(truth=timed_path(truth), frames=tiles, beliefs=beliefs, looks=looks)
    write_atomically(materials.folder / BELIEF_JSON, f"{content.model_dump_json()}\n".encode())
    return None if printed is None else printed[1]


def belief_of(
    name: str,
    estimates: list[LocalizationEstimate],
    truth: Trajectory,
    cognitive_map: CognitiveMap | None,
    periods_m: tuple[float, ...] = (),
    map_of: str | None = None,
) -> Belief:
    """The samples of one localizer's estimates.

    Args:
        name: Label of the method.
        estimates: One per observation, at least one.
        truth: The drive's true trajectory; it may lack some of the times.
        cognitive_map: The map that it was localized in; None if it is not one of our kind, and then no view is named.
        periods_m: Periods of the localizer's grid modules.
        map_of: Label of the method whose map it is, where that is not ``name``.
    """
    times_s = np.array([one.t_s for one in estimates])
    steps = _steps(times_s)
    if (worst := _worst_declared(estimates, times_s, truth)) is not None:
        steps = np.union1d(steps, worst)
    chosen = [estimates[step] for step in steps]
    poses = np.array([one.pose for one in chosen])
    shown_s = np.array([one.t_s for one in chosen])
    views = [_view(one.view_cell, cognitive_map) for one in chosen]
    return Belief(
        name=name,
        **timed_columns(shown_s, poses),
        heading_rad=_significant(poses[:, 2]),
        covariance_m2=[_covariance(one.covariance) for one in chosen],
        error_m=_errors_m(shown_s, poses, truth),
        localized=[bool(one.localized) for one in chosen],
        status=[int(one.status) for one in chosen],
        confidence=_significant(np.array([one.confidence for one in chosen])),
        view_s=[None if view is None else round(view[0], DECIMALS_M) for view in views],
        view_m=[None if view is None else (round(view[1], DECIMALS_M), round(view[2], DECIMALS_M)) for view in views],
        head_rad=[_significant(one.head_direction_rad) for one in chosen],
        head_reliability=[_significant(one.head_reliability) for one in chosen],
        grid_rad=[_significant(np.ravel(one.grid_phase_rad)) for one in chosen],
        grid_reliability=[_significant(np.ravel(one.grid_reliability)) for one in chosen],
        periods_m=periods_m if all(4 * len(periods_m) == np.size(one.grid_phase_rad) for one in chosen) else (),
        map=map_of,
    )


def read_second_drive(path: Path) -> SecondDrive:
    """Read and validate ``belief.json``. Raises ResultsError."""
    content: SecondDrive = read_kept(path, SecondDrive, "not a readable second drive", "run `hippodrome eval` again")
    for belief in content.beliefs:
        columns = (value for value in belief.model_dump().values() if isinstance(value, list))
        if len({len(column) for column in columns}) != 1:
            raise ResultsError(f"{path}: the columns of '{belief.name}' do not fit together; run `hippodrome eval` again")
    return content


def _as_printed(materials: Materials, localized: Mapping[Method, Outcome]) -> tuple[Belief, Row] | None:
    """The belief of the networks as the paper prints them, in our map, and its figures: what they do and where they fail.

    None where the scenario's localizer is in that mode itself, or nothing was localized in our map.
    """
    config, outcome = materials.scenario.localizer, localized.get(TOPOMETRIC)
    if outcome is None or not isinstance(outcome.refined, CognitiveMap) or config.mode == "paper":
        return None
    printed = replace(config, mode="paper")
    localizer = Localizer(outcome.refined, materials.roads, printed)
    made = localize_recording(_looked_at(materials.drive, localizer), localizer)
    truth = materials.drive.ground_truth()
    score = score_localization(made.estimates, truth, made.step_s)
    belief = belief_of(AS_PRINTED, made.estimates, truth, outcome.refined, _periods_m(printed), TOPOMETRIC.label)
    return belief, Row(method=AS_PRINTED, localization=summarize_localization(score))


def _looked_at(drive: Recording, localizer: Localizer) -> Iterator[Observation]:
    """The observations of a drive, with those frames alone that a localizer looks at as it goes: the others are not decoded."""
    for step, number in enumerate(drive.samples.frame):
        observation = drive.samples.observation(step, None)
        wanted = number >= 0 and localizer.looks_at(observation)
        yield replace(observation, frame=drive.frame(int(number))) if wanted else observation


def worst_steps(belief: Belief) -> list[int]:
    """Samples with the largest errors among those that were declared localized."""
    pairs = zip(belief.error_m, belief.localized, strict=True)
    errors_m = [error if known and error is not None else float("nan") for error, known in pairs]
    return worst_places(np.array(errors_m), WORST_STEPS, APART_STEPS)


def _periods_m(config: LocalizerConfig) -> tuple[float, ...]:
    """Periods of the grid modules of a localizer's mode; none for a mode without networks."""
    if config.mode == "paper":
        return (config.paper.period_m,)
    return tuple(float(period) for period in module_periods(config.smallest_period_m)) if config.mode == "coupled" else ()


def _steps(times_s: FloatArray) -> IntArray:
    """Numbers of the samples among the steps at ``times_s`` (N,)."""
    settled_s = times_s[0] + SETTLING_S
    wanted = np.concatenate(
        [
            np.arange(times_s[0], min(settled_s, times_s[-1]), SETTLING_STEP_S),
            np.arange(settled_s, times_s[-1], STEP_S),
            times_s[-1:],
        ]
    )
    steps: IntArray = np.unique(np.clip(np.searchsorted(times_s, wanted - 1e-6), 0, len(times_s) - 1))
    return steps


def _worst_declared(estimates: list[LocalizationEstimate], times_s: FloatArray, truth: Trajectory) -> int | None:
    """The step with the largest error of those declared localized, which is shown whatever the sampling; None without one."""
    errors_m = _errors_m(times_s, np.array([one.pose for one in estimates]), truth)
    known = [step for step, one in enumerate(estimates) if one.localized and errors_m[step] is not None]
    return max(known, key=lambda step: errors_m[step] or 0.0, default=None)


def _spread(recording: Recording) -> list[int]:
    """Numbers of frames: one a second while the belief settles, and spread evenly over the drive."""
    times_s = frame_times_s(recording)
    settling = np.searchsorted(times_s, times_s[0] + np.linspace(0.0, SETTLING_S, SETTLING_FRAMES, endpoint=False))
    even = np.linspace(0, len(times_s) - 1, FRAMES - SETTLING_FRAMES).astype(int)
    return [int(number) for number in np.unique(np.clip(np.concatenate([settling, even]), 0, len(times_s) - 1))]


def _view(cell: int, cognitive_map: CognitiveMap | None) -> tuple[float, float, float] | None:
    """Time and place of the first vertex that has a view cell."""
    if cell < 0 or cognitive_map is None:
        return None
    vertices = np.flatnonzero(cognitive_map.view_cell == cell)
    if len(vertices) == 0:
        return None
    x_m, y_m = cognitive_map.poses[vertices[0], :2]
    return float(cognitive_map.t_s[vertices[0]]), float(x_m), float(y_m)


def _covariance(covariance: FloatArray) -> tuple[float, float, float] | None:
    if not covariance[:2, :2].any():  # how methods without a covariance fill it in
        return None
    xx, xy, yy = _significant(np.clip(np.array([covariance[0, 0], covariance[0, 1], covariance[1, 1]]), -UNKNOWN_M2, UNKNOWN_M2))
    return xx, xy, yy


def _errors_m(times_s: FloatArray, poses: FloatArray, truth: Trajectory) -> list[float | None]:
    """Distances to the truth, linear in time; None outside of its times."""
    x_m, y_m = (np.interp(times_s, truth.t_s, truth.poses[:, axis], left=np.nan, right=np.nan) for axis in (0, 1))
    errors_m = np.hypot(poses[:, 0] - x_m, poses[:, 1] - y_m)
    return [None if np.isnan(error) else round(float(error), DECIMALS_M) for error in errors_m]


def _significant(values: FloatArray) -> list[float]:
    """Values with few digits, infinite and missing ones as the largest and 0."""
    finite = np.nan_to_num(np.asarray(values, dtype=float), nan=0.0, posinf=UNKNOWN_M2, neginf=-UNKNOWN_M2)
    return [float(f"{value:.{DIGITS}g}") for value in finite]
