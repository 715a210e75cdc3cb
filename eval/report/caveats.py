"""What a reader must know beside the means: limits, places that nothing vouches for, doubts after the first fix, false fixes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from hippodrome.eval.metrics.localization import FALSE_FIX_M
from hippodrome.eval.report.belief import AS_PRINTED, Belief, worst_steps
from hippodrome.eval.report.evidence import Layer, LocalizedDrive
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.places import place_address
from hippodrome.eval.results.model import Row, ScenarioResult
from hippodrome.eval.results.thresholds import limits_in_words, limits_missed

NBSP: Final = "\N{NO-BREAK SPACE}"
BREAKS_NAMED: Final = 4  # stretches of vertices of a method in one town; its table of breaks has the others


def limit_lines(scenarios: Sequence[ScenarioResult]) -> list[str]:
    """What the scenarios' own limits ask for and where they hold, a line for each set of limits."""
    asked = [(words, one) for one in scenarios if (words := limits_in_words(one)) is not None]
    lines = []
    for words in dict.fromkeys(words for words, _ in asked):
        missed = {one.name: bool(limits_missed(one)) for own, one in asked if own == words}
        held = [name for name, is_missed in missed.items() if not is_missed]
        parts = [f"held in {', '.join(held)}"] if held else []
        parts += (
            [f"missed in {', '.join(name for name, is_missed in missed.items() if is_missed)}"] if any(missed.values()) else []
        )
        lines.append(f"{words}: {'; '.join(parts)}.")
    return lines


def unvouched_lines(scenario: ScenarioResult, files: ScenarioFiles) -> list[str] | None:
    """Vertices of refined maps that the road match does not vouch for; None if no row of the scenario tells of any match."""
    refined = [row for row in reversed(scenario.rows) if isinstance(getattr(row, "breaks", None), list | tuple)]
    if not refined:
        return None
    layers = {layer.name: layer for layer in files.evidence.methods} if files.evidence else {}
    return [line for row in refined if (line := _unvouched(row, layers.get(row.method))) is not None]


def _unvouched(row: Row, layer: Layer | None) -> str | None:
    """How many vertices of a map nothing vouches for, which, and why; None if there are none."""
    found: list[tuple[int, int, str]] = []
    for one in getattr(row, "breaks", ()):
        first, last = (one.get("first_vertex"), one.get("last_vertex")) if isinstance(one, dict) else (None, None)
        if isinstance(first, int) and isinstance(last, int):
            found.append((first, last, str(one.get("status", "unknown")).lower().replace("_", " ")))
    if not found:
        return None
    count = sum(last - first + 1 for first, last, _ in found)
    named = [f"{first}–{last}" if last > first else f"{first}" for first, last, _ in found[:BREAKS_NAMED]]
    named += [f"{len(found) - BREAKS_NAMED} more stretches"] if len(found) > BREAKS_NAMED else []
    of = "" if row.vertices is None else f" of {row.vertices:,}"
    why = ", ".join(dict.fromkeys(status for _, _, status in found))
    words = f"{row.method}: {count:,}{of} vertices (numbers {', '.join(named)}"
    if layer is None or found[-1][1] >= len(layer.t_s):
        return f"{words}): {why}."
    words += f"; from {layer.t_s[found[0][0]]:.0f} to {layer.t_s[found[-1][1]]:.0f}{NBSP}s of the first drive): {why}"
    if layer.worst and any(first <= layer.worst[0] <= last for first, last, _ in found):
        words += "; the worst place of this map is among them"
    return f"{words}."


def doubt_lines(scenario: ScenarioResult, files: ScenarioFiles) -> list[str] | None:
    """Who doubted its place after the first fix, when and for how long; None if no localizer was ever localized."""
    drives: dict[str, Belief | LocalizedDrive] = {one.name: one for one in (files.evidence.drives if files.evidence else ())}
    drives |= {one.name: one for one in (files.second.beliefs if files.second else ())}
    names = [row.method for row in reversed(scenario.rows) if row.method in drives]
    told = [drives[name] for name in (*names, *(name for name in drives if name not in names)) if any(drives[name].localized)]
    return [line for drive in told if (line := _doubt(drive)) is not None] if told else None


