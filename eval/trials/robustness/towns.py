"""The robustness matrix over several towns: all sequences pooled, and each target town by town, so that the worst is seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.eval.results.model import to_json
from hippodrome.eval.trials.robustness.place_recognition import Answers
from hippodrome.eval.trials.robustness.places import PlaceResult
from hippodrome.eval.trials.robustness.places import markdown as places_markdown
from hippodrome.eval.trials.robustness.report import (
    ELSEWHERE,
    ConditionResult,
    Findings,
    draw_heat_map,
    markdown,
    yardsticks,
)
from hippodrome.eval.trials.robustness.targets import Target

NAME: Final = "all towns"
DEFINITION: Final = (
    "All: pooled from the samples of all towns, with one threshold of place recognition for them all. Verdicts: by the pooled "
    "figure, and by the worst town's."
)


def report_towns(out: Path, towns: Mapping[str, Findings]) -> None:
    """Writes ``robustness.json``, ``.md`` and ``.png`` of all towns into ``out``, above those of each town."""
    pooled = merged(list(towns.values()))
    away = [result for result in pooled.results if result.name == ELSEWHERE]
    by_town = {name: {target.item: target.value for target in found.targets()} for name, found in towns.items()}
    data = {"towns": by_town, **pooled.summary()}
    write_atomically(out / "robustness.json", to_json(data, "robustness").encode())
    text = "\n".join([
        markdown(f"{NAME}: {', '.join(towns)}", [*pooled.conditions, *away]), yardsticks(pooled.results),
        places_markdown(pooled.places), targets_markdown(towns, pooled.targets()),
    ])  # fmt: skip
    write_atomically(out / "robustness.md", text.encode())
    draw_heat_map(out / "robustness.png", f"{NAME} ({', '.join(towns)})", [*pooled.conditions, *away])
    print(f"{text}\nwritten: {out}/robustness.json, .md, .png")


def merged(towns: Sequence[Findings]) -> Findings:
    """The findings of several towns under the same conditions as one: their sequences, looks and jumps side by side."""
    first = towns[0]
    results = [
        ConditionResult(one.name, tuple(sequence for town in towns for sequence in town.results[i].sequences), one.mode)
        for i, one in enumerate(first.results)
    ]
    places = [
        PlaceResult(one.condition, tuple(map(_side_by_side, zip(*(town.places[i].answers for town in towns), strict=True))))
        for i, one in enumerate(first.places)
    ]
    kidnapped = {name: tuple(jump for town in towns for jump in town.kidnapped[name]) for name in first.kidnapped}
    paper = tuple(sequence for town in towns for sequence in town.paper)
    sizes = sum(town.map_bytes for town in towns), sum(town.views for town in towns)
    return Findings(results, places, kidnapped, paper, *sizes)


def targets_markdown(towns: Mapping[str, Findings], pooled: Sequence[Target]) -> str:
    """One row a target, one column a town."""
    head = ["item", *towns, "all", "must", "aim", "verdict: all", "worst town"]
    lines = ["## Against the targets", "", f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for target, *found in zip(pooled, *(one.targets() for one in towns.values()), strict=True):
        measured = [one for one in found if one.value is not None]
        worst = max(measured, key=lambda one: one.shortfall).verdict if measured else target.verdict
        cells = [
            target.item,
            *(one.figure for one in found),
            f"{target.figure} {target.unit}",
            f"{target.must:g}",
            f"{target.aim:g}",
        ]
        lines.append(f"| {' | '.join([*cells, target.verdict, worst])} |")
    return "\n".join([*lines, "", DEFINITION, ""])


def _side_by_side(answers: Sequence[Answers]) -> Answers:
    """One recogniser's answers in all towns."""
    arrays = {
        field.name: np.concatenate([getattr(one, field.name) for one in answers])
        for field in fields(Answers)
        if field.name != "method"
    }
    return Answers(answers[0].method, **arrays)
