"""The findings of a robustness trial as Markdown: one function for each part of the text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from hippodrome.eval.results.markdown import table
from hippodrome.eval.trials.robustness.conditions import SAME
from hippodrome.eval.trials.robustness.findings import Failure
from hippodrome.eval.trials.robustness.kidnapping import DEFINITION as KIDNAPPING_DEFINITION
from hippodrome.eval.trials.robustness.kidnapping import Kidnapping, kidnapping_summary
from hippodrome.eval.trials.robustness.paper_lengths import PaperSequence, paper_record, paper_summary
from hippodrome.eval.trials.robustness.recall import DEFINITION as RECALL_DEFINITION
from hippodrome.eval.trials.robustness.recall import PlaceResult, recogniser_names
from hippodrome.eval.trials.robustness.sequences import DEFINITION, ELSEWHERE, WITHIN_M, ConditionResult, pooled
from hippodrome.eval.trials.robustness.targets import Target, worst

NONE: Final = "-"  # what stands for a figure without a sample
FIGURES: Final = (
    "success", "error mean / p95 / worst, m", "localized after median / max, m", "off the map", "error there, m", "false",
    "localized", "NEES",
)  # fmt: skip
PAPER_HEAD: Final = (
    "sequence",
    "length, m",
    "error median, m",
    "error mean, m",
    "error p95, m",
    "error off the map, m",
    "localized after, m",
    "false fixes",
)
TOWNS_DEFINITION: Final = (
    "All: pooled from the samples of all towns, with one threshold of place recognition for them all. Verdicts: by the pooled "
    "figure, and by the worst town's."
)


def conditions_markdown(name: str, results: Sequence[ConditionResult]) -> str:
    """The first table, one row a condition; ``name`` is the town's, or says which towns."""
    rows = [[result.name, *_cells(result.summary())] for result in results]
    return _part(f"# Localization under other conditions: {name}", table(["condition", *FIGURES], rows, align="left"), DEFINITION)


def yardsticks_markdown(results: Sequence[ConditionResult], failed: Mapping[str, str]) -> str:
    """One row a mode of the localizer, and one a method beside ours: all conditions of the mapped town pooled, and the error
    under the same condition. Methods that ``failed`` have a row without figures, and the cause below."""
    rows = []
    for mode in dict.fromkeys(result.mode for result in results):
        of_mode = [result for result in results if result.mode == mode and result.name != ELSEWHERE]
        row = pooled([one for result in of_mode for one in result.sequences])
        same = [_figures(result.summary(), "error_mean_m", "error_p95_m") for result in of_mode if result.name == SAME]
        rows.append([mode, *_cells(row), same[0] if same else NONE])
    head = ["mode", *FIGURES, "same: error mean / p95, m"]
    rows += [[label, *[NONE] * (len(head) - 1)] for label in failed]
    why = "\n".join(f"- {label}: {cause}" for label, cause in failed.items())
    return _part("## Yardsticks, given the same injections, and other methods", table(head, rows, align="left"), why)


def places_markdown(results: Sequence[PlaceResult]) -> str:
    """Place recognition: one row a condition, one column a recogniser. Below it, why a method has no figure in a row."""
    rows, names = [], recogniser_names(results)
    for result in results:
        row = result.summary()
        recalls = ["failed" if name in result.failed else _recalls(row["recognisers"].get(name)) for name in names]
        rows.append([result.condition, f"{row['looks']} ({row['mapped']})", *recalls])
    why = [f"- {label}, {result.condition}: {cause}" for result in results for label, cause in result.failed.items()]
    definition = "\n".join([f"{RECALL_DEFINITION} In brackets: strict.", *(["", *why] if why else [])])
    return _part("## Place recognition alone", table(["condition", "looks (mapped)", *names], rows, align="left"), definition)


def _recalls(figures: Mapping[str, float] | None) -> str:
    """A recogniser's cell under one condition; ``figures`` are None where it was not asked."""
    return NONE if figures is None else f"{100 * figures['recall']:.0f} % ({100 * figures['recall_strict']:.0f} %)"


