"""What came of one stress case: its row of ``stress.json``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

WRONG_M: Final = 10.0  # a vertex declared matched and farther off than this is on a wrong road: lanes of one road are nearer
FAR_M: Final = 5.0  # of the vertices declared matched, at most one in 200 may be farther off than this


@dataclass(frozen=True, slots=True)
class StressRow:
    """Figures of one case on one scenario and seed, or the ``failure`` where the refinement refused."""

    scenario: str
    seed: int
    case: str
    vertices: int  # vertices of the map
    matched_share: float = 0.0  # share of the vertices that the refinement vouches for
    wrong: int = 0  # vertices vouched for that are farther than WRONG_M from the truth
    ape_mean_m: float | None = None  # mean error of the vertices vouched for
    ape_max_m: float | None = None  # greatest error of the vertices vouched for
    ape_all_mean_m: float | None = None  # mean error of all vertices, refused ones included
    rpe_20m_mean_m: float | None = None  # mean RPE over 20 m of driving, all vertices
    nees: float | None = None  # mean NEES per dimension of the vertices vouched for; 1 is calibrated
    cpu_s: float = 0.0  # CPU time of the refinement
    failure: str | None = None
    far: int = 0  # vertices vouched for that are farther than FAR_M from the truth
    right_share: float | None = None  # share of the vertices on known roads that are vouched for and within FAR_M of the truth
    method: str = ""  # label of a method beside ours; empty: our refinement
    rerun: str = ""  # the command that makes this row anew
