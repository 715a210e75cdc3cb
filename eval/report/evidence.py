"""What the report's interactive map draws, as files beside the results: ``map.json`` and ``thumbnails.jpg``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from shapely import LineString

from hippodrome._files import write_atomically
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.methods.materials import Materials, Outcome, ScoredTrajectory
from hippodrome.eval.methods.method import Method
from hippodrome.eval.metrics.alignment import apply_to_positions, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.results.kept import read_kept
from hippodrome.eval.results.model import ResultsError
from hippodrome.sim.recording import Recording

MAP_JSON: Final = "map.json"
THUMBNAILS: Final = "thumbnails.jpg"
EVEN_FRAMES = 150  # thumbnails spread evenly over the drive: one about every 50 m of the paper's, so in every street
WORST = 5  # places per method at which it is worst, to be looked at first
APART = 10  # vertices (about 50 m) between two worst places at least, so that they are different places
TILE_WIDTH = 160  # pixels
COLUMNS = 12  # of tiles in the sheet of thumbnails
JPEG_QUALITY = 62  # takes about 3 kB per frame of 160 x 120
TRUTH_STEP_S = 0.5  # between two points of the true path: chords of at most 7 m look like the arc in a map of a town
MARGIN_M = 60.0  # roads are kept up to so far around the drive
ROAD_TOLERANCE_M = 0.2  # by which centrelines are simplified: less than a pixel at the map's default zoom
DECIMALS_M = 2  # of every number in the file


class EvidenceModel(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class TimedPath(EvidenceModel):
    """Time-stamped positions in the network frame."""

    t_s: list[float]
    x_m: list[float]
    y_m: list[float]


class Layer(TimedPath):
    """A method's vertices, placed as they were for scoring; an error is None where there is no truth at a vertex's time."""

    name: str  # label of the method
    frame: str | None = None  # that the method declares; None in files of older versions
    error_m: list[float | None]
    worst: list[Annotated[int, Field(ge=0)]]  # vertices with the largest errors, largest first


class LocalizedDrive(TimedPath):
    """Where the localizer said it was, once per second, and whether it declared itself localized."""

    name: str  # label of the method in whose map the drive was localized
    error_m: list[float]
    localized: list[bool]


class Thumbnails(EvidenceModel):
    """The tiles of ``thumbnails.jpg``, row by row."""

    t_s: list[float]
    columns: Annotated[int, Field(gt=0)]
    width: Annotated[int, Field(gt=0)]  # pixels of a tile
    height: Annotated[int, Field(gt=0)]


class MapEvidence(EvidenceModel):
    """The content of ``map.json``."""

    roads: list[list[float]]  # centrelines near the true path, each as x, y, x, y, ... in m
    truth: TimedPath
    methods: list[Layer]
    drives: list[LocalizedDrive]
    thumbnails: Thumbnails
    start: tuple[float, float, float]  # true pose of the first sample: m, m, degrees
    recordings: dict[str, str]  # folder below ``recordings`` of each role
    network: str  # name of the network's file


def write_map_evidence(
    materials: Materials, scored: Mapping[Method, ScoredTrajectory], localized: Mapping[Method, Outcome]
) -> None:
    """Write roads, the true path, every method's vertices with their errors, the localized drives, and frames along the way."""
    recording, truth = materials.mapping, materials.mapping.ground_truth()
    layers = [_layer(method, one, truth) for method, one in scored.items()]
    frames = _chosen_frames(recording, layers)
    sheet, columns = frame_sheet(recording, frames)
    x_m, y_m, heading_rad = (float(value) for value in truth.poses[0])
    evidence = MapEvidence(
        roads=_roads(materials.roads, truth.poses),
        truth=timed_path(truth),
        methods=layers,
        drives=[_drive(method, outcome) for method, outcome in localized.items()],
        thumbnails=Thumbnails(
            t_s=rounded(frame_times_s(recording)[frames]),
            columns=columns,
            width=TILE_WIDTH,
            height=sheet.shape[0] // -(-len(frames) // columns),
        ),
        start=(x_m, y_m, math.degrees(heading_rad)),
        recordings={"mapping": recording.folder.name, "localization": materials.drive.folder.name},
        network=materials.town.net_file.name,
    )
    _, jpeg = cv2.imencode(".jpg", sheet[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_atomically(materials.folder / THUMBNAILS, jpeg.tobytes())
    write_atomically(materials.folder / MAP_JSON, f"{evidence.model_dump_json()}\n".encode())


def add_layers(folder: Path, scored: Mapping[Method, ScoredTrajectory], truth: Trajectory) -> None:
    """Add methods to the ``map.json`` of a scenario's folder; they replace those that are there already.

    Args:
        folder: The scenario's folder.
        scored: The methods' trajectories and errors.
        truth: The mapping drive's true trajectory.
    """
    evidence = read_map_evidence(folder / MAP_JSON)
    added = {method.label for method in scored}
    kept = [layer for layer in evidence.methods if layer.name not in added]
    layers = [*kept, *(_layer(method, one, truth) for method, one in scored.items())]
    text = evidence.model_copy(update={"methods": layers}).model_dump_json()
    write_atomically(folder / MAP_JSON, f"{text}\n".encode())


def read_map_evidence(path: Path) -> MapEvidence:
    """Read and validate ``map.json``. Raises ResultsError."""
    evidence: MapEvidence = read_kept(path, MapEvidence, "not a readable map for the report", "run `hippodrome eval` again")
    for layer in evidence.methods:
        lengths = {len(column) for column in (layer.t_s, layer.x_m, layer.y_m, layer.error_m)}
        if len(lengths) != 1 or any(vertex >= len(layer.t_s) for vertex in layer.worst):
            raise ResultsError(f"{path}: the columns of '{layer.name}' do not fit together; run `hippodrome eval` again")
    return evidence


def worst_places(errors_m: FloatArray, count: int = WORST, apart: int = APART) -> list[int]:
    """Indices of the largest errors, largest first.

    Args:
        errors_m: Errors (N,); nan where there is none.
        count: How many at most.
        apart: Least difference of any two of the indices.
    """
    left = np.where(np.isfinite(errors_m), errors_m, -np.inf)
    places: list[int] = []
    while len(places) < count and len(left) and np.max(left) > -np.inf:
        worst = int(np.argmax(left))
        places.append(worst)
        left[max(worst - apart + 1, 0) : worst + apart] = -np.inf
    return places


def _layer(method: Method, one: ScoredTrajectory, truth: Trajectory) -> Layer:
    pairs = associate(one.trajectory, truth)
    placed_m = apply_to_positions(find_alignment(one.alignment, pairs.estimate, pairs.reference), one.trajectory.poses[:, :2])
    errors_m = np.full(len(one.trajectory.t_s), np.nan)
    errors_m[np.searchsorted(one.trajectory.t_s, one.ape.t_s)] = one.ape.errors_m
    return Layer(
        name=method.label,
        frame=method.frame,
        **timed_columns(one.trajectory.t_s, placed_m),
        error_m=[None if np.isnan(error) else round(float(error), DECIMALS_M) for error in errors_m],
        worst=worst_places(errors_m),
    )


def _drive(method: Method, outcome: Outcome) -> LocalizedDrive:
    assert outcome.localized is not None
    assert outcome.localization is not None
    score = outcome.localized
    seconds = np.unique(np.searchsorted(score.t_s, np.arange(score.t_s[0], score.t_s[-1], 1.0)))
    at = {estimate.t_s: estimate.pose for estimate in outcome.localization.estimates}
    poses = np.array([at[float(t_s)] for t_s in score.t_s[seconds]])
    return LocalizedDrive(
        name=method.label,
        **timed_columns(score.t_s[seconds], poses),
        error_m=rounded(score.errors_m[seconds]),
        localized=[bool(known) for known in score.localized[seconds]],
    )


def _roads(network: RoadNetwork, path_m: FloatArray) -> list[list[float]]:
    """Simplified centrelines of the lanes around a path (N, 2 or more columns)."""
    low, high = path_m[:, :2].min(axis=0) - MARGIN_M, path_m[:, :2].max(axis=0) + MARGIN_M
    lines = (network.lane_points_m(lane) for lane in range(network.lane_count))
    near = (line for line in lines if np.all(line.max(axis=0) >= low) and np.all(line.min(axis=0) <= high))
    return [rounded(np.array(LineString(line).simplify(ROAD_TOLERANCE_M).coords).ravel()) for line in near]


def timed_path(truth: Trajectory) -> TimedPath:
    steps = np.unique(np.searchsorted(truth.t_s, np.arange(truth.t_s[0], truth.t_s[-1], TRUTH_STEP_S)))
    return TimedPath(**timed_columns(truth.t_s[steps], truth.poses[steps]))


def timed_columns(t_s: FloatArray, poses: FloatArray) -> dict[str, list[float]]:
    return {"t_s": rounded(t_s), "x_m": rounded(poses[:, 0]), "y_m": rounded(poses[:, 1])}


def rounded(values: FloatArray) -> list[float]:
    return [round(float(value), DECIMALS_M) for value in values]


def frame_times_s(recording: Recording) -> FloatArray:
    times_s: FloatArray = recording.samples.t_s[recording.samples.frame_steps]
    return times_s


def _chosen_frames(recording: Recording, layers: list[Layer]) -> list[int]:
    """Numbers of the frames spread evenly over the drive, and of the one nearest to each method's worst places."""
    times_s = frame_times_s(recording)
    even = np.linspace(0, recording.frame_count - 1, EVEN_FRAMES).astype(int)
    worst_s = np.array([layer.t_s[vertex] for layer in layers for vertex in layer.worst])
    after = np.clip(np.searchsorted(times_s, worst_s), 1, len(times_s) - 1)
    nearest = np.where(worst_s - times_s[after - 1] < times_s[after] - worst_s, after - 1, after)
    return [int(number) for number in np.unique(np.concatenate([even, nearest]))]


def frame_sheet(recording: Recording, frames: list[int]) -> tuple[NDArray[np.uint8], int]:
    """The frames as tiles of one RGB picture, row by row, and the number of tiles in a row."""
    first = recording.frame(frames[0])
    height = max(round(TILE_WIDTH * first.shape[0] / first.shape[1]), 1)
    columns = min(COLUMNS, len(frames))
    sheet = np.zeros((-(-len(frames) // columns) * height, columns * TILE_WIDTH, 3), dtype=np.uint8)
    for place, number in enumerate(frames):
        top, left = height * (place // columns), TILE_WIDTH * (place % columns)
        tile = cv2.resize(recording.frame(number), (TILE_WIDTH, height), interpolation=cv2.INTER_AREA)
        sheet[top : top + height, left : left + TILE_WIDTH] = tile
    return sheet, columns
