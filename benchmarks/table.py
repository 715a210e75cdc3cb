"""What a benchmark reports."""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """One measured figure."""

    benchmark: str
    case: str
    value: float
    unit: str
    remark: str = ""


def table(rows: list[Row]) -> str:
    """Aligned columns, one line a figure."""
    cells = [
        ("benchmark", "case", "value", "unit", "remark"),
        *((r.benchmark, r.case, f"{r.value:.3g}", r.unit, r.remark) for r in rows),
    ]
    widths = [max(len(row[i]) for row in cells) for i in range(5)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells)
