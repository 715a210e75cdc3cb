"""What a reader wants to know first of a run: the best method, its worst places, the second drives, what failed, the command."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from hippodrome.eval.metrics.localization import FALSE_FIX_M
from hippodrome.eval.report.belief import worst_steps
from hippodrome.eval.report.caveats import doubt_lines, false_fix_lines, limit_lines, printed_false_fixes, unvouched_lines
from hippodrome.eval.report.commands import again, command_lines
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.markup import Child, Html, element, joined
from hippodrome.eval.report.places import place_address
from hippodrome.eval.report.remarks import given, names
from hippodrome.eval.results.model import Results, Row, ScenarioResult
from hippodrome.eval.results.thresholds import limits_missed

NBSP: Final = "\N{NO-BREAK SPACE}"
MOST_NAMED: Final = 6  # of scenarios in a sentence, and of troubles in the list; the tabs have the others


def at_a_glance(results: Results, found: Sequence[ScenarioFiles]) -> Html:
    """The questions that a reader has first, and their answers, from the results and the files beside them alone."""
    best = best_method(results)
    answers: list[tuple[str, Child]] = [("Best method", _best(results, best))]
    if worst := _worst(results, found, best):
        answers.append(("Worst place", worst))
    if localized := _localized(results, best):
        answers.append(("Second drive", localized))
    answers.append(("Refused or failed", _troubles(results)))
    answers += [(name, words) for name, words in _caveats(results, found) if words]
    has_printed = any(printed_false_fixes(one, files) is not None for one, files in zip(results.scenarios, found, strict=True))
    answers += [("The names", names(results, has_printed)), ("What each is given", given(results))]
    answers.append(("Run it again", again(_command(results.scenarios))))
    return element("dl", [joined(element("dt", name), element("dd", words)) for name, words in answers], class_="glance")


def _caveats(results: Results, found: Sequence[ScenarioFiles]) -> Iterator[tuple[str, Html | None]]:
    """What the means do not say; None for a question that does not arise."""
    pairs = list(zip(results.scenarios, found, strict=True))
    yield "Limits", _listed(limit_lines(results.scenarios), "None: the scenarios set none.")
    for name, lines_of, meaning, nothing in (
        ("Not vouched for", unvouched_lines, "", "Nothing: the road match vouches for every vertex of the refined maps."),
        ("In doubt again", doubt_lines, "When a localizer said, after its first fix, that it no longer knew its place:",
         "Never: once localized, it stayed so until the end of the drive."),
    ):  # fmt: skip
        known = [(one.name, lines) for one, files in pairs if (lines := lines_of(one, files)) is not None]
        lines = [f"{town}, {line}" for town, lines in known for line in lines]
        yield name, joined(meaning if lines else "", _listed(lines, nothing)) if known else None
    counted = false_fix_lines(results.scenarios, found)
    meaning = f"How often a localizer was sure of a place more than {FALSE_FIX_M:g}{NBSP}m away from the truth:"
    yield "False fixes", joined(meaning, _listed(counted, "")) if counted else None


def _listed(lines: Sequence[str], nothing: str) -> Html:
    """Lines as a list, of which the towns' tabs have those that do not fit."""
    if not lines:
        return joined(nothing)
    more = [element("li", f"and {len(lines) - MOST_NAMED} more, in the towns' tabs")] if len(lines) > MOST_NAMED else []
    return element("ul", [element("li", line) for line in lines[:MOST_NAMED]], more)


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
        "APE (absolute position error) is how far a map puts the car from its true place, in the mean over the map's vertices: "
        "the places that it keeps of the first drive."
    )
    return joined(element("strong", best), f" has the smallest mean APE {where}, {spread}. {meaning}")


def _worst(results: Results, found: Sequence[ScenarioFiles], best: str | None) -> Html | None:
    """Where the best method is worst, as a map and as what a drive is localized in, with links that show it there."""
    parts = [part for part in (_worst_of_map(results, found, best), _worst_of_drive(results, found, best)) if part]
    if not parts:
        return None
    return joined(*parts, "Each town's tab shows its worst places with their camera frames, and why.")


def _worst_of_map(results: Results, found: Sequence[ScenarioFiles], best: str | None) -> Html | None:
    """The largest error of the best method's maps."""
    places = []
    for scenario, files in zip(results.scenarios, found, strict=True):
        layers = files.evidence.methods if files.evidence else []
        layer = next((one for one in layers if one.name == best and one.worst), None)
        if layer is not None and (error_m := layer.error_m[layer.worst[0]]) is not None:
            places.append((error_m, scenario.name, layer.t_s[layer.worst[0]]))
    if not places:
        return None
    error_m, town, t_s = max(places)
    link = element("a", "see it there", href=place_address(town, 1, t_s, best or ""))
    return joined(
        f"Of the maps: in {town}, {t_s:.1f}{NBSP}s into the first drive, {best} is {error_m:.2f}{NBSP}m off: ", link, ". "
    )


def _worst_of_drive(results: Results, found: Sequence[ScenarioFiles], best: str | None) -> Html | None:
    """The largest error of the second drives in the best method's maps, while they were declared localized."""
    rows = [(one, files, row.localization) for one, files in zip(results.scenarios, found, strict=True) for row in one.rows
            if row.method == best and row.localization is not None and row.localization.error_max_m is not None]  # fmt: skip
    if not rows:
        return None
    town, files, located = max(rows, key=lambda one: one[2].error_max_m or 0.0)
    words = f"Of the second drives: in {town.name} it is up to {located.error_max_m:.2f}{NBSP}m off while localized"
    belief = next((one for one in (files.second.beliefs if files.second else ()) if one.name == best), None)
    if belief is None or not (worst := worst_steps(belief)):
        return joined(f"{words}. ")
    off_m, after_s = belief.error_m[worst[0]] or 0.0, belief.t_s[worst[0]] - belief.t_s[0]
    link = element("a", "see it there", href=place_address(town.name, 2, belief.t_s[worst[0]], belief.name))
    if f"{off_m:.2f}" == f"{located.error_max_m:.2f}":
        return joined(f"{words}, {after_s:.1f}{NBSP}s into it: ", link, ". ")
    return joined(f"{words}; of the moments that this page keeps, {after_s:.1f}{NBSP}s into it is the worst, "
                  f"{off_m:.2f}{NBSP}m: ", link, ". ")  # fmt: skip


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
        parts += (
            [f"from then on, while it declared itself localized, it was {_between(errors)} off in the mean"] if errors else []
        )
        shares = [100.0 * one.localized_share for _, one in fixed if one.localized_share is not None]
        parts += [f"it did so in {_between(shares, '%', 1)} of all its steps"] if shares else []
    if lost:
        parts.append(f"{'it' if fixed else 'It'} was never localized in {_named(lost)}")
    return joined("; ".join(parts) + ".") if parts else None


def _troubles(results: Results) -> Html:
    """What was refused, failed or missed its limit, with the cause; or that there is no such thing."""
    lines = [(one.name, line) for one in results.scenarios for line in _trouble_lines(one)]
    if not lines:
        return joined("Nothing: every method has a map in every town.")
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
