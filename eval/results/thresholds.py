"""A scenario's limits held against its result."""

from __future__ import annotations

from typing import Final

from pydantic import ValidationError

from hippodrome.eval.results.model import Row, ScenarioResult, drive_of, is_driven
from hippodrome.sim.mission_spec import MissionLimits
from hippodrome.sim.scenario import Thresholds

AT_LEAST: Final = ("success_rate", "spl", "driving_score")  # limits of missions that a figure must reach
AT_MOST: Final = (
    "collisions_at_fault", "wrong_way", "false_arrivals", "red_lights", "rights_of_way", "outside_lane_share", "time_ratio",
)  # fmt: skip


def limits_missed(result: ScenarioResult) -> list[str] | None:
    """One line per limit of the scenario's own that does not hold; None if it has none, or none that this version can read."""
    limits = _own_limits(result)
    return None if limits is None else failed_limits(limits, result)


def limits_in_words(result: ScenarioResult) -> str | None:
    """What the scenario's own limits ask for, in one line; None if they ask for nothing, or this version cannot read them."""
    limits = _own_limits(result)
    if limits is None:
        return None
    maps = "" if is_driven(result) else _in_words(limits)
    missions = _missions_in_words(limits.drive) if any(drive_of(row) is not None for row in result.rows) else ""
    return "; ".join(filter(None, (maps, missions))) or None


def _own_limits(result: ScenarioResult) -> Thresholds | None:
    configuration = getattr(result, "configuration", None)
    limits = configuration.get("thresholds") if isinstance(configuration, dict) else None
    try:
        return Thresholds.model_validate(limits) if limits else None
    except ValidationError:  # results of another version: their limits may have other names
        return None


def _in_words(limits: Thresholds) -> str:
    asked = [
        f"{name} at most {limit:g}{unit}"
        for name, limit, unit in (
            ("mean APE", limits.ape_mean_m, "\N{NO-BREAK SPACE}m"),
            ("mean RPE", limits.rpe_mean_m, "\N{NO-BREAK SPACE}m"),
            ("mean localization error", limits.localization_error_mean_m, "\N{NO-BREAK SPACE}m"),
            ("false fixes", limits.false_fixes, ""),
        )
        if limit is not None
    ]
    asked += ["second drive localized"] if limits.localization_success else []
    return f"{limits.method}: {', '.join(asked)}" if asked else ""


def _missions_in_words(limits: MissionLimits) -> str:
    asked = [
        f"{name.replace('_', ' ')} at {'least' if name in AT_LEAST else 'most'} {limit:g}"
        for name in (*AT_LEAST, *AT_MOST)
        if (limit := getattr(limits, name)) is not None
    ]
    return f"missions of {limits.row}: {', '.join(asked)}" if asked else ""


def failed_limits(limits: Thresholds, result: ScenarioResult) -> list[str]:
    """One line per limit that does not hold; a limit whose figure is missing does not hold.

    Args:
        limits: The scenario's limits, and the label of the method that they are for.
        result: The scenario's result.
    """
    if is_driven(result):  # missions alone: nothing was mapped and localized for the tables
        return failed_mission_limits(limits.drive, result)
    has_missions = any(drive_of(row) is not None for row in result.rows)
    return [*_failed_limits(limits, result), *(failed_mission_limits(limits.drive, result) if has_missions else [])]


def failed_mission_limits(limits: MissionLimits, result: ScenarioResult) -> list[str]:
    """One line per limit of missions that does not hold; a limit whose figure is missing does not hold."""
    asked = {name: limit for name in (*AT_LEAST, *AT_MOST) if (limit := getattr(limits, name)) is not None}
    if not asked:
        return []
    rows = {row.method: drive for row in result.rows if (drive := drive_of(row)) is not None}
    name = next((name for name, drive in rows.items() if limits.row in (name, drive.get("row"))), None)
    if name is None:
        return [f"no row '{limits.row}' of missions"]
    found = {figure: rows[name].get(figure) for figure in asked}
    return [
        f"{name}: {figure} is {'missing' if value is None else f'{value:.3g}'}, "
        f"the limit is {'at least ' if figure in AT_LEAST else ''}{asked[figure]:g}"
        for figure, value in found.items()
        if value is None or (value < asked[figure] if figure in AT_LEAST else value > asked[figure])
    ]


def _failed_limits(limits: Thresholds, result: ScenarioResult) -> list[str]:
    """The limits of maps and localization."""
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
