"""``results.json``: the contract that other programs script against. Fields are added freely and never renamed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema

from hippodrome._files import read_bounded, why_unreadable, write_atomically
from hippodrome._json import parse_json
from hippodrome.core.types import HippodromeError
from hippodrome.eval.metrics.localization import LocalizationScore
from hippodrome.eval.metrics.trajectory import Score
from hippodrome.sim.key_words import first_fault
from hippodrome.sim.limits import refuse_truth_values

DECIMALS: Final = 6  # of every number: finer than any figure means, coarser than the rounding in which machines differ
MAX_BYTES: Final = 64 << 20  # of a file that is read: far more than any run writes
TIMING_FIELDS: Final = frozenset({"cpu_percent", "peak_rss_bytes", "initial_time_ms", "latency_ms", "timings", "realtime_factor"})


Length: TypeAlias = Annotated[float, Field(ge=0.0)]  # of an error: none is below zero


class ResultsError(HippodromeError):
    """A results file that cannot be read, or a value that cannot be written."""


class _Model(BaseModel):
    """Unknown fields are kept: the file may be of a later version."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        refuse_truth_values(schema, handler.resolve_ref_schema)
        return schema


class Network(_Model):
    """The road network that was driven: either a file or a generated town."""

    path: str | None = None  # name of the network file
    generator: str | None = None  # kind of the generated town
    edges: int  # directed
    km: float  # of road, each direction counted


class ErrorSummary(_Model):
    """The figures of a ``Score``. Those that are quoted from a paper have a mean only."""

    definition: str
    mean_m: Length
    median_m: Length | None = None
    p95_m: Length | None = None
    max_m: Length | None = None
    rmse_m: Length | None = None
    count: int | None = None
    matched: int | None = None
    total: int | None = None


class LocalizationSummary(_Model):
    """The figures of a ``LocalizationScore``. None where the drive was never localized, or a paper does not print the figure."""

    definition: str
    success: bool | None = None
    error_mean_m: Length | None = None
    error_median_m: Length | None = None
    error_p95_m: Length | None = None
    error_max_m: Length | None = None
    initial_time_ms: float | None = None
    initial_drive_s: float | None = None
    initial_distance_m: float | None = None
    initial_frames: int | None = None
    false_fixes: int | None = None
    false_fix_share: float | None = None
    localized_share: float | None = None
    drive_error_mean_m: float | None = None
    heading_error_mean_rad: float | None = None
    mean_nees: float | None = None
    matched: int | None = None
    total: int | None = None


class PlaceSummary(_Model):
    """The figures of a ``PlaceScore``: place recognition alone."""

    definition: str
    places: int
    queries: int
    mapped: int
    best_is_right: float
    recall: float


class Latency(_Model):
    """Time from handing a method a frame or a reading until it is done with it [ms]."""

    median: float
    p99: float


class Declaration(_Model):
    """What a method says of itself, or is said of it."""

    frame: str  # of its trajectory: own, network or metric
    given: str  # what it is given, in words
    source: str  # where it comes from: hippodrome, a class, or a command
    isolated: bool  # whether it ran in a process of its own, with nothing of the truth within its reach


class Row(_Model):
    """One method on one drive. A method that failed has a row too, and says why."""

    method: str  # label of the method, see ``eval.methods.method``
    quoted: bool = False  # copied from a paper, not measured here
    failure: str | None = None  # why it failed, if it did
    unscored: str | None = None  # why errors are missing that others of its figures have: the truth of a drive is not known
    refused: str | None = None  # why nothing vouches for its map, if nothing does: its errors are those of a guess
    declaration: Declaration | None = None
    cpu_percent: float | None = None  # CPU time of the process, in per cent of the drive's duration
    latency_ms: Latency | None = None  # per observation of the mapping drive
    map_bytes: int | None = None  # size of the saved map
    peak_rss_bytes: int | None = None  # most memory of a process that does nothing but run the method
    covered: float | None = None  # share of the mapping drive for which the method has a pose
    camera_frames: int | None = None
    keyframes: int | None = None
    vertices: int | None = None
    edges: int | None = None
    ape: ErrorSummary | None = None
    ape_se2: ErrorSummary | None = None
    ape_sim2: ErrorSummary | None = None
    rpe: ErrorSummary | None = None  # between consecutive vertices
    rpe_20m: ErrorSummary | None = None
    localization: LocalizationSummary | None = None
    places: PlaceSummary | None = None


