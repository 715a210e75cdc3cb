"""One scenario from its two recordings to its rows, maps, trajectories and figures: the story of an evaluation.

The first drive is mapped by every method that takes part, and the second is localized in their maps: ours, those that the
scenario names, and those of the command line, all by way of ``contest/perform.py``. Everything is scored against ground truth,
which no method is given. What our own methods do is in ``methods/ours.py``, where ``Mapper``, ``refine`` and ``Localizer`` of
``core`` are called.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hippodrome.eval.contest.entry import entries_of
from hippodrome.eval.contest.perform import drawn_methods, perform
from hippodrome.eval.figures.scenario import draw_scenario
from hippodrome.eval.methods.materials import gather
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.methods.needs import has_frames
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.report.belief import write_second_drive
from hippodrome.eval.report.evidence import write_map_evidence
from hippodrome.eval.report.why import write_why
from hippodrome.eval.results.evidence import write_trajectories
from hippodrome.eval.results.model import ScenarioResult
from hippodrome.eval.results.scenario import scenario_result
from hippodrome.sim.scenario import Scenario


@dataclass(frozen=True, slots=True)
class EvaluationTask:
    """A scenario whose recordings are finished, below ``out``."""

    scenario: Scenario
    out: Path
    figures: bool = True  # drawing takes most of a short scenario's time, so sweeps of many do without


def evaluate_scenario(task: EvaluationTask) -> ScenarioResult:
    """Let every method map and localize; score, write and draw. All files go to ``out/<scenario name>``.

    A method that fails has a row that says why; the other methods go on.

    Raises:
        HippodromeError: A method cannot be loaded; or there are only ours, and no semi-metric map can be made of the drive.
    """
    warm_up()
    materials = gather(task.scenario, task.out, truthless=True)
    performance = perform(materials, entries_of(task.scenario))
    shown = drawn_methods(performance.outcomes)
    scored = {outcome.method: outcome.scored for outcome in shown}
    localized = {outcome.method: outcome for outcome in shown if outcome.localized is not None}
    write_trajectories(materials, [*performance.outcomes, *performance.unscored])
    if performance.unscored or not (has_frames(materials.mapping) and has_frames(materials.drive)):
        return scenario_result(materials, performance.rows, performance.outcomes)  # the pictures show frames and errors
    write_map_evidence(materials, scored, localized)
    as_printed = write_second_drive(materials, localized)
    write_why(materials.folder, localized, materials.roads)
    if task.figures:
        semi_metric = next((one.mapped.cognitive_map for one in performance.outcomes if one.method == SEMI_METRIC), None)
        draw_scenario(materials, semi_metric, scored, localized)
    return scenario_result(materials, performance.rows, performance.outcomes, as_printed)
