"""What came of localizing sequences from unknown starts: one sequence, one condition, and figures pooled over many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from hippodrome.core.localization.beliefs.config import Mode
from hippodrome.core.types import FloatArray
from hippodrome.eval.metrics.mapped_road import MAPPED, OnMap

ELSEWHERE: Final = "another town"  # name of the condition under which whatever is declared is false
MAIN_MODE: Final[Mode] = "coupled"  # the localizer that is judged; the other modes are yardsticks beside it
WITHIN_M: Final = 200.0  # a sequence is a success if the localizer is right within this much mapped road
DEFINITION: Final = (
    f"success: declared localized, and within 20 m of the truth, before {WITHIN_M:g} m of mapped road are driven; drives "
    "without a fix and with less mapped road are not judged. Error: position, declared steps on mapped road from then on, of "
    "all sequences; worst: the largest mean error of one sequence. Off the map: share of the declared steps elsewhere, by dead "
    "reckoning, and their mean error, m. False: sequences with a declared step more than 20 m wrong, on the map or off it. "
    "Localized: share of steps after the first fix that are declared. NEES: per dimension (x, y, heading), 1 is calibrated. "
    f"Sequences overlap where the drive is short; all conditions drive the same route. Mapped: {MAPPED}."
)


@dataclass(frozen=True, slots=True, eq=False)
class SequenceResult:
    """What came of one unknown start."""

    number: int  # number of the start along the drive, from 1; the option ``--start`` runs it alone
    start: tuple[float, ...]  # true pose at the start: metres, metres, radians
    on_map: OnMap
    false_fixes: int  # declared steps that are more than 20 m wrong
    false_share: float  # share of the declared steps that are so
    declared: int  # declared steps of the whole sequence
    nees: float | None  # mean over the declared steps; None if there are none
    step_ms: float  # CPU time of a step, mean over all steps
    query_step_ms: float  # CPU time of a step that looks at a query frame, median

    @property
    def localized_after_m(self) -> float | None:
        """Metres of mapped road until the first right fix; None if there was none."""
        return self.on_map.localized_after_m

    @property
    def success(self) -> bool | None:
        """Whether it was localized in time; None if there was too little mapped road to tell."""
        after_m = self.localized_after_m
        if after_m is None and self.on_map.way_m < WITHIN_M:
            return None
        return after_m is not None and after_m <= WITHIN_M

    @property
    def localized_share(self) -> float | None:
        """Share of the steps from the first fix on that are declared; None without a fix."""
        on_map = self.on_map
        return (len(on_map.errors_m) + len(on_map.off_map_errors_m)) / on_map.steps if on_map.steps else None

    @property
    def error_mean_m(self) -> float | None:
        """Mean position error of the declared steps on mapped road; None without any."""
        return _mean(self.on_map.errors_m)

    def record(self) -> dict[str, Any]:
        """This sequence's figures as plain data."""
        return {
            "number": self.number,
            "start": list(self.start),
            "localized_after_m": self.localized_after_m,
            "error_mean_m": self.error_mean_m,
            "off_map_error_mean_m": _mean(self.on_map.off_map_errors_m),
            "false_fixes": self.false_fixes,
            "false_share": self.false_share,
            "localized_share": self.localized_share,
            "nees": self.nees,
        }


@dataclass(frozen=True, slots=True, eq=False)
class ConditionResult:
    """All sequences under one condition, localized by one mode of our localizer, or by another method."""

    name: str
    sequences: tuple[SequenceResult, ...]
    mode: str = MAIN_MODE  # of our localizer, or the label of another method

    @property
    def failures(self) -> list[SequenceResult]:
        """Sequences with a false fix and, in the mapped town, those without a right fix in time."""
        return [one for one in self.sequences if one.false_fixes > 0 or (self.name != ELSEWHERE and one.success is False)]

    def summary(self) -> dict[str, Any]:
        """The condition's row of the table as plain data; figures without a sample are None."""
        return {"condition": self.name, "mode": self.mode, **pooled(self.sequences)}

    def record(self) -> dict[str, Any]:
        """The row, and under ``starts`` the figures of each sequence."""
        return {**self.summary(), "starts": [one.record() for one in self.sequences]}


def pooled(sequences: Sequence[SequenceResult]) -> dict[str, Any]:
    """Figures over all steps of several sequences together, not means of their means; None without a sample."""
    errors_m = np.concatenate([one.on_map.errors_m for one in sequences])
    off_map_m = np.concatenate([one.on_map.off_map_errors_m for one in sequences])
    after_m = [one.localized_after_m for one in sequences if one.localized_after_m is not None]
    declared, steps = len(errors_m) + len(off_map_m), sum(one.on_map.steps for one in sequences)
    judged = [one.success for one in sequences if one.success is not None]
    means_m = [mean_m for one in sequences if (mean_m := one.error_mean_m) is not None]
    return {
        "sequences": len(sequences),
        "judged": len(judged),
        "success_share": float(np.mean(judged)) if judged else None,
        "error_mean_m": _mean(errors_m),
        "error_p95_m": float(np.percentile(errors_m, 95.0)) if len(errors_m) else None,
        "worst_sequence_mean_m": max(means_m, default=None),
        "localized_after_median_m": float(np.median(after_m)) if after_m else None,
        "localized_after_max_m": max(after_m, default=None),
        "false_sequences": sum(one.false_fixes > 0 for one in sequences),
        "off_map_share": len(off_map_m) / declared if declared else None,
        "off_map_error_mean_m": _mean(off_map_m),
        "localized_share": declared / steps if steps else None,
        "nees": _pooled_nees(sequences),
    }


def _pooled_nees(sequences: Sequence[SequenceResult]) -> float | None:
    """Mean NEES over the declared steps of all sequences, from the mean and the number of steps of each."""
    nees = [(one.nees, one.declared) for one in sequences if one.nees is not None]
    return sum(mean * count for mean, count in nees) / sum(count for _, count in nees) if nees else None


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) else None
