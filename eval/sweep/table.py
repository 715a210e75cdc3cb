"""The merged table: one row for each setting and method, from the samples of all its cells, with the worst beside the mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hippodrome.eval.drive.scoring import row_result
from hippodrome.eval.metrics.trajectory import pool
from hippodrome.eval.results.drives import DRIVE_COLUMNS, drive_cells
from hippodrome.eval.results.markdown import table
from hippodrome.eval.results.model import Row, drive_of, summarize
from hippodrome.eval.sweep.cell import CellResult
from hippodrome.eval.sweep.grid import SweepCell

NONE = "-"  # what stands for a figure that there is not
NOTE = "Means, percentiles and maxima are over the samples of all runs together; the worst run is the one with the greatest mean."
HEAD = (
    "setting",
    "method",
    "runs",
    "failed",
    "APE mean (m)",
    "APE median (m)",
    "APE p95 (m)",
    "APE max (m)",
    "worst run (m)",
    "RPE 20 m (m)",
    "localized",
    "localization mean (m)",
    "localization p95 (m)",
    "localization max (m)",
    "false fixes",
)


def pooled_rows(finished: Mapping[SweepCell, CellResult]) -> list[dict[str, Any]]:
    """One row of figures for each setting and method, as plain data: settings in the order of the grid, methods of the tables."""
    settings: dict[str, list[tuple[SweepCell, CellResult]]] = {}
    for cell, result in finished.items():
        settings.setdefault(cell.label, []).append((cell, result))
    return [
        _pooled(label, method, cells)
        for label, cells in settings.items()
        for method in dict.fromkeys(row.method for _, one in cells for row in one.result.rows)
    ]


def _pooled(label: str, method: str, cells: Sequence[tuple[SweepCell, CellResult]]) -> dict[str, Any]:
    """One method's figures under one setting, over the samples of all cells of that setting."""
    rows = [(cell, row) for cell, one in cells for row in one.result.rows if row.method == method]
    samples = [one.samples[method] for _, one in cells if method in one.samples]
    pooled = {
        name: summarize(pool([part[name].score() for part in samples if name in part])).model_dump()
        for name in ("ape", "rpe", "rpe_20m", "localization")
        if any(name in part for part in samples)
    }
    return {
        "setting": label,
        "parameters": cells[0][1].parameters,
        "method": method,
        "runs": len(rows),
        "failed": [{"cell": cell.name, "cause": row.failure} for cell, row in rows if row.failure is not None],
        "worst": _worst(rows),
        "localized": _localized(rows),
        **pooled,
        **_driven(rows),
    }


def _driven(rows: Sequence[tuple[SweepCell, Row]]) -> dict[str, Any]:
    """The figures of the missions of all cells together; nothing where there are none."""
    drives = [drive for _, row in rows if (drive := drive_of(row)) is not None]
    if not drives:
        return {}
    missions = [mission for drive in drives for mission in drive["missions_detail"]]
    figures = {key: value for key, value in row_result(missions, None).items() if key not in ("missions_detail", "definitions")}
    return {"drive": figures}


def _worst(rows: Sequence[tuple[SweepCell, Row]]) -> dict[str, Any] | None:
    """The cell with the greatest mean APE; None if none was scored."""
    scored = [(row.ape.mean_m, cell) for cell, row in rows if row.ape is not None]
    if not scored:
        return None
    mean_m, cell = max(scored, key=lambda one: one[0])
    return {"cell": cell.name, "scenario": cell.scenario.name, "seed": cell.scenario.seed, "ape_mean_m": mean_m}


def _localized(rows: Sequence[tuple[SweepCell, Row]]) -> dict[str, int] | None:
    """In how many cells the method localized the second drive; None if it does not localize."""
    found = [row.localization for _, row in rows if row.localization is not None]
    if not found:
        return None
    fixes = sum(one.false_fixes or 0 for one in found)
    return {"successes": sum(bool(one.success) for one in found), "of": len(found), "false_fixes": fixes}


def sweep_markdown(rows: Sequence[Mapping[str, Any]], failures: Sequence[tuple[str, str]]) -> str:
    """The table, and the cells that have no result."""
    lines = ["# Sweep", ""]
    if evaluated := [row for row in rows if "drive" not in row]:
        lines += table(HEAD, map(_line, evaluated), align="ll" + "r" * (len(HEAD) - 2))
        lines += ["", NOTE, ""]
    if driven := [row for row in rows if "drive" in row]:
        lines += ["## Missions", ""] if evaluated else []
        heads = ("setting", "row", "runs", "missions", *(column.title for column in DRIVE_COLUMNS))
        cells = [[row["setting"], row["method"], str(row["runs"]), str(row["drive"]["missions"]), *drive_cells(row["drive"])]
                 for row in driven]  # fmt: skip
        lines += table(heads, cells, align="ll" + "r" * (len(heads) - 2))
        lines += ["", "Figures are over the missions of all runs together; docs/loop.md says what each is.", ""]
    if failed := [f"- {row['method']}, {one['cell']}: {one['cause']}" for row in rows for one in row["failed"]]:
        lines += ["## Methods that failed", "", *failed, ""]
    if failures:
        lines += [f"## {len(failures)} cell(s) without a result", "", "The same command runs these, and only these, again.", ""]
        lines += [f"- {name}: {cause}" for name, cause in failures]
    return "\n".join(lines).rstrip() + "\n"


def _line(row: Mapping[str, Any]) -> list[str]:
    """The cells below ``HEAD``."""
    ape, worst, localized = row.get("ape"), row["worst"], row["localized"]
    located = row.get("localization")
    return [
        row["setting"],
        row["method"],
        str(row["runs"]),
        str(len(row["failed"])),
        *_figures(ape, ("mean_m", "median_m", "p95_m", "max_m")),
        f"{worst['ape_mean_m']:.2f} ({worst['scenario']}, seed {worst['seed']})" if worst else NONE,
        *_figures(row.get("rpe_20m"), ("mean_m",)),
        f"{localized['successes']} of {localized['of']}" if localized else NONE,
        *_figures(located, ("mean_m", "p95_m", "max_m")),
        str(localized["false_fixes"]) if localized else NONE,
    ]


def _figures(summary: Mapping[str, Any] | None, names: Sequence[str]) -> list[str]:
    return [NONE if summary is None or not np.isfinite(summary[name]) else f"{summary[name]:.2f}" for name in names]
