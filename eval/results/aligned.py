"""Where a method with a frame of its own is better than ours once it is aligned, the tables say so in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from hippodrome.eval.methods.method import method_of
from hippodrome.eval.results.model import Row


def aligned_note(rows: Sequence[Row]) -> str | None:
    """A sentence where a method with a frame of its own has the better shape: its APE after the best similarity fit is lower.

    Held against the best of the maps that lie in the network's frame, under the same fit. None where there is no such method.
    """
    shapes: list[tuple[float, Row]] = [(row.ape_sim2.mean_m, row) for row in rows if row.ape_sim2 is not None and not row.quoted]
    placed = [one for one in shapes if _frame(one[1]) == "network" and one[1].refused is None]
    others = [one for one in shapes if _frame(one[1]) != "network"]
    if not placed or not others:
        return None
    (theirs, rival), (ours, best) = min(others, key=_first), min(placed, key=_first)
    if theirs >= ours:
        return None
    return (
        f"Laid on the truth by the best similarity fit, {rival.method} is better here than any map on the roads: "
        f"{theirs:.2f} m, {best.method} {ours:.2f} m."
    )


def _first(one: tuple[float, Row]) -> float:
    return one[0]


def _frame(row: Row) -> str:
    return method_of(row.method, row.declaration.frame if row.declaration else None).frame
