"""What a run keeps beside its results, read back as if anybody had written it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from hippodrome._files import read_bounded
from hippodrome._json import parse_json
from hippodrome.core.types import HippodromeError, MatchBreak, MatchStatus
from hippodrome.eval.real.findings import Finding, Kind
from hippodrome.sim.key_words import first_fault

REFINE_AGAIN: Final = "not the breaks of a refinement; delete it, and the same command makes it anew"
MAX_BYTES: Final = 16 << 20  # of a file that is kept; a run of hours writes some 100 kB


class _Stage(BaseModel):
    """A finished stage: seconds, and the lines that it said."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    seconds: float | None
    said: list[str]


class _Record(BaseModel):
    """``run.json``. What an earlier version did not write yet may be missing."""

    asked: dict[str, str] = {}
    stages: dict[str, _Stage] = {}


class _Break(BaseModel):
    first: int
    last: int
    status: str
    cause: str


class _Finding(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False)
    kind: Kind
    first_vertex: int
    last_vertex: int
    points_m: tuple[tuple[float, float], ...]
    length_m: float
    offset_m: tuple[float, float] | None = None
    sigma_m: float | None = None
    passes: int = 1


class _Refinement(BaseModel):
    """``refinement.json``. An earlier version wrote breaks only."""

    model_config = ConfigDict(allow_inf_nan=False)
    breaks: list[_Break]
    findings: list[_Finding] = []
    map_error_m: tuple[float, float] | None = None


def read_record(path: Path) -> dict[str, Any]:
    """What was asked of an earlier run, and the stages that it finished. Raises HippodromeError."""
    record: _Record = _read(path, TypeAdapter(_Record), "not the record of a run; choose a new --out")
    return record.model_dump(exclude_unset=True)


def read_breaks(path: Path, vertices: int) -> tuple[MatchBreak, ...]:
    """The breaks that the refinement of a map of so many vertices left. Raises HippodromeError."""
    found = _read(path, TypeAdapter(_Refinement), REFINE_AGAIN).breaks
    if unknown := [one.status for one in found if one.status not in MatchStatus.__members__]:
        raise HippodromeError(f"{path}: '{unknown[0][:40]}' is no status of a match: {REFINE_AGAIN}")
    _check_vertices(path, [(one.first, one.last) for one in found], vertices)
    return tuple(MatchBreak(one.first, one.last, MatchStatus[one.status], one.cause) for one in found)


def read_findings(path: Path, vertices: int) -> tuple[tuple[Finding, ...], tuple[float, float] | None]:
    """Where the map seemed wrong, and its median and 95 % error in metres; a refinement of an earlier version has neither.

    Raises HippodromeError.
    """
    content: _Refinement = _read(path, TypeAdapter(_Refinement), REFINE_AGAIN)
    _check_vertices(path, [(one.first_vertex, one.last_vertex) for one in content.findings], vertices)
    return tuple(Finding(**one.model_dump()) for one in content.findings), content.map_error_m


def _check_vertices(path: Path, stretches: list[tuple[int, int]], vertices: int) -> None:
    for first, last in stretches:
        if not 0 <= first <= last < vertices:
            said = f"vertices {str(first)[:12]} to {str(last)[:12]} of a map of {vertices}"
            raise HippodromeError(f"{path}: {said}: {REFINE_AGAIN}")


def _read(path: Path, model: TypeAdapter[Any], complaint: str) -> Any:
    try:
        data = parse_json(read_bounded(path, MAX_BYTES))
        return model.validate_python(data)
    except ValidationError as error:
        raise HippodromeError(f"{path}: {first_fault(error, data)}: {complaint}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise HippodromeError(f"{path}: {' '.join(str(error).split())[:200]}: {complaint}") from None