def kidnapping_markdown(kidnapped: Mapping[str, Sequence[Kidnapping]]) -> str:
    """Kidnappings: one row a condition, and one for all of them."""
    every = [one for found in kidnapped.values() for one in found]
    rows = []
    for name, found in [*kidnapped.items(), ("all", every)]:
        row = kidnapping_summary(found)
        after = _figures(row, "recovered_after_median_m", "recovered_after_max_m")
        rows.append([name, f"{row['recovered']} of {row['kidnappings']}", after, _figures(row, "wrong_until_max_m")])
    head = ("condition", "recovered", "after median / max, m", "wrong until at most, m")
    return _part("## Kidnapping in mid-drive", table(head, rows, align="left"), KIDNAPPING_DEFINITION)


def paper_lengths_markdown(paper: Sequence[PaperSequence]) -> str:
    """The paper's ten lengths: one row each, and one for all of them. Below it, why some have no figures."""
    rows = []
    for record in map(paper_record, paper):
        fixes = NONE if record["failure"] else str(record["false_fixes"])
        rows.append([str(record["number"]), f"{record['length_m']:g}", *_errors(record, "localized_after_m"), fixes])
    why = [f"- sequence {one['number']}: {one['failure']}" for one in map(paper_record, paper) if one["failure"]]
    row = paper_summary(paper)
    localized = f"{row['successes']} of {row['sequences']} localized"
    rows.append(["all", localized, *_errors(row, "localized_after_median_m"), str(row["false_fixes"])])
    return _part("## The paper's ten lengths, same condition", table(PAPER_HEAD, rows, align="left"), "\n".join(why))


def targets_markdown(found: Sequence[Target]) -> str:
    """One row a target."""
    rows = [
        [one.item, one.with_unit, f"{one.must:g} {one.unit}", f"{one.aim:g} {one.unit}", one.verdict] for one in found
    ]  # fmt: skip
    return _part("## Against the targets", table(("item", "measured", "must", "aim", "verdict"), rows, align="left"))


def towns_targets_markdown(towns: Mapping[str, Sequence[Target]], pooled_targets: Sequence[Target]) -> str:
    """One row a target, one column a town; ``towns`` has the same targets for each town."""
    rows = []
    for target, *in_towns in zip(pooled_targets, *towns.values(), strict=True):
        of_worst_town = worst(in_towns) or target
        rows.append([
            target.item, *(one.figure for one in in_towns), f"{target.figure} {target.unit}", f"{target.must:g}",
            f"{target.aim:g}", target.verdict, of_worst_town.verdict,
        ])  # fmt: skip
    head = ["item", *towns, "all", "must", "aim", "verdict: all", "worst town"]
    return _part("## Against the targets", table(head, rows, align="left"), TOWNS_DEFINITION)


def failures_markdown(failures: Sequence[Failure]) -> str:
    """A list of the failed sequences, each with the options that run it again."""
    lines = [
        f"- {one.condition}, start {one.start}: "
        + (f"{one.false_fixes} false fixes" if one.false_fixes else f"not localized within {WITHIN_M:g} m")
        + f"; again: `{one.options}`"
        for one in failures
    ]
    return _part("## Failures", lines or ["None."])


def _part(title: str, lines: Sequence[str], definition: str | None = None) -> str:
    """One part of the text: its title, its lines and, where there is one, the definition of its figures."""
    return "\n".join([title, "", *lines, "", *([definition, ""] if definition else [])])


def _cells(row: dict[str, Any]) -> list[str]:
    """The cells below ``FIGURES`` of one row's pooled figures."""
    return [
        NONE if row["success_share"] is None else f"{100 * row['success_share']:.0f} % of {row['judged']}",
        _figures(row, "error_mean_m", "error_p95_m", "worst_sequence_mean_m"),
        _figures(row, "localized_after_median_m", "localized_after_max_m"),
        _percent(row["off_map_share"]),
        _figures(row, "off_map_error_mean_m"),
        f"{row['false_sequences']} of {row['sequences']}",
        _percent(row["localized_share"]),
        _figures(row, "nees"),
    ]


def _errors(row: dict[str, Any], distance: str) -> list[str]:
    """The cells of one of the paper's lengths; ``distance`` names the figure that says after how many metres it was localized."""
    names = ("error_median_m", "error_mean_m", "error_p95_m", "off_map_error_mean_m", distance)
    return [NONE if row.get(name) is None else f"{row[name]:.2f}" for name in names]


def _figures(row: dict[str, Any], *names: str) -> str:
    """Figures of one row in one cell."""
    return " / ".join(NONE if row[name] is None else f"{row[name]:.2f}" for name in names)


def _percent(share: float | None) -> str:
    return NONE if share is None else f"{100 * share:.1f} %"
