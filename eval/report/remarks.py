"""Sentences for somebody who has not read the paper: what is compared, who is given what, and what in the figures surprises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hippodrome.eval.methods.method import DEAD_RECKONING, NO_ATTRACTOR, SEMI_METRIC, method_of
from hippodrome.eval.report.belief import AS_PRINTED
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.results.fairness import OURS
from hippodrome.eval.results.model import Results, Row, ScenarioResult

PAPER: Final = (
    "Jinyu Li, Taiping Zeng and Bailu Si, Brain-Inspired Visual Topometric Localization via Roadnetwork-Constraint "
    "Hidden Markov Model, 2025"
)
GIVEN: Final = {  # by the mode of the refinement, else by the frame of a map
    "route": "camera, wheels and the road network, but neither start nor scale",
    "paper": "camera, wheels, the road network and the true starting pose",
    "own": "camera and wheels, no roads; laid on the true starting pose before they are scored, and not scaled",
    "wheels": "wheels alone; laid on the true starting pose in the same way",
    "metric": "frames of two cameras; laid on the truth by the best rigid fit before it is scored",
    "other": "what each town's tab says of them",
}
NUMBERS: Final = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
SAME: Final = (
    f"\u201c{SEMI_METRIC.label}\u201d and \u201c{NO_ATTRACTOR.label}\u201d have the same errors: loops are closed by views, "
    "and the steps between places are those of the odometry, so both maps have the same poses to the last bit. The attractor "
    "networks tell which way and where the car is while it is localized (The brain at work, in a town's tab), not where its "
    "map's places lie; what they cost is seen in CPU and size of the map."
)


def in_words(count: int, one: str) -> str:
    """A number of things, as one begins a title with it."""
    number = NUMBERS[count] if count < len(NUMBERS) else f"{count:,}"
    return f"{number} {one}" if count == 1 else f"{number} {one}s"


def title(results: Results) -> str:
    """What the page compares, for its head. ``results`` are those of maps alone; without any the page is one of missions."""
    methods = {row.method for scenario in results.scenarios for row in scenario.rows}
    if not methods:
        return "Missions in simulated towns"
    words = f"{in_words(len(methods), 'mapping method')} compared on {in_words(len(results.scenarios), 'simulated town')}"
    return words[0].upper() + words[1:]


def lede(results: Results) -> Html:
    """What was done, in two sentences."""
    km = sum(one.network.km for one in results.scenarios)
    drive_s = sum(one.duration_s for one in results.scenarios)
    driven = [coverage * one.network.km for one in results.scenarios if (coverage := _coverage(one)) is not None]
    on_all = len(driven) == len(results.scenarios)
    road = (
        f"on {sum(driven):.1f} of the {km:.1f}\N{NO-BREAK SPACE}km of road"
        if on_all
        else f"in {km:.1f}\N{NO-BREAK SPACE}km of road"
    )
    return joined(
        f"In each town a simulated car drives twice. The first drives ({drive_s / 60:.0f} minutes, {road}) are mapped from "
        "camera and wheels; the second ones are localized in those maps, from an unknown start."
    )


def _coverage(scenario: ScenarioResult) -> float | None:
    """Share of the road network that the first drive covered; None in results that do not say it."""
    tours = getattr(scenario, "tours", None)
    tour = tours.get("mapping") if isinstance(tours, dict) else None
    found = tour.get("coverage") if isinstance(tour, dict) else None
    return float(found) if isinstance(found, int | float) and 0.0 < found <= 1.0 else None


def names(results: Results, has_printed: bool) -> Html:
    """What the names of the rows mean; ``has_printed`` says whether the page shows the networks as the paper prints them, too."""
    methods = _rows(results)
    modes = {name: method_of(name).mode for name in methods}
    said = [f"{name} is the map refined exactly as the paper prints it" for name, mode in modes.items() if mode == "paper"]
    said += [f"{name} is refined our way" for name, mode in modes.items() if mode == "route"]
    if has_printed:
        said.append(
            f"\u201c{AS_PRINTED}\u201d localizes in that map with the attractor networks exactly as the paper prints them"
        )
    return joined(f"The paper is {PAPER}; \u2020 marks what is quoted from it. {_sentence(said) if said else ''}")


def given(results: Results) -> Html:
    """Who is given the roads and the start, true for every row."""
    groups: dict[str, list[str]] = {}
    for row in _rows(results).values():
        method = method_of(row.method, row.declaration.frame if row.declaration else None)
        is_ours = row.declaration is None or row.declaration.source == OURS
        kind = "wheels" if row.method == DEAD_RECKONING.label else (method.mode or method.frame) if is_ours else "other"
        groups.setdefault(kind if kind in GIVEN else "other", []).append(row.method)
    parts = [f"{'; '.join(groups[kind])}: {words}." for kind, words in GIVEN.items() if kind in groups]
    lines = [element("li", part) for part in (*parts, "No localizer is told where the second drive begins.")]
    return element("ul", lines)


def _rows(results: Results) -> dict[str, Row]:
    """A row of each method, in the order of the tables."""
    return {row.method: row for scenario in results.scenarios for row in reversed(scenario.rows)}


def _sentence(parts: Sequence[str]) -> str:
    return "; ".join(parts) + "."


def surprises(scenarios: Sequence[ScenarioResult]) -> Html | None:
    """What in the figures a reader may take for a fault, explained; None if there is no such thing."""
    notes = [note for note in (_same(scenarios), _by_wheels_alone(scenarios)) if note]
    return joined(*(element("p", note, class_="note") for note in notes)) if notes else None


def _same(scenarios: Sequence[ScenarioResult]) -> str | None:
    pairs = [(_row(one, SEMI_METRIC.label), _row(one, NO_ATTRACTOR.label)) for one in scenarios]
    both = [(one, other) for one, other in pairs if one is not None and other is not None]
    return SAME if both and all(_errors_m(one) == _errors_m(other) for one, other in both) else None


def _errors_m(row: Row) -> list[tuple[float, float | None] | None]:
    return [None if one is None else (one.mean_m, one.max_m) for one in (row.ape, row.ape_sim2, row.rpe)]


def _by_wheels_alone(scenarios: Sequence[ScenarioResult]) -> str | None:
    """Where dead reckoning has a smaller APE than a map of the same frame, with both after the best fit with a scale."""
    beaten: dict[str, list[str]] = {}
    for scenario in scenarios:
        alone = _row(scenario, DEAD_RECKONING.label)
        maps = [row for row in reversed(scenario.rows) if row.method not in (DEAD_RECKONING.label, NO_ATTRACTOR.label)]
        for row in maps:
            if method_of(row.method).frame == "own" and alone is not None and (words := _nearer(alone, row)) is not None:
                beaten.setdefault(row.method, []).append(f"{scenario.name} ({words})")
    if not beaten:
        return None
    found = "; than ".join(f"{method} in {' and '.join(towns)}" for method, towns in beaten.items())
    return (
        f"As it lies, dead reckoning is nearer to the truth than {found}. All of them have the odometry's wrong scale and its "
        "turned course, which move the whole map; what a map adds is its shape, and that is what Sim(2) compares."
    )


def _nearer(alone: Row, row: Row) -> str | None:
    """Both figures of a row that lies farther from the truth than another, and those after the best fit with a scale."""
    if alone.ape is None or row.ape is None or row.ape.mean_m <= alone.ape.mean_m:
        return None
    words = f"{alone.ape.mean_m:.2f} against {row.ape.mean_m:.2f} m"
    if alone.ape_sim2 is None or row.ape_sim2 is None:
        return words
    return f"{words}; Sim(2): {alone.ape_sim2.mean_m:.2f} against {row.ape_sim2.mean_m:.2f} m"


def _row(scenario: ScenarioResult, method: str) -> Row | None:
    return next((row for row in scenario.rows if row.method == method), None)