def _doubt(drive: Belief | LocalizedDrive) -> str | None:
    """When a localizer was not localized after its first fix, as it was sampled; None if it always was."""
    stretches = list(_doubts(drive))
    if not stretches:
        return None
    begin_s, end_s = max(stretches, key=lambda one: one[1] - one[0])
    longest = f"{begin_s:.1f} to {end_s:.1f}{NBSP}s into the second drive"
    longest += ", its end" if end_s >= drive.t_s[-1] - drive.t_s[0] else ""
    for_s = sum(end_s - begin_s for begin_s, end_s in stretches)
    if len(stretches) == 1:
        return f"{drive.name}: {longest} ({for_s:.1f}{NBSP}s)."
    return f"{drive.name}: {len(stretches)} times, {for_s:.1f}{NBSP}s in all, the longest {longest}."


def _doubts(drive: Belief | LocalizedDrive) -> Iterator[tuple[float, float]]:
    """Begin and end in s since the drive began of each stretch that is not localized, after the first fix."""
    first = drive.localized.index(True)
    for known, steps in groupby(range(first, len(drive.t_s)), key=lambda step: drive.localized[step]):
        own = list(steps)
        if not known:
            end = min(own[-1] + 1, len(drive.t_s) - 1)
            yield drive.t_s[own[0]] - drive.t_s[0], drive.t_s[end] - drive.t_s[0]


def false_fix_lines(scenarios: Sequence[ScenarioResult], found: Sequence[ScenarioFiles]) -> list[Html]:
    """How often each localizer was sure of a place more than 20 m off, a line for each, with a link to the worst moment."""
    counts: dict[str, dict[str, int]] = {}
    for scenario, files in zip(scenarios, found, strict=True):
        for row in reversed(scenario.rows):
            if row.localization is not None and row.localization.false_fixes is not None:
                counts.setdefault(row.method, {})[scenario.name] = row.localization.false_fixes
        if (count := printed_false_fixes(scenario, files)) is not None:
            counts.setdefault(AS_PRINTED, {})[scenario.name] = count
    beliefs = {(one.name, belief.name): belief for one, files in zip(scenarios, found, strict=True)
               for belief in (files.second.beliefs if files.second else ())}  # fmt: skip
    lines = []
    for method, by_town in counts.items():
        towns = [joined(f"{count} in {town}", _worst_moment(town, beliefs.get((town, method)))) for town, count in by_town.items()
                 if count]  # fmt: skip
        parts = [piece for town in towns for piece in ("; ", town)][1:]
        lines.append(joined(f"{method}: ", *(parts or ["none"]), "."))
    return lines


def printed_false_fixes(scenario: ScenarioResult, files: ScenarioFiles) -> int | None:
    """False fixes of the networks as the paper prints them; of older results those that the samples show, None without any."""
    if scenario.as_printed is not None and scenario.as_printed.localization is not None:
        return scenario.as_printed.localization.false_fixes
    belief = next((one for one in (files.second.beliefs if files.second else ()) if one.name == AS_PRINTED), None)
    if belief is None:
        return None
    wrong = [known and (error_m or 0.0) > FALSE_FIX_M for known, error_m in zip(belief.localized, belief.error_m, strict=True)]
    return sum(now and not before for before, now in zip([False, *wrong], wrong, strict=False))


def _worst_moment(town: str, belief: Belief | None) -> Html | None:
    """How far off it was at worst while it was sure, with a link; None where nothing was kept of it."""
    worst = worst_steps(belief)[:1] if belief is not None else []
    if belief is None or not worst or (off_m := belief.error_m[worst[0]]) is None or off_m <= FALSE_FIX_M:
        return None
    link = element("a", "see it there", href=place_address(town, 2, belief.t_s[worst[0]], belief.name))
    return joined(f", up to {off_m:.2f}{NBSP}m off (", link, ")")


def town_caveats(scenario: ScenarioResult, files: ScenarioFiles) -> Html | None:
    """The caveats of one town, in its tab; None if there are none."""
    lines = [f"Not vouched for: {line}" for line in unvouched_lines(scenario, files) or ()]
    lines += [
        f"In doubt after the first fix (it said that it no longer knew its place): {line}"
        for line in doubt_lines(scenario, files) or ()
    ]
    wrong = [line for line in false_fix_lines([scenario], [files]) if not line.endswith(": none.")]
    items = [element("li", line) for line in (*lines, *(joined("False fixes: ", line) for line in wrong))]
    return element("ul", items, class_="caveats") if items else None
