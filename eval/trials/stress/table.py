"""Rows of a stress run and their summary: distribution, worst case and failures beside each mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WRONG_M = 10.0  # a vertex declared matched and farther off than this is on a wrong road: lanes of one road are nearer
FAR_M = 5.0  # as far off may a vertex be that is declared matched, one in 200 excepted
TO_BE_REFUSED = ("another town", "self-similar grid")  # where the drive never was, or may have been anywhere


@dataclass(frozen=True, slots=True)
class StressRow:
    """What came of one case. ``failure`` instead of figures where the refinement refused."""

    scenario: str
    seed: int
    case: str
    vertices: int
    matched_share: float = 0.0  # vertices that the refinement vouches for
    wrong: int = 0  # of these, farther than WRONG_M from the truth
    ape_mean_m: float | None = None  # over the vouched vertices
    ape_max_m: float | None = None
    ape_all_mean_m: float | None = None  # over all vertices, refused ones included
    rpe_20m_mean_m: float | None = None
    nees: float | None = None  # per dimension, vouched vertices
    cpu_s: float = 0.0
    failure: str | None = None
    far: int = 0  # of those vouched for, farther than FAR_M from the truth
    right_share: float | None = None  # of the vertices on roads that the network has: vouched for and within FAR_M
    rerun: str = ""  # the command that makes this row anew


def stress_markdown(rows: Sequence[StressRow]) -> str:
    """A line per case: distribution, worst case, failures."""
    head = ("case", "runs", "refused", "APE mean (m)", "median", "p90", "worst run", "worst vertex", "RPE 20 m (m)",
            "vouched (%)", "right (%)", "> 5 m (%)", "wrong vertices", "NEES", "CPU (s)")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 1)]
    for case in dict.fromkeys(row.case for row in rows):
        mine = [row for row in rows if row.case == case]
        good = [row for row in mine if row.ape_mean_m is not None]
        apes = np.array([row.ape_mean_m for row in good], dtype=float)
        worst = max(good, key=lambda row: row.ape_mean_m or 0.0, default=None)
        cells = [case, str(len(mine)), str(len(mine) - len(good))]
        if worst is not None:
            cells += [
                *(f"{value:.2f}" for value in (apes.mean(), np.median(apes), np.percentile(apes, 90))),
                f"{worst.ape_mean_m:.2f} ({worst.scenario}, seed {worst.seed})",
                f"{max(row.ape_max_m or 0.0 for row in good):.1f}",
                f"{np.mean([row.rpe_20m_mean_m for row in good]):.2f}",
                f"{100 * np.mean([row.matched_share for row in mine]):.1f}",
                f"{100 * np.mean([row.right_share for row in good if row.right_share is not None] or [0.0]):.1f}",
                f"{100 * sum(row.far for row in mine) / max(sum(row.matched_share * row.vertices for row in mine), 1.0):.2f}",
                str(sum(row.wrong for row in mine)),
                f"{np.mean([row.nees for row in good if row.nees is not None]):.2f}",
                f"{np.median([row.cpu_s for row in mine]):.1f}",
            ]
        lines.append(f"| {' | '.join([*cells, *['-'] * (len(head) - len(cells))])} |")
    refused = [f"- {row.case}, {row.scenario}, seed {row.seed}: {row.failure}. `{row.rerun}`" for row in rows if row.failure]
    return "\n".join(["# Stress of the refinement, from rendered frames", "", *lines, "", *NOTES, "", *refused, ""])


NOTES = (
    "APE: distance of a vertex from the truth in the network's frame, without alignment, over the vertices that the refinement",
    "vouches for: a run's mean, and over runs mean, median, 90th percentile and worst. RPE: over 20 m of driving, all vertices.",
    "Vouched: share of the vertices that the refinement declares matched. Right: of the vertices on roads that the network has,",
    f"the share vouched for and within {FAR_M:g} m. Over {FAR_M:g} m, and wrong (over {WRONG_M:g} m): of the vouched ones.",
    "NEES: squared error over its covariance, per dimension, over the vouched; 1 is calibrated. Refused: nothing is vouched for,",
    f"as it must be in: {' and '.join(TO_BE_REFUSED)}. `stress.json` has the command that reruns each row.",
)
