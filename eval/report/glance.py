"""What a reader wants to know first of a run: the best method, its worst place, the second drives, what failed, the command."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from hippodrome.eval.report.commands import command_lines
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.markup import Child, Html, element, joined
from hippodrome.eval.report.places import place_address
from hippodrome.eval.results.model import Results, Row, ScenarioResult
from hippodrome.eval.results.thresholds import limits_missed

NBSP: Final = "\N{NO-BREAK SPACE}"
MOST_NAMED: Final = 6  # of scenarios in a sentence, and of troubles in the list; the tabs have the others


def at_a_glance(results: Results, found: Sequence[ScenarioFiles]) -> Html:
    """Five questions and their answers, from the results alone."""
    best = best_method(results)
    answers: list[tuple[str, Child]] = [("Best method", _best(results, best))]
    if worst := _worst(results, found, best):
        answers.append(("Worst place", worst))
    if localized := _localized(results, best):
        answers.append(("Second drive", localized))
    answers.append(("Refused or failed", _troubles(results)))
    answers.append(("Run it again", joined(element("code", _command(results.scenarios)), ", typed in the folder of this page.")))
    return element("dl", [joined(element("dt", name), element("dd", words)) for name, words in answers], class_="glance")


def best_method(results: Results) -> str | None:
    """The method with the least mean APE in most scenarios, of rows that neither failed nor were refused; of equals the later."""
    wins = [least.method for one in results.scenarios if (least := min(reversed(_vouched(one)), key=_ape_m, default=None))]
    return max(reversed(list(dict.fromkeys(wins))), key=wins.count, default=None)


def _vouched(scenario: ScenarioResult) -> list[Row]:
    return [row for row in scenario.rows if row.ape is not None and row.refused is None and row.failure is None]


def _ape_m(row: Row) -> float:
    assert row.ape is not None
    return row.ape.mean_m


def _best(results: Results, best: str | None) -> Html:
    if best is None:
        return joined("None: no map was scored.")
    least = [
        (min(map(_ape_m, rows)), row)
        for one in results.scenarios
        for rows in [_vouched(one)]
        for row in rows
        if row.method == best
    ]
    wins = sum(_ape_m(row) == smallest for smallest, row in least)
    spread = _between([_ape_m(row) for _, row in least])
    count = len(results.scenarios)
    where = "in the one town" if count == 1 else f"in {wins} of {count} towns"
    meaning = (
        "APE (absolute position error) is how far the map puts the car from its true place, in the mean over the first drive. "
        "Methods that do not know the roads are given the true starting pose."
    )
    return joined(element("strong", best), f" has the smallest mean APE {where}, {spread}. {meaning}")


def _worst(results: Results, found: Sequence[ScenarioFiles], best: str | None) -> Html | None:
    """Where the best method is worst, with a link that plays from there."""
    places = []
    for scenario, files in zip(results.scenarios, found, strict=True):
        layers = files.evidence.methods if files.evidence else []
        layer = next((one for one in layers if one.name == best and one.worst), None)
        if layer is not None and (error_m := layer.error_m[layer.worst[0]]) is not None:
            places.append((error_m, scenario.name, layer.t_s[layer.worst[0]]))
    if not places:
        return None
    error_m, town, t_s = max(places)
    link = element("a", "see it there", href=place_address(town, 1, t_s))
    return joined(f"In {town}, {t_s:.0f}{NBSP}s into the first drive, {best} is {error_m:.2f}{NBSP}m off: ", link, ". ",
                  "Each town's tab shows its worst places with their camera frames, and why.")  # fmt: skip


def _localized(results: Results, best: str | None) -> Html | None:
    """How the second drives went in the best method's maps."""
    located = [(one.name, row.localization) for one in results.scenarios for row in one.rows
               if row.method == best and row.localization is not None]  # fmt: skip
    if not located:
        return None
    fixed = [(name, one) for name, one in located if one.initial_drive_s is not None]
    lost = [name for name, one in located if one.initial_drive_s is None and one.error_mean_m is None]
    parts = []
    if fixed:
        when = _between([one.initial_drive_s or 0.0 for _, one in fixed], "s", 1)
        errors = [one.error_mean_m for _, one in fixed if one.error_mean_m is not None]
        parts.append(f"In the map of {best}, it was localized from an unknown start after {when}")
        parts[0] += ", as soon as several views in a row agreed on one place"
        parts += [f"from then on it was {_between(errors)} off in the mean"] if errors else []
    if lost:
        parts.append(f"{'it' if fixed else 'It'} was never localized in {_named(lost)}")
    return joined("; ".join(parts) + ".") if parts else None


def _troubles(results: Results) -> Html:
    """What was refused, failed or missed its limit, with the cause; or that there is no such thing."""
    lines = [(one.name, line) for one in results.scenarios for line in _trouble_lines(one)]
    if not lines:
        return joined("Nothing: every method has a map in every town, and all limits hold.")
    more = [element("li", f"and {len(lines) - MOST_NAMED} more, in the towns' tabs")] if len(lines) > MOST_NAMED else []
    return element("ul", [element("li", f"{town}: {line}") for town, line in lines[:MOST_NAMED]], more, class_="failures")


def _trouble_lines(scenario: ScenarioResult) -> Iterator[str]:
    yield from (f"limit missed: {line}" for line in limits_missed(scenario) or ())
    for row in scenario.rows:
        if row.failure is not None:
            yield f"{row.method} failed: {row.failure}"
        elif row.refused is not None:
            yield f"{row.method}: map refused: {row.refused}"


def _command(scenarios: Sequence[ScenarioResult]) -> str:
    """The command that makes everything again, in the folder of the report."""
    lines = [next(command_lines(one, None))[1] for one in scenarios]
    if any("--network" in line for line in lines) or len(lines) > MOST_NAMED:
        return lines[0]  # a network belongs to one scenario: the other towns' commands are in their tabs
    return shlex.join(["hippodrome", "eval", *(f"{one.name}/scenario.json" for one in scenarios), "--out", "again"])


def _between(values: Sequence[float], unit: str = "m", digits: int = 2) -> str:
    least, most = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return f"{least}{NBSP}{unit}" if least == most else f"{least} to {most}{NBSP}{unit}"


def _named(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else "")
