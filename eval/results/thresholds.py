"""A scenario's limits held against its result."""

from __future__ import annotations

from pydantic import ValidationError

from hippodrome.eval.results.model import Row, ScenarioResult
from hippodrome.sim.scenario import Thresholds


def limits_missed(result: ScenarioResult) -> list[str] | None:
    """One line per limit of the scenario's own that does not hold; None if it has none, or none that this version can read."""
    configuration = getattr(result, "configuration", None)
    limits = configuration.get("thresholds") if isinstance(configuration, dict) else None
    try:
        return failed_limits(Thresholds.model_validate(limits), result) if limits else None
    except ValidationError:  # results of another version: their limits may have other names
        return None


def failed_limits(limits: Thresholds, result: ScenarioResult) -> list[str]:
    """One line per limit that does not hold; a limit whose figure is missing does not hold.

    Args:
        limits: The scenario's limits, and the label of the method that they are for.
        result: The scenario's result.
    """
    row = next((row for row in result.rows if row.method == limits.method and not row.quoted), None)
    if row is None:
        return [f"no row '{limits.method}'"]
    if row.failure and (limits.ape_mean_m or limits.rpe_mean_m):
        return [f"{row.method}: {row.failure}"]
    localization = row.localization
    checks: list[tuple[str, float | None, float | None]] = [
        ("APE mean, m", row.ape.mean_m if row.ape else None, limits.ape_mean_m),
        ("RPE mean, m", row.rpe.mean_m if row.rpe else None, limits.rpe_mean_m),
        ("localization error mean, m", localization.error_mean_m if localization else None, limits.localization_error_mean_m),
        ("false fixes", localization.false_fixes if localization else None, limits.false_fixes),
    ]
    failures = [
        f"{row.method}: {name} is {'missing' if value is None else f'{value:.3g}'}, the limit is {limit:g}"
        for name, value, limit in checks
        if limit is not None and (value is None or value > limit)
    ]
    return failures + _success(limits, row)


def _success(limits: Thresholds, row: Row) -> list[str]:
    """The limit that the second drive must have been localized at all."""
    succeeded = row.localization is not None and row.localization.success
    return [f"{row.method}: never localized"] if limits.localization_success and not succeeded else []