class ScenarioResult(_Model):
    """All methods on one scenario, and what the scenario was."""

    name: str
    seed: int
    network: Network
    noise: str  # level of the self-motion's noise
    frames: int  # of the mapping drive
    duration_s: float  # of the mapping drive
    rows: tuple[Row, ...]
    as_printed: Row | None = None  # the second drive in our map by the networks as the paper prints them; no map of its own


class Results(_Model):
    """The whole file."""

    scenarios: tuple[ScenarioResult, ...]


def drive_of(row: Row) -> dict[str, Any] | None:
    """The figures of a row's missions; None for a row of maps and localization."""
    figures = getattr(row, "drive", None)
    return figures if isinstance(figures, dict) else None


def is_driven(result: ScenarioResult) -> bool:
    """Whether the result is one of missions alone."""
    return bool(result.rows) and all(drive_of(row) is not None for row in result.rows)


def result_of(results: Results, name: str) -> ScenarioResult:
    """The result of the scenario ``name``, which must be there."""
    return next(result for result in results.scenarios if result.name == name)


def summarize(score: Score) -> ErrorSummary:
    """The figures of a score."""
    names = ("definition", "mean_m", "median_m", "p95_m", "max_m", "rmse_m", "count", "matched", "total")
    return ErrorSummary(**{name: getattr(score, name) for name in names})


def summarize_localization(score: LocalizationScore) -> LocalizationSummary:
    """The figures of a localization score."""
    return LocalizationSummary(**{name: getattr(score, name) for name in LocalizationSummary.model_fields})


def write_results(path: Path, results: Results) -> None:
    """Write ``results.json`` atomically; the same results give the same bytes. Raises ResultsError."""
    write_atomically(path, to_json(results.model_dump(mode="python"), str(path)).encode())


def read_results(path: Path) -> Results:
    """Read and validate ``results.json``. Raises ResultsError, which names the file, the field and the reason."""
    try:
        data = parse_json(read_bounded(path, MAX_BYTES))
        return Results.model_validate(data)
    except ValidationError as error:
        cure = "name another, or make it anew by the command that wrote it"
        raise ResultsError(f"{path}: {first_fault(error, data, Results)}; {cure}") from error
    except (OSError, ValueError, RecursionError) as error:  # ValueError: no JSON, no UTF-8, or a number of thousands of digits
        cure = "name the folder that a command had as its --out, and let that command finish"
        if isinstance(error, FileNotFoundError | NotADirectoryError):
            raise ResultsError(f"{path}: no results there; {cure}") from error
        raise ResultsError(f"{path}: not a readable results file: {why_unreadable(error)}; {cure}") from error


def without_timings(results: Results) -> dict[str, Any]:
    """Everything that the seed determines, as plain data: what two runs are compared by, byte by byte with ``to_json``."""
    kept = _without_timings(results.model_dump(mode="python"))
    assert isinstance(kept, dict)
    return kept


def to_json(data: Any, name: str = "results") -> str:
    """Plain data as JSON, with sorted keys and all numbers rounded to ``DECIMALS``.

    Args:
        data: Dictionaries, lists and plain values.
        name: What an error calls the data.

    Raises:
        ResultsError: A value is not finite, or is none that JSON has.
    """
    try:
        return json.dumps(_rounded(data), indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"
    except (TypeError, ValueError) as error:
        raise ResultsError(f"{name}: cannot be written as JSON: {error}") from error


def _without_timings(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_timings(item) for key, item in value.items() if key not in TIMING_FIELDS}
    if isinstance(value, list | tuple):
        return [_without_timings(item) for item in value]
    return value


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        return round(float(value), DECIMALS) + 0.0  # + 0.0: no minus zero
    return value
