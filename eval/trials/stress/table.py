"""The rows of a stress run as Markdown: distribution, worst case and failures beside each mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from hippodrome.eval.results.markdown import table
from hippodrome.eval.trials.stress.rows import FAR_M, WRONG_M, StressRow

TO_BE_REFUSED: Final = ("another town", "self-similar grid")  # the drive never was there, or may have been anywhere in it
HEAD: Final = (
    "case",
    "runs",
    "refused",
    "APE mean (m)",
    "APE median (m)",
    "APE p90 (m)",
    "worst run (m)",
    "worst vertex (m)",
    "RPE 20 m (m)",
    "vouched (%)",
    "right (%)",
    "> 5 m (%)",
    "wrong vertices",
    "NEES",
    "CPU (s)",
)
NOTES: Final = (
    "APE: distance of a vertex from the truth in the network's frame, without alignment, over the vertices that the refinement",
    "vouches for: a run's mean, and over runs mean, median, 90th percentile and worst. RPE: over 20 m of driving, all vertices.",
    "Vouched: share of the vertices that the refinement declares matched. Right: of the vertices on roads that the network has,",
    f"the share vouched for and within {FAR_M:g} m. Over {FAR_M:g} m, and wrong (over {WRONG_M:g} m): of the vouched ones.",
    "NEES: squared error over its covariance, per dimension, over the vouched; 1 is calibrated. Refused: nothing is vouched for,",
    f"as it must be in: {' and '.join(TO_BE_REFUSED)}. `stress.json` has the command that reruns each row.",
)


def stress_markdown(rows: Sequence[StressRow]) -> str:
    """A line per case, over all its runs; below the table, every run that failed."""
    cases = dict.fromkeys(_name(row) for row in rows)
    lines = table(HEAD, [_cells(case, [row for row in rows if _name(row) == case]) for case in cases])
    refused = [f"- {_name(row)}, {row.scenario}, seed {row.seed}: {row.failure}. `{row.rerun}`" for row in rows if row.failure]
    refused = ["## Refused or failed", "", *refused] if refused else []
    return "\n".join(["# Stress of the refinement, from rendered frames", "", *lines, "", *NOTES, "", *refused, ""])


def _name(row: StressRow) -> str:
    """The case, and whose it is if it is not our refinement's."""
    return f"{row.method}: {row.case}" if row.method else row.case


def _cells(case: str, rows: Sequence[StressRow]) -> list[str]:
    """One case's line. Where nothing is vouched for in any of its runs, there are no figures."""
    good = [row for row in rows if row.ape_mean_m is not None]
    counts = [case, str(len(rows)), str(len(rows) - len(good))]
    if not good:
        return [*counts, *["-"] * (len(HEAD) - len(counts))]
    method = rows[0].method
    apes_m = np.array([row.ape_mean_m for row in good], dtype=float)
    worst = max(good, key=lambda row: row.ape_mean_m or 0.0)
    return [
        *counts,
        *(f"{value:.2f}" for value in (apes_m.mean(), np.median(apes_m), np.percentile(apes_m, 90))),
        f"{worst.ape_mean_m:.2f} ({worst.scenario}, seed {worst.seed})",
        f"{max(row.ape_max_m or 0.0 for row in good):.1f}",
        f"{np.mean([row.rpe_20m_mean_m for row in good]):.2f}",
        f"{100 * np.mean([row.matched_share for row in rows]):.1f}",
        _mean([row.right_share for row in good if row.right_share is not None] or ([] if method else [0.0]), 100.0, 1),
        f"{100 * sum(row.far for row in rows) / max(sum(row.matched_share * row.vertices for row in rows), 1.0):.2f}",
        str(sum(row.wrong for row in rows)),
        _mean([row.nees for row in good if row.nees is not None], 1.0, 2),
        f"{np.median([row.cpu_s for row in rows]):.1f}",
    ]


def _mean(values: Sequence[float], factor: float, digits: int) -> str:
    """The mean in the table's unit, or a dash if there is no value."""
    return f"{factor * np.mean(values):.{digits}f}" if values else "-"
