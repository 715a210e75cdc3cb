"""How many times cheaper than ORB-SLAM3: from the same run, and only where ORB-SLAM3 did its work as it is known to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from hippodrome.eval.methods.method import ORBSLAM3, ORBSLAM3_FINAL, REFINED, Method
from hippodrome.eval.results.model import Row
from hippodrome.eval.results.table_two import SequenceRow

RATIOS: Final = "ratios.json"
NOT_QUOTED: Final = "not quoted"  # key of the reason, where there are no ratios
NAMES: Final = {"mapping_cpu": "mapping CPU", "map_bytes": "map file", "initial_compute": "compute until the first fix"}
# Mean APE of the final trajectory after a rigid fit. ORB-SLAM3 is known to reach 0.15 to 0.35 m on drives of 600 m and 0.42 to
# 0.73 m on 7.2 km through the same kind of town: a run above this limit went wrong.
KNOWN_APE_M: Final = 1.0
LEAST_TRACKED: Final = 0.95  # share of the frames


def ratios(rows: Sequence[Row], sequences: Sequence[SequenceRow]) -> dict[str, Any]:
    """ORB-SLAM3's figure over ours, or why it is not quoted.

    Args:
        rows: The rows of Table I of one scenario.
        sequences: The rows of Table II of the same run.

    Returns:
        By label of each of our methods, the ratios under the keys of ``NAMES``, None where a figure is missing; or, for a method
        or instead of all of them, the reason under ``NOT_QUOTED``.
    """
    by_label = {row.method: row for row in rows}
    theirs = by_label.get(ORBSLAM3_FINAL.label)
    if theirs is None:
        return {NOT_QUOTED: f"no row {ORBSLAM3_FINAL.label}"}
    if cause := _why_unfit(theirs):
        return {NOT_QUOTED: cause}
    return {method.label: _ratios_of(method, by_label.get(method.label), theirs, sequences) for method in REFINED}


def ratio_lines(found: Mapping[str, Any]) -> list[str]:
    """The same for a terminal, one line per method."""
    if NOT_QUOTED in found:
        return [f"ratios to ORB-SLAM3 not quoted: {found[NOT_QUOTED]}"]
    return [f"ORB-SLAM3 over {label}: {_in_words(figures)}" for label, figures in found.items()]


def times(value: float | None) -> str:
    """A ratio in words."""
    return "-" if value is None else f"{value:.0f}x" if value >= 10.0 else f"{value:.1f}x"


def _ratios_of(method: Method, ours: Row | None, theirs: Row, sequences: Sequence[SequenceRow]) -> dict[str, Any]:
    if ours is None or ours.failure is not None:
        return {NOT_QUOTED: ours.failure if ours is not None else "no row"}
    first_ours_ms, first_theirs_ms = _initial_times_ms(sequences, method)
    return {
        "mapping_cpu": _ratio(theirs.cpu_percent, ours.cpu_percent),
        "map_bytes": _ratio(theirs.map_bytes, ours.map_bytes),
        "initial_compute": _ratio(first_theirs_ms, first_ours_ms),
    }


def _in_words(figures: Mapping[str, Any]) -> str:
    if NOT_QUOTED in figures:
        return f"not quoted, {figures[NOT_QUOTED]}"
    return ", ".join(f"{name} {times(figures.get(key))}" for key, name in NAMES.items())


def _why_unfit(row: Row) -> str | None:
    """Why nothing may be compared with this run of ORB-SLAM3; None if it may."""
    extra = row.model_extra or {}
    if row.failure is not None or row.ape is None:
        return f"{row.method}: {row.failure or 'no APE'}"
    if row.ape.mean_m > KNOWN_APE_M:
        return f"{row.method}: APE {row.ape.mean_m:.2f} m, not at most {KNOWN_APE_M:g} m"
    if extra.get("tracked_share", 0.0) < LEAST_TRACKED:
        return f"{row.method}: {100.0 * extra.get('tracked_share', 0.0):.0f} % of the frames tracked"
    return None


def _initial_times_ms(sequences: Sequence[SequenceRow], method: Method) -> tuple[float | None, float | None]:
    """Mean compute until the first fix, of ``method`` and of ORB-SLAM3, over the sequences in which both had one."""
    times_ms: dict[tuple[str, int], float] = {}
    for row in sequences:
        if row.localization is not None and row.localization.initial_time_ms is not None:
            times_ms[row.method, row.number] = row.localization.initial_time_ms
    both = [number for label, number in times_ms if label == method.label and (ORBSLAM3.label, number) in times_ms]
    if not both:
        return None, None
    ours, theirs = (float(np.mean([times_ms[one.label, number] for number in both])) for one in (method, ORBSLAM3))
    return ours, theirs


def _ratio(theirs: float | None, ours: float | None) -> float | None:
    return theirs / ours if theirs and ours else None
