"""The pictures of one scenario, below its folder."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hippodrome.core.types import CognitiveMap, FloatArray, Frame, Trajectory
from hippodrome.eval.figures.errors import draw_error_profiles, draw_error_violins
from hippodrome.eval.figures.frames import draw_contact_sheet
from hippodrome.eval.figures.localization import draw_localization_error, draw_localization_strip, strip_steps
from hippodrome.eval.figures.maps import draw_cognitive_map, draw_error_map, draw_maps_over_truth
from hippodrome.eval.methods.materials import Materials, Outcome, ScoredTrajectory
from hippodrome.eval.methods.method import Method
from hippodrome.eval.metrics.alignment import apply_to_positions, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.sim.recording import Recording

CONTACT_FRAMES = 24  # in four rows of six: enough frames to see the town, large enough to see what is in them


def draw_scenario(
    materials: Materials,
    semi_metric: CognitiveMap | None,
    scored: Mapping[Method, ScoredTrajectory],
    localized: Mapping[Method, Outcome],
) -> None:
    """Draw all pictures of an evaluation: frames, maps, errors along the drive, localization.

    Args:
        materials: What was evaluated.
        semi_metric: The semi-metric map, if there is one.
        scored: Trajectories and errors of the methods that are shown.
        localized: The methods that localized the second drive.
    """
    folder, name = materials.folder, materials.scenario.name
    frames, captions = _contact_sheet(materials.mapping)
    draw_contact_sheet(folder / "frames.png", frames, captions, title=f"{name}: the mapping drive as the camera sees it")
    if semi_metric is not None:
        draw_cognitive_map(folder / "semi-metric-map.png", semi_metric, f"{name}: semi-metric map, as built")
    draw_methods(materials, scored)
    for method, outcome in localized.items():
        _draw_localized(materials, method, outcome)
    if with_networks := [outcome for outcome in localized.values() if _has_networks(outcome)]:
        _draw_neurodynamics(materials, with_networks[-1])


def draw_methods(materials: Materials, scored: Mapping[Method, ScoredTrajectory]) -> None:
    """Draw methods beside one another: errors along the drive, their distribution, maps over ground truth."""
    folder, name, truth = materials.folder, materials.scenario.name, materials.mapping.ground_truth()
    absolute, relative = ({method.label: getattr(one, field) for method, one in scored.items()} for field in ("ape", "rpe"))
    draw_error_profiles(folder / "errors.png", absolute, relative, f"{name}: errors along the drive")
    draw_error_violins(folder / "violins.png", absolute, relative, f"{name}: distribution of errors")
    maps_m = {method.label: placed(one, truth) for method, one in scored.items()}
    draw_maps_over_truth(folder / "maps.png", materials.roads, truth.poses, maps_m, f"{name}: maps over ground truth")


def placed(one: ScoredTrajectory, truth: Trajectory) -> FloatArray:
    """Positions (V, 2) of a trajectory in the network's frame, placed as they were for its APE."""
    pairs = associate(one.trajectory, truth)
    transform = find_alignment(one.alignment, pairs.estimate, pairs.reference)
    return apply_to_positions(transform, one.trajectory.poses[:, :2])


def _draw_localized(materials: Materials, method: Method, outcome: Outcome) -> None:
    """APE on the map, and the second drive's error."""
    name, folder = materials.scenario.name, materials.folder
    scored, localized = outcome.scored, outcome.localized
    assert localized is not None
    placed_m = scored.trajectory.poses if method.frame == "network" else placed(scored, materials.mapping.ground_truth())
    draw_error_map(folder / f"{method.stem}-ape.png", materials.roads, placed_m, scored.ape.errors_m,
                   f"{name}: {method.label}, APE on the map")  # fmt: skip
    draw_localization_error(folder / f"{method.stem}-localization.png", localized.t_s, localized.errors_m,
                            localized.localized, f"{name}: localization in the map '{method.label}'")  # fmt: skip


def _has_networks(outcome: Outcome) -> bool:
    """Whether the localizer's answers show the states of grid cells, as ours do."""
    return outcome.localization is not None and all(len(one.grid_phase_rad) for one in outcome.localization.estimates)


def _draw_neurodynamics(materials: Materials, outcome: Outcome) -> None:
    """Frames, grid cells, head direction and error while the estimate settles (the paper's Fig. 4 A-D)."""
    assert outcome.localization is not None
    assert outcome.localized is not None
    name, path, localized = materials.scenario.name, materials.folder / "neurodynamics.png", outcome.localized
    samples = materials.drive.samples
    steps = samples.frame_steps[strip_steps(samples.t_s[samples.frame_steps])]
    frames = [materials.drive.frame(int(samples.frame[step])) for step in steps]
    shown = [outcome.localization.estimates[step] for step in steps]
    draw_localization_strip(path, frames, shown, localized.t_s, localized.errors_m,
                            title=f"{name}: localization in the map '{outcome.method.label}' from an unknown start")  # fmt: skip


def _contact_sheet(recording: Recording) -> tuple[list[Frame], list[str]]:
    numbers = np.unique(np.linspace(0, recording.frame_count - 1, CONTACT_FRAMES).astype(int))
    times_s = recording.samples.t_s[recording.samples.frame_steps[numbers]]
    return [recording.frame(int(number)) for number in numbers], [f"{t_s:.0f} s" for t_s in times_s]
