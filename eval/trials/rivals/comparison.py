"""The figures of ``hippodrome eval`` once more with ORB-SLAM3 in them, and all localization errors in one (Figs. 3 and 4)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hippodrome.core.types import Trajectory
from hippodrome.eval.figures.localization import draw_localization_comparison
from hippodrome.eval.figures.maps import draw_error_map
from hippodrome.eval.figures.scenario import draw_methods, placed
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.materials import Materials, ScoredTrajectory, score_trajectory
from hippodrome.eval.methods.method import (
    DEAD_RECKONING,
    ORBSLAM3_FINAL,
    ORBSLAM3_LIVE,
    RATSLAM,
    REFINED,
    SEMI_METRIC,
    Method,
)
from hippodrome.eval.report.evidence import add_layers
from hippodrome.eval.results.table_two import LocalizedSequence
from hippodrome.eval.trials.rivals.spread import tum_path
from hippodrome.eval.trials.rivals.stage import Tracked

OF_THE_EVALUATION: Final = (DEAD_RECKONING, SEMI_METRIC, RATSLAM, *REFINED)  # in the order of its figures


def draw_comparison(materials: Materials, tracked: Tracked) -> None:
    """Draw maps, errors and violins with ORB-SLAM3 in them, and its error on the map; add it to the report's map.

    Without a run of it that ended well, nothing is drawn: the figures of ``hippodrome eval`` are all there is.

    Args:
        materials: What was evaluated. Trajectories are read from its folder, and figures go there.
        tracked: ORB-SLAM3 on the mapping drive.
    """
    if tracked.live is None or tracked.final is None:
        return
    truth = materials.mapping.ground_truth()
    theirs = _scored({ORBSLAM3_LIVE: tum_path(tracked.live, "live"), ORBSLAM3_FINAL: tum_path(tracked.final, "final")}, truth)
    paths = {method: materials.folder / f"{method.stem}.tum" for method in OF_THE_EVALUATION}
    ours = _scored({method: path for method, path in paths.items() if path.exists()}, truth)
    draw_methods(materials, {**ours, **theirs})
    add_layers(materials.folder, theirs, truth)
    final, label = theirs[ORBSLAM3_FINAL], ORBSLAM3_FINAL.label
    path, title = materials.folder / f"{ORBSLAM3_FINAL.stem}-ape.png", f"{materials.scenario.name}: {label}, APE on the map"
    draw_error_map(path, materials.roads, placed(final, truth), final.ape.errors_m, title)


def draw_sequences(materials: Materials, found: Sequence[LocalizedSequence]) -> None:
    """Draw the localization error over time on the longest sequence that every method has figures for.

    Args:
        materials: What was evaluated; the figure goes to its folder.
        found: All sequences of all methods.
    """
    scores = {(one.row.method, one.row.number): one.score for one in found if one.score is not None}
    labels = list(dict.fromkeys(one.row.method for one in found))
    whole = [one.row for one in found if all((label, one.row.number) in scores for label in labels)]
    if not whole:
        return
    row = max(whole, key=lambda one: one.length_m)
    title = f"{materials.scenario.name}: localization from an unknown start, sequence {row.number}, {row.length_m:g} m"
    shown = {label: scores[label, row.number] for label in labels}
    order = [method.label for method in OF_THE_EVALUATION]  # so that a method has the colour that it has on the maps
    draw_localization_comparison(materials.folder / "localization-methods.png", shown, title, order)


def _scored(paths: dict[Method, Path], truth: Trajectory) -> dict[Method, ScoredTrajectory]:
    """Trajectories in files, scored as the rows of their methods are."""
    return {method: score_trajectory(read_tum(path), truth, method.alignment) for method, path in paths.items()}
