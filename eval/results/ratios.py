"""How many times cheaper than ORB-SLAM3: from the same run, and only where ORB-SLAM3 did its work as it is known to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from hippodrome.eval.results.model import Row
from hippodrome.eval.rivals.orbslam3.relocalize import METHOD
from hippodrome.eval.rivals.orbslam3.rows import FINAL
from hippodrome.eval.rivals.sequences import SequenceRow

OURS: Final = ("topometric (paper)", "topometric")
RATIOS: Final = "ratios.json"
NAMES: Final = {"mapping_cpu": "mapping CPU", "map_bytes": "map file", "initial_compute": "compute until the first fix"}
KNOWN_APE_M: Final = 1.0  # final trajectory, rigid fit; 0.15 to 0.35 on 600 m, 0.42 to 0.73 on 7.2 km of the same kind of town
LEAST_TRACKED: Final = 0.95


def ratios(rows: Sequence[Row], sequences: Sequence[SequenceRow]) -> dict[str, Any]:
    """ORB-SLAM3's figure over ours: mapping CPU, map file, compute until the first fix; or why they are not quoted."""
    by_method = {row.method: row for row in rows}
    theirs = by_method.get(FINAL)
    if theirs is None or (cause := _unfit(theirs)):
        return {"not quoted": cause if theirs is not None else f"no row {FINAL}"}
    found: dict[str, Any] = {}
    for method in OURS:
        ours = by_method.get(method)
        if ours is None or ours.failure is not None:
            found[method] = {"not quoted": ours.failure if ours is not None else "no row"}
            continue
        first_ours, first_theirs = _paired(sequences, method)
        found[method] = {
            "mapping_cpu": _over(theirs.cpu_percent, ours.cpu_percent),
            "map_bytes": _over(theirs.map_bytes, ours.map_bytes),
            "initial_compute": _over(first_theirs, first_ours),
        }
    return found


def ratio_lines(found: Mapping[str, Any]) -> list[str]:
    """The same for a terminal."""
    if "not quoted" in found:
        return [f"ratios to ORB-SLAM3 not quoted: {found['not quoted']}"]
    return [f"ORB-SLAM3 over {method}: {_said(figures)}" for method, figures in found.items()]


def _said(figures: Mapping[str, Any]) -> str:
    if "not quoted" in figures:
        return f"not quoted, {figures['not quoted']}"
    return ", ".join(f"{name} {times(figures.get(key))}" for key, name in NAMES.items())


def times(value: float | None) -> str:
    """A ratio in words."""
    return "-" if value is None else f"{value:.0f}x" if value >= 10.0 else f"{value:.1f}x"


def _unfit(row: Row) -> str | None:
    """Why this run is no measure."""
    extra = row.model_extra or {}
    if row.failure is not None or row.ape is None:
        return f"{FINAL}: {row.failure or 'no APE'}"
    if row.ape.mean_m > KNOWN_APE_M:
        return f"{FINAL}: APE {row.ape.mean_m:.2f} m, not at most {KNOWN_APE_M:g} m"
    if extra.get("tracked_share", 0.0) < LEAST_TRACKED:
        return f"{FINAL}: {100.0 * extra.get('tracked_share', 0.0):.0f} % of the frames tracked"
    return None


def _paired(sequences: Sequence[SequenceRow], method: str) -> tuple[float | None, float | None]:
    """Mean compute [ms] until the first fix, ours and theirs, over the sequences in which both had one."""
    times: dict[tuple[str, int], float] = {}
    for row in sequences:
        if row.localization is not None and row.localization.initial_time_ms is not None:
            times[row.method, row.number] = row.localization.initial_time_ms
    both = [number for name, number in times if name == method and (METHOD, number) in times]
    if not both:
        return None, None
    ours, theirs = (float(np.mean([times[name, number] for number in both])) for name in (method, METHOD))
    return ours, theirs


def _over(theirs: float | None, ours: float | None) -> float | None:
    return theirs / ours if theirs and ours else None
