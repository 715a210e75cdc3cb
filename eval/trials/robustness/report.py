"""The files and the text that a robustness trial leaves: for each town and, where there are several, for all of them pooled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from hippodrome._files import write_atomically
from hippodrome.eval.report.pages import write_trial_page
from hippodrome.eval.results.model import to_json
from hippodrome.eval.trials.robustness.figures import draw_curves, draw_heat_map
from hippodrome.eval.trials.robustness.findings import Findings, merged
from hippodrome.eval.trials.robustness.recall import DEFINITION as RECALL_DEFINITION
from hippodrome.eval.trials.robustness.sequences import DEFINITION
from hippodrome.eval.trials.robustness.tables import (
    conditions_markdown,
    failures_markdown,
    kidnapping_markdown,
    paper_lengths_markdown,
    places_markdown,
    targets_markdown,
    towns_targets_markdown,
    yardsticks_markdown,
)

ALL_TOWNS: Final = "all towns"


def report_town(folder: Path, name: str, found: Findings) -> None:
    """Write ``robustness.json``, ``.md``, ``.png``, ``.html`` and ``places.png`` of one town, and print the tables."""
    text = "\n".join([
        conditions_markdown(name, found.table), yardsticks_markdown(found.results, found.failed), places_markdown(found.places),
        kidnapping_markdown(found.kidnapped), paper_lengths_markdown(found.paper), targets_markdown(found.targets()),
        failures_markdown(found.failures()),
    ])  # fmt: skip
    _write(folder, {"scenario": name, "definition": DEFINITION, "place_definition": RECALL_DEFINITION, **found.summary()}, text)
    draw_heat_map(folder / "robustness.png", name, found.table)
    draw_curves(folder / "places.png", name, found.places)
    _write_page(folder, name, text)
    print(f"{text}\nwritten: {folder / 'robustness.html'}, beside it the same as JSON, Markdown and pictures")


def report_towns(out: Path, towns: Mapping[str, Findings]) -> None:
    """Write ``robustness.json``, ``.md``, ``.png``, ``.html`` of all towns into ``out``, above those of each; print the tables.

    Figures are pooled over the sequences of all towns; each target is also given town by town, so that the worst is seen.
    """
    pooled = merged(list(towns.values()))
    targets = {name: found.targets() for name, found in towns.items()}
    text = "\n".join([
        conditions_markdown(f"{ALL_TOWNS}: {', '.join(towns)}", pooled.table), yardsticks_markdown(pooled.results, pooled.failed),
        places_markdown(pooled.places), towns_targets_markdown(targets, pooled.targets()),
    ])  # fmt: skip
    by_town = {name: {target.item: target.value for target in found} for name, found in targets.items()}
    _write(out, {"towns": by_town, **pooled.summary()}, text)
    draw_heat_map(out / "robustness.png", f"{ALL_TOWNS} ({', '.join(towns)})", pooled.table)
    _write_page(out, ALL_TOWNS, text)
    print(f"{text}\nwritten: {out / 'robustness.html'}, beside it the same as JSON, Markdown and a picture")


def _write_page(folder: Path, name: str, text: str) -> None:
    pictures = [folder / "robustness.png", folder / "places.png"]
    write_trial_page(folder / "robustness.html", f"Robustness: {name}", text, pictures, "hippodrome robustness")


def _write(folder: Path, data: dict[str, Any], text: str) -> None:
    write_atomically(folder / "robustness.json", to_json(data, "robustness").encode())
    write_atomically(folder / "robustness.md", text.encode())
