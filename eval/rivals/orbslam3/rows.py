"""Runs of ORB-SLAM3 as rows of Table I: the run of median error, and the spread of all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import score_trajectory
from hippodrome.eval.methods.method import ORBSLAM3_FINAL, ORBSLAM3_LIVE, Method
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.results.model import Row, summarize
from hippodrome.eval.rivals.orbslam3.pairs import StereoDrive
from hippodrome.eval.rivals.orbslam3.poses import thinned
from hippodrome.eval.rivals.orbslam3.tracker import Run, run_figures

SPACING_M: Final = 5.0  # of the scored samples: as far apart as the map's vertices, so that "consecutive" means the same

Which = Literal["live", "final"]


def failed_rows(cause: str) -> list[Row]:
    """Both rows of a tracker that never ran."""
    return [Row(method=method.label, failure=cause) for method in (ORBSLAM3_LIVE, ORBSLAM3_FINAL)]


def rows(runs: Sequence[Run], drive: StereoDrive) -> list[Row]:
    """One row for the poses as they were reported (what a vehicle would have had), one for the poses in the end.

    Each row shows the run of median APE among those that ended well, has all of them in ``runs``, and fails if none did. The
    scored samples of each run go to its folder.
    """
    return [_row(ORBSLAM3_LIVE, "live", runs, drive), _row(ORBSLAM3_FINAL, "final", runs, drive)]


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


def _errors(samples: Trajectory, truth: Trajectory, method: Method) -> dict[str, Any]:
    """Errors of the row. Its APE is that after the best rigid fit, which favours the tracker; the other fits stand beside it."""
    scored = score_trajectory(samples, truth, method.alignment)
    fits = {f"ape_{fit}": summarize(ape(samples, truth, fit)) for fit in ("start", "se2", "sim2")}
    return {"ape": summarize(scored.ape), **fits, "rpe": summarize(scored.rpe), "rpe_20m": summarize(scored.rpe_20m)}


def _costs(run: Run, drive: StereoDrive) -> dict[str, Any]:
    assert run.figures is not None
    return {
        "cpu_percent": 100.0 * run.figures.cpu_s / drive.duration_s,
        "map_bytes": run.figures.map_bytes,
        "camera_frames": run.figures.frames,
        "keyframes": run.keyframes,
        "maps_started": run.maps_started,
        "tracked_share": run.figures.tracked / run.figures.frames,
        "peak_rss_bytes": run.figures.peak_rss_bytes,
    }
