"""Table II: ten sequences of the published lengths with unknown starts, in a saved map, cut from a drive other than the map's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from pydantic import BaseModel

from hippodrome._files import write_atomically
from hippodrome.core.types import CognitiveMap, HippodromeError, LocalizationEstimate, Observation, Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import Materials, file_stem
from hippodrome.eval.methods.stages import Localization, localize_recording
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.localization import LocalizationScore, score_localization
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.results.model import LocalizationSummary, summarize_localization, to_json
from hippodrome.eval.results.paper_rows import (
    INITIAL_TIME_MS,
    LOCALIZATION_ERROR_M,
    ORB_SLAM3,
    SEQUENCE_LENGTH_M,
    TOPOMETRIC,
)
from hippodrome.proto.codec import load_map
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import Recording

MAPS = {"topometric (paper)": "topometric-paper.pbstream", "topometric": "topometric-default.pbstream"}
TABLE_TWO = "table2.json"
WARM_UP_STEPS = 200


class SequenceRow(BaseModel):
    """One method on one sequence; ``failure`` instead of figures where it could not be run."""

    method: str
    number: int  # 1 to 10, as published
    length_m: float
    first_step: int | None = None  # of the localization recording
    failure: str | None = None
    localization: LocalizationSummary | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """A row, and the errors that it sums up, if there are any."""

    row: SequenceRow
    score: LocalizationScore | None = None


def table_two(materials: Materials, lengths_m: Sequence[float] = SEQUENCE_LENGTH_M) -> list[Located]:
    """Every sequence in every map of the scenario's folder."""
    warm_up()
    found = []
    for method, name in MAPS.items():
        path = materials.folder / name
        cognitive_map = load_map(path)[0] if path.exists() else None
        if cognitive_map is not None:  # a warm-up in a map of this size: the first sequence must not pay for all
            _localized(cognitive_map, materials, 0, WARM_UP_STEPS)
        for number, length_m in enumerate(lengths_m, start=1):
            row = SequenceRow(method=method, number=number, length_m=length_m)
            found.append(_located(row, len(lengths_m), cognitive_map, materials))
    return found


def located(
    row: SequenceRow, first: int, estimates: Sequence[LocalizationEstimate], score: LocalizationScore, to: Path
) -> Located:
    """The finished row; the poses that it vouched for go to a file, for whoever wants to compute the error again."""
    known = [estimate for estimate in estimates if estimate.localized]
    if known:
        poses = np.stack([estimate.pose for estimate in known])
        write_tum(sequence_file(to, row), Trajectory(np.array([e.t_s for e in known]), poses))
    return Located(row.model_copy(update={"first_step": first, "localization": summarize_localization(score)}), score)


def sequence_file(folder: Path, row: SequenceRow) -> Path:
    """Where a sequence's poses are, in the network frame."""
    return folder / "sequences" / f"{file_stem(row.method)}-{row.number}.tum"


def write_table_two(out: Path, name: str, rows: Sequence[SequenceRow]) -> None:
    """``NAME/table2.json`` and ``table2.md``."""
    write_atomically(out / name / TABLE_TWO, to_json([row.model_dump(mode="python") for row in rows]).encode())
    write_atomically(out / "table2.md", table_two_markdown(rows).encode())


class Sampled(Protocol):
    """A recorded drive, whatever its frames are."""

    @property
    def samples(self) -> Samples: ...


def cut(drive: Sampled, number: int, of: int, length_m: float) -> tuple[int, int]:
    """Steps [first, end) of sequence ``number``: the starts spread evenly over the drive. Raises HippodromeError."""
    way_m = path_length_m(drive.samples.poses_m)
    room_m = float(way_m[-1]) - length_m
    if room_m < 0.0:
        raise HippodromeError(f"the localization drive is {way_m[-1]:.0f} m long, the sequence {length_m:g} m")
    start_m = room_m * (number - 1) / max(of - 1, 1)
    first, end = np.searchsorted(way_m, [start_m, start_m + length_m], side="left")
    return int(first), int(end)


def table_two_markdown(rows: Sequence[SequenceRow]) -> str:
    """A line a sequence; the published figures beside ours."""
    lines = [[*HEAD], ["---", *["---:"] * (len(HEAD) - 1)], *(sequence_cells(row) for row in rows), *quoted_cells()]
    failures = [f"- {row.method}, sequence {row.number}: FAILED: {row.failure}" for row in rows if row.failure is not None]
    return "\n".join([*(f"| {' | '.join(line)} |" for line in lines), "", *failures, QUOTED, ""])


HEAD = ("Method", "Sequence", "Length (m)", "Success", "First fix (ms)", "First fix (m driven)", "Error (m)", "False fixes")
QUOTED = "† quoted from the paper, other drives in another simulator; not measured here"


def sequence_cells(row: SequenceRow) -> list[str]:
    """A row in words."""
    found = row.localization
    head = [row.method, str(row.number), f"{row.length_m:g}"]
    if found is None:
        return [*head, "FAILED", "-", "-", "-", "-"]
    figures = [_figure(value) for value in (found.initial_time_ms, found.initial_distance_m, found.error_mean_m)]
    return [*head, "yes" if found.success else "NO", *figures, str(found.false_fixes)]


def quoted_cells() -> list[list[str]]:
    """The published table, in the same columns."""
    lines = []
    for method in (ORB_SLAM3, TOPOMETRIC):
        figures = zip(SEQUENCE_LENGTH_M, INITIAL_TIME_MS[method], LOCALIZATION_ERROR_M[method], strict=True)
        for number, (length_m, time_ms, error_m) in enumerate(figures, start=1):
            lines.append([f"{method} †", str(number), f"{length_m:g}", "-", f"{time_ms:g}", "-", f"{error_m:g}", "-"])
    return lines


def _located(row: SequenceRow, of: int, cognitive_map: CognitiveMap | None, materials: Materials) -> Located:
    if cognitive_map is None:
        return Located(row.model_copy(update={"failure": "no map: the refinement failed"}))
    drive = materials.drive
    try:
        first, end = cut(drive, row.number, of, row.length_m)
        run = _localized(cognitive_map, materials, first, end)
        truth = Trajectory(drive.samples.t_s[first:end], drive.samples.poses_m[first:end])
        score = score_localization(run.estimates, truth, run.step_s)
    except HippodromeError as error:
        return Located(row.model_copy(update={"failure": str(error)}))
    return located(row, first, run.estimates, score, materials.folder)


def _localized(cognitive_map: CognitiveMap, materials: Materials, first: int, end: int) -> Localization:
    """The drive's steps [first, end) from an unknown start."""
    observations = _observations(materials.drive, first, min(end, len(materials.drive.samples.t_s)))
    return localize_recording(observations, cognitive_map, materials.roads, materials.scenario.localizer)


def _observations(recording: Recording, first: int, end: int) -> Iterator[Observation]:
    for i in range(first, end):
        number = int(recording.samples.frame[i])
        yield recording.samples.observation(i, recording.frame(number) if number >= 0 else None)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
