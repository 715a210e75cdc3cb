"""The figures of ``hippodrome eval`` once more with the tracker in them, and localization of all in one (Figs. 3 and 4)."""

from __future__ import annotations

from collections.abc import Sequence

from hippodrome.core.types import Trajectory
from hippodrome.eval.evaluate import DEAD_RECKONING, MODES, SEMI_METRIC
from hippodrome.eval.figures.localization import draw_localization_comparison
from hippodrome.eval.figures.maps import draw_error_map
from hippodrome.eval.figures.scenario import draw_methods, placed
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.materials import (
    RPE_DELTA_M,
    Materials,
    Scored,
    file_stem,
    score_trajectory,
)
from hippodrome.eval.metrics.trajectory import ape, rpe
from hippodrome.eval.report.evidence import add_layers
from hippodrome.eval.rivals.orbslam3.rows import FINAL, LIVE, tum_path
from hippodrome.eval.rivals.orbslam3.stage import Tracked
from hippodrome.eval.rivals.orbslam3.tracker import Run
from hippodrome.eval.rivals.rows import RATSLAM
from hippodrome.eval.rivals.sequences import Located


def draw_comparison(materials: Materials, tracked: Tracked) -> None:
    """Maps, errors and violins of all methods; the tracker's error on the map, and its layers in the report's map."""
    if tracked.live is None or tracked.final is None:
        return  # what `hippodrome eval` drew is all there is
    truth = materials.mapping.ground_truth()
    theirs = _tracker_scores(tracked.live, tracked.final, truth)
    draw_methods(materials, {**_our_scores(materials, truth), **theirs})
    add_layers(materials.folder, theirs, truth)
    path, name = materials.folder / f"{file_stem(FINAL)}-ape.png", materials.scenario.name
    final = theirs[FINAL]
    draw_error_map(path, materials.roads, placed(final, truth), final.ape.errors_m, f"{name}: {FINAL}, APE on the map")


def draw_sequences(materials: Materials, found: Sequence[Located]) -> None:
    """Localization error over time on the longest sequence that every method has figures for."""
    scores = {(one.row.method, one.row.number): one.score for one in found if one.score is not None}
    methods = list(dict.fromkeys(one.row.method for one in found))
    whole = [one.row for one in found if all((method, one.row.number) in scores for method in methods)]
    if not whole:
        return
    row = max(whole, key=lambda one: one.length_m)
    title = f"{materials.scenario.name}: localization from an unknown start, sequence {row.number}, {row.length_m:g} m"
    shown = {method: scores[method, row.number] for method in methods}
    draw_localization_comparison(materials.folder / "localization-methods.png", shown, title)


def _our_scores(materials: Materials, truth: Trajectory) -> dict[str, Scored]:
    """Of the trajectories that the evaluation wrote."""
    paths = {m: materials.folder / f"{file_stem(m)}.tum" for m in (DEAD_RECKONING, SEMI_METRIC, RATSLAM, *dict(MODES))}
    found = {method: read_tum(path) for method, path in paths.items() if path.exists()}
    return {method: score_trajectory(one, truth, metric=method in dict(MODES)) for method, one in found.items()}


def _tracker_scores(live: Run, final: Run, truth: Trajectory) -> dict[str, Scored]:
    """Of the runs that its rows show, aligned as there."""
    found = {LIVE: read_tum(tum_path(live, "live")), FINAL: read_tum(tum_path(final, "final"))}
    return {
        method: Scored(one, "se2", ape(one, truth, "se2"), rpe(one, truth), rpe(one, truth, RPE_DELTA_M))
        for method, one in found.items()
    }
