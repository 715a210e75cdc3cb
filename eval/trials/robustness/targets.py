"""The localizer's figures held against what they must be and what they should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

SUN_AND_FOG: Final = "sun-opposite-fog-80m"
FALSE_LIMIT: Final = 0.01  # of all sequences


@dataclass(frozen=True, slots=True)
class Target:
    """``most``: the figure has to stay below; otherwise above."""

    item: str
    value: float | None  # None: not measured by this run
    must: float
    aim: float
    most: bool
    unit: str

    @property
    def shortfall(self) -> float:
        """By how much the figure is on the wrong side of what it must be; negative on the right side."""
        assert self.value is not None
        return self.value - self.must if self.most else self.must - self.value

    @property
    def verdict(self) -> str:
        if self.value is None:
            return "not measured"
        sign = 1.0 if self.most else -1.0
        if sign * self.value <= sign * self.aim:
            return "aim reached"
        return "held" if self.shortfall <= 0.0 else "MISSED"

    @property
    def figure(self) -> str:
        return "-" if self.value is None else f"{self.value:.3g}"

    @property
    def with_unit(self) -> str:
        return self.figure if self.value is None else f"{self.figure} {self.unit}"


def targets(
    mapped: dict[str, Any], everywhere: Sequence[dict[str, Any]], places: Sequence[dict[str, Any]], paper: dict[str, Any],
    kidnapped: dict[str, Any], measured: dict[str, Any],
) -> list[Target]:  # fmt: skip
    """The table, from the summaries of the run: ``mapped`` pools all conditions, ``everywhere`` has a row for each, another
    town's among them.
    """
    same = next((row for row in everywhere if row["condition"] == "same"), None)
    recalls = {row["condition"]: next(iter(row["recognisers"].values()))["recall"] for row in places}
    false_share = sum(row["false_sequences"] for row in everywhere) / sum(row["sequences"] for row in everywhere)
    return [
        Target("error after initial localization, same condition, paper's lengths", paper["error_mean_m"], 1.5, 0.7, True, "m"),
        Target("place recognition, recall at 99 %, same condition", _percent(recalls.get("same")), 90.0, 97.0, False, "%"),
        Target("place recognition, recall at 99 %, sun + fog", _percent(recalls.get(SUN_AND_FOG)), 75.0, 95.0, False, "%"),
        Target("success within 200 m, same condition", _percent(same["success_share"] if same else None), 95.0, 99.0, False, "%"),
        Target("success within 200 m, all conditions", _percent(mapped["success_share"]), 80.0, 95.0, False, "%"),
        Target("sequences with a false fix, all conditions, another town's included",
               _percent(false_share), 100 * FALSE_LIMIT, 0.0, True, "%"),
        Target("metres until localized, median of all conditions", mapped["localized_after_median_m"], 50.0, 20.0, True, "m"),
        Target("recovery after kidnapping, median of all", kidnapped["recovered_after_median_m"], 100.0, 40.0, True, "m"),
        Target("step with a look, median", measured["look_ms"], 1.0, 0.3, True, "ms"),
        Target("step, mean over all", measured["step_ms"], 1.0, 0.3, True, "ms"),
        Target("bytes per view, on disk", measured["bytes_per_view"], 2000.0, 700.0, True, "bytes"),
    ]  # fmt: skip


def markdown(found: Sequence[Target]) -> str:
    """One row a target."""
    lines = ["## Against the targets", "", "| item | measured | must | aim | |", "|---|---|---|---|---|"]
    for target in found:
        bounds = f"{target.must:g} {target.unit} | {target.aim:g} {target.unit}"
        lines.append(f"| {target.item} | {target.with_unit} | {bounds} | {target.verdict} |")
    return "\n".join([*lines, ""])


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share
