"""Rows of a stress run and their summary: distribution, worst case and failures beside each mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WRONG_M = 10.0  # a vertex declared matched and farther off than this is on a wrong road: lanes of one road are nearer


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


def stress_markdown(rows: Sequence[StressRow]) -> str:
    """A line per case: distribution, worst case, failures."""
    head = ("case", "runs", "failed", "APE mean (m)", "median", "p90", "worst run", "worst vertex", "RPE 20 m (m)",
            "vouched (%)", "wrong vertices", "NEES", "CPU (s)")  # fmt: skip
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
                str(sum(row.wrong for row in mine)),
                f"{np.mean([row.nees for row in good if row.nees is not None]):.2f}",
                f"{np.median([row.cpu_s for row in mine]):.1f}",
            ]
        lines.append(f"| {' | '.join([*cells, *['-'] * (len(head) - len(cells))])} |")
    failures = [f"- {row.case}, {row.scenario}, seed {row.seed}: {row.failure}" for row in rows if row.failure]
    note = ("APE and NEES over the vertices that the refinement vouches for; wrong: vouched and more than "
            f"{WRONG_M:g} m off. Rerun one row: `hippodrome stress SCENARIO.yaml --seeds N --case NAME`.")  # fmt: skip
    return "\n".join(["# Stress of the refinement, from rendered frames", "", *lines, "", note, "", *failures, ""])
