"""``results.json``: the contract that other programs script against. Fields are added freely and never renamed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, ValidationError

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.metrics.localization import LocalizationScore
from hippodrome.eval.metrics.trajectory import Score

DECIMALS = 6  # micrometres and nanoseconds: below any meaning, above rounding noise between machines
MAX_BYTES = 64 << 20
TIMING_FIELDS: Final = frozenset({"cpu_percent", "peak_rss_bytes", "initial_time_ms", "timings"})


class ResultsError(HippodromeError):
    """A results file that cannot be read, or a value that cannot be written."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class Network(_Model):
    path: str | None = None  # a network file, or
    generator: str | None = None  # the kind of generated town
    edges: int
    km: float


class ErrorSummary(_Model):
    """A ``Score`` in figures. Quoted ones know their mean only."""

    definition: str
    mean_m: float
    median_m: float | None = None
    p95_m: float | None = None
    max_m: float | None = None
    rmse_m: float | None = None
    count: int | None = None
    matched: int | None = None
    total: int | None = None


class LocalizationSummary(_Model):
    """A ``LocalizationScore`` in figures; None where it never localized, or was not printed."""

    definition: str
    success: bool | None = None
    error_mean_m: float | None = None
    error_median_m: float | None = None
    error_p95_m: float | None = None
    error_max_m: float | None = None
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


class Row(_Model):
    """One method on one drive. A method that failed has a row too, and says why."""

    method: str
    quoted: bool = False  # copied from a paper, not measured here
    failure: str | None = None
    cpu_percent: float | None = None  # process CPU time / duration of the drive
    map_bytes: int | None = None
    peak_rss_bytes: int | None = None  # of a process of its own, all of it
    camera_frames: int | None = None
    keyframes: int | None = None
    vertices: int | None = None
    edges: int | None = None
    ape: ErrorSummary | None = None
    ape_se2: ErrorSummary | None = None
    ape_sim2: ErrorSummary | None = None
    rpe: ErrorSummary | None = None  # consecutive vertices
    rpe_20m: ErrorSummary | None = None
    localization: LocalizationSummary | None = None


class ScenarioResult(_Model):
    name: str
    seed: int
    network: Network
    noise: str
    frames: int
    duration_s: float
    rows: tuple[Row, ...]


class Results(_Model):
    scenarios: tuple[ScenarioResult, ...]


def summarize(score: Score) -> ErrorSummary:
    """The figures of a score."""
    names = ("definition", "mean_m", "median_m", "p95_m", "max_m", "rmse_m", "count", "matched", "total")
    return ErrorSummary(**{name: getattr(score, name) for name in names})


def summarize_localization(score: LocalizationScore) -> LocalizationSummary:
    """The figures of a localization score."""
    return LocalizationSummary(**{name: getattr(score, name) for name in LocalizationSummary.model_fields})


def write_results(path: Path, results: Results) -> None:
    """Write atomically; the same results give the same bytes."""
    write_atomically(path, to_json(results.model_dump(mode="python"), str(path)).encode())


def read_results(path: Path) -> Results:
    """Read and validate; the error names file, field and reason."""
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise ResultsError(f"{path}: {size} bytes, the limit is {MAX_BYTES}")
        return Results.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise ResultsError(f"{path}: not a readable results file: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ResultsError(f"{path}: {place or 'top level'}: {first['msg']}") from error


def without_timings(results: Results) -> dict[str, Any]:
    """Everything that the seed determines, as plain data: for comparing runs byte by byte with ``to_json``."""
    kept = _dropped(results.model_dump(mode="python"))
    assert isinstance(kept, dict)
    return kept


def to_json(data: Any, name: str = "results") -> str:
    """Sorted keys, fixed rounding, no NaN."""
    try:
        return json.dumps(_rounded(data), indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"
    except (TypeError, ValueError) as error:
        raise ResultsError(f"{name}: cannot be written as JSON: {error}") from error


def _dropped(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _dropped(item) for key, item in value.items() if key not in TIMING_FIELDS}
    if isinstance(value, list | tuple):
        return [_dropped(item) for item in value]
    return value


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        return round(float(value), DECIMALS) + 0.0  # + 0.0: no minus zero
    return value
