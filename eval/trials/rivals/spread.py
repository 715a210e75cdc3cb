"""Several runs of one method as rows of Table I: the run of median error, and the spread of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import score_trajectory
from hippodrome.eval.methods.method import Method
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.programs.pairs import StereoDrive
from hippodrome.eval.results.model import Row, summarize
from hippodrome.eval.trials.rivals.kept import Run, run_figures

SPACING_M: Final = 5.0  # of the scored samples: as far apart as the map's vertices, so that "consecutive" means the same

Which = Literal["live", "final"]


@dataclass(frozen=True, slots=True)
class Cards:
    """What the rows of a method are called that corrects its poses later."""

    live: Method  # the poses as they were reported: what a vehicle would have had
    final: Method  # the poses in the end

    def failed(self, cause: str) -> list[Row]:
        """Both rows of a method that never ran."""
        return [Row(method=method.label, failure=cause) for method in (self.live, self.final)]


def rows(cards: Cards, runs: Sequence[Run], drive: StereoDrive) -> list[Row]:
    """One row for the poses as they were reported, one for the poses in the end.

    Each row shows the run of median APE among those that ended well, has all of them in ``runs``, and fails if none did. The
    scored samples of each run go to its folder.
    """
    return [_row(cards.live, "live", runs, drive), _row(cards.final, "final", runs, drive)]


def _row(method: Method, which: Which, runs: Sequence[Run], drive: StereoDrive) -> Row:
    truth = drive.truth()
    scored: list[tuple[float, Run, Trajectory]] = []
    reports: list[dict[str, object]] = []
    for run in runs:
        trajectory = run.live if which == "live" else run.final
        report = run_figures(run)
        if trajectory is not None:
            try:
                samples = thinned(trajectory, SPACING_M)
                error_m = ape(samples, truth, "se2").mean_m
                report["ape_se2_m"] = error_m
                scored.append((error_m, run, samples))
                write_tum(tum_path(run, which), samples)
            except HippodromeError as error:
                report["failure"] = str(error)
        reports.append(report)
    if not scored:
        return Row(method=method.label, failure="; ".join(str(report["failure"]) for report in reports), runs=reports)
    scored.sort(key=lambda item: item[0])
    _, median, samples = scored[(len(scored) - 1) // 2]
    spread = {"runs": reports, "ape_spread_m": [scored[0][0], scored[-1][0]], "median_run": median.folder.name}
    return Row(method=method.label, **_errors(samples, truth, method), **_costs(median, drive), **spread)


def median_run(row: Row) -> str:
    """Name of the run that a row of ``rows`` shows."""
    name = (row.model_extra or {})["median_run"]
    assert isinstance(name, str)
    return name


def tum_path(run: Run, which: Which) -> Path:
    """File of the scored samples of a run."""
    return run.folder / f"body-{which}.tum"


def thinned(trajectory: Trajectory, spacing_m: float) -> Trajectory:
    """One sample per ``spacing_m`` of the way travelled: the first of each such stretch."""
    steps = np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T)
    stretch = np.floor(np.concatenate([[0.0], np.cumsum(steps)]) / spacing_m)
    kept = np.concatenate([[True], np.diff(stretch) > 0])
    return Trajectory(trajectory.t_s[kept], trajectory.poses[kept])


def _errors(samples: Trajectory, truth: Trajectory, method: Method) -> dict[str, Any]:
    """Errors of the row. Its APE is that after the best rigid fit, which favours it; the other fits stand beside it."""
    scored = score_trajectory(samples, truth, method.alignment)
    fits = {f"ape_{fit}": summarize(ape(samples, truth, fit)) for fit in ("start", "se2", "sim2")}
    return {"ape": summarize(scored.ape), **fits, "rpe": summarize(scored.rpe), "rpe_20m": summarize(scored.rpe_20m)}


def _costs(run: Run, drive: StereoDrive) -> dict[str, Any]:
    assert run.figures is not None
    return {
        "cpu_percent": 100.0 * run.figures.cpu_s / drive.duration_s,
        "map_bytes": run.figures.map_bytes,
        "camera_frames": run.figures.frames,
        "keyframes": run.figures.keyframes,
        "maps_started": run.figures.maps_started,
        "tracked_share": run.figures.tracked / run.figures.frames,
        "peak_rss_bytes": run.figures.peak_rss_bytes,
    }
