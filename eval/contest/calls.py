"""The calls of a method: its map of a first drive, and a second drive, or a stretch of one, localized in that map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from time import process_time

import numpy as np

from hippodrome._native import give_back_memory
from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, Observation, StartPose, Trajectory
from hippodrome.eval.contest.answers import sound_cost, sound_estimates, sound_map
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.guard import guarded
from hippodrome.eval.methods.feed import Feed
from hippodrome.eval.methods.materials import Materials, true_start, truth_of
from hippodrome.eval.methods.memory import Growth
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.methods.needs import camera_of, has_frames, is_foreign, metres_per_unit, require_met
from hippodrome.eval.methods.protocol import (
    Cost,
    Given,
    Localized,
    Localizing,
    Mapped,
    Maps,
    MethodError,
    as_answers,
    as_estimate,
    as_mapped,
)
from hippodrome.eval.methods.sequences import observations_of, stereo_observations_of
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.alignment import Transform, apply_to_trajectory, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.proto.codec import save_map
from hippodrome.sim.recording import Recording


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The map that a method made of the first drive, and what that took."""

    mapped: Mapped
    cpu_s: float  # of its map alone
    whole_s: float  # with the map that it builds on
    step_s: FloatArray  # of each observation; of the map that it builds on, if it sees none
    map_bytes: int | None
    peak_rss_bytes: int | None = None


def draw_all(materials: Materials, entries: Sequence[Entry], folders: Mapping[str, Path]) -> dict[str, Drawn | str]:
    """The map that each method made of the mapping drive, or why it has none, by the method's key. Maps go to files.

    Raises:
        HippodromeError: There is no semi-metric map, and no method beside ours.
    """
    drawn: dict[str, Drawn | str] = {}
    for entry in _bases_first(entries):
        if entry.does == ("describe",):
            continue
        try:
            drawn[entry.method.key] = _draw(entry, materials, drawn, folders[entry.method.key])
        except HippodromeError as error:
            if entry.method == SEMI_METRIC and all(other.source == "hippodrome" for other in entries):
                raise
            drawn[entry.method.key] = str(error)
    return drawn


def localize(
    entry: Entry, materials: Materials, mapped: Mapped, folder: Path, drive: Recording, stretch: tuple[int, int] | None = None
) -> Localization:
    """A drive localized in a method's map, from an unknown start.

    Args:
        entry: The method.
        materials: The scenario's.
        mapped: What the method made of the mapping drive.
        folder: The method's own.
        drive: The drive that is localized; what its manifest says of its camera counts.
        stretch: Its steps [first, end); None: all of them.

    Raises:
        HippodromeError: It fails, or does not answer every observation.
    """
    label = entry.method.label
    given = replace(_given(entry, materials, drive, folder, None), mapped=mapped)
    first, end = stretch or (0, len(drive.samples.t_s))
    placed = _placement(entry, materials, mapped)
    feed = Feed(_observations(entry, drive, stretch))
    estimates, cost = guarded(label, lambda: estimates_of(label, entry.runner.localize(iter(feed), given)), materials)
    feed.settle()
    if entry.source != "hippodrome":
        estimates, cost = sound_estimates(estimates, label), sound_cost(cost, label)
    estimates = estimates if placed is None else [_moved(estimate, placed) for estimate in estimates]
    times_s = drive.samples.t_s[first:end]
    if len(estimates) != len(times_s):
        raise MethodError(f"{len(estimates)} answers to {len(times_s)} observations; one for each is expected, in their order")
    if not np.allclose([estimate.t_s for estimate in estimates], times_s, rtol=0.0, atol=1e-6):
        raise MethodError("its answers have other times than the observations; answer each with its own t_s")
    if cost is None:
        return Localization(estimates, feed.step_cpu_s)
    step_s = cost.step_cpu_s if cost.step_cpu_s is not None else cost.step_s
    return Localization(estimates, np.full(len(times_s), cost.cpu_s / len(times_s)) if step_s is None else step_s)


def _placement(entry: Entry, materials: Materials, mapped: Mapped) -> Transform | None:
    """What takes the answers of a method with a metric frame of its own to the network's; None for the others.

    Its map lies there where the best rigid fit of its own trajectory of the mapping drive puts it.
    """
    if entry.method.frame != "metric" or entry.builds_on is not None:
        return None
    if (truth := truth_of(materials.mapping)) is None:
        raise MethodError(
            "its answers lie in a frame of its own, and only the truth of the mapping drive lays that on the network"
        )
    pairs = associate(mapped.trajectory, truth)
    return find_alignment("se2", pairs.estimate, pairs.reference)


def _moved(estimate: LocalizationEstimate, placed: Transform) -> LocalizationEstimate:
    """An answer in the network's frame."""
    covariance = estimate.covariance.copy()
    covariance[:2] = placed.rotation @ covariance[:2]
    covariance[:, :2] = covariance[:, :2] @ placed.rotation.T
    pose = apply_to_trajectory(placed, Trajectory(np.array([estimate.t_s]), estimate.pose[None])).poses[0]
    return replace(estimate, pose=pose, covariance=covariance)


def _bases_first(entries: Sequence[Entry]) -> list[Entry]:
    """The entries, those that others build on before these. A method that builds on itself comes last, and fails there."""
    by_key = {entry.method.key: entry for entry in entries}

    def depth(entry: Entry) -> int:
        found, steps = entry, 0
        while found.builds_on is not None and steps <= len(entries):
            found, steps = by_key[found.builds_on], steps + 1
        return steps

    return sorted(entries, key=depth)


def _draw(entry: Entry, materials: Materials, drawn: Mapping[str, Drawn | str], folder: Path) -> Drawn:
    """The method's map of the first drive. Raises HippodromeError if there is none."""
    label, base = entry.method.label, None
    if entry.builds_on is not None:
        found = drawn.get(entry.builds_on, "it was not run")
        if isinstance(found, str):
            raise MethodError(f"builds on {entry.builds_on}, which failed: {found}")
        base = found
    if not isinstance(entry.runner, Maps):
        if base is None:
            raise MethodError("it makes no map, and builds on none")
        return replace(base, cpu_s=0.0, whole_s=base.whole_s, step_s=np.zeros(0), map_bytes=None)
    given = _given(entry, materials, materials.mapping, folder, base.mapped if base else None)
    if (warm_up := getattr(entry.runner, "warm_up", None)) is not None:
        guarded(label, warm_up, materials)
    feed, growth = Feed(_observations(entry, materials.mapping, None)), Growth()
    began = process_time()
    mapped = guarded(label, lambda: as_mapped(entry.runner.map(iter(feed), given), label), materials)
    cpu_s = process_time() - began - feed.decoding_s
    feed.settle()
    mapped = sound_map(mapped, label)
    peak_rss_bytes = growth.as_if_alone_bytes() if mapped.cost is None else mapped.cost.peak_rss_bytes
    give_back_memory()
    if mapped.cost is None and base is not None and peak_rss_bytes is not None:
        peak_rss_bytes = max(peak_rss_bytes, base.peak_rss_bytes or 0)
    map_bytes = guarded(label, lambda: _save(entry, mapped, materials), materials)
    step_s = feed.step_s
    if (cost := mapped.cost) is not None:
        cpu_s, step_s = cost.cpu_s, np.zeros(0) if cost.step_s is None else cost.step_s
    step_s = base.step_s if base is not None and len(step_s) == 0 else step_s
    return Drawn(mapped, cpu_s, cpu_s + (base.whole_s if base else 0.0), step_s, map_bytes, peak_rss_bytes)


def _save(entry: Entry, mapped: Mapped, materials: Materials) -> int | None:
    """Write the map into the scenario's folder; its size in bytes, or None if the method keeps no map."""
    if entry.method.map_file is None:
        return None
    path = entry.method.map_path(materials.folder)
    if mapped.save is not None:
        return mapped.save(path)
    if mapped.cognitive_map is not None:
        return save_map(path, mapped.cognitive_map, materials.provenance(entry.method))
    return None


def _given(entry: Entry, materials: Materials, drive: Recording, folder: Path, base: Mapped | None) -> Given:
    scenario, needs = materials.scenario, entry.needs
    require_met(needs, scenario, drive)
    return Given(
        camera=camera_of(scenario, drive),
        rate_hz=1.0 / float(np.median(drive.samples.dt_s)) if is_foreign(drive) else scenario.odometry_rate_hz,
        duration_s=float(drive.samples.t_s[-1]),
        seed=scenario.seed,
        folder=folder,
        roads=materials.roads if needs.road_network else None,
        start=_start(drive) if needs.start_pose and drive is materials.mapping else None,
        metres_per_unit=metres_per_unit(scenario, drive) if needs.metric_scale else None,
        frames=has_frames(drive),
        base=base,
        concealed=tuple(folder for folder in materials.truth_folders if folder.is_dir()),
    )


def _start(drive: Recording) -> StartPose:
    if truth_of(drive) is None:
        raise MethodError("it needs the start pose, and nobody knows where a drive without truth began; import it with --truth")
    return true_start(drive)


def _observations(entry: Entry, drive: Recording, stretch: tuple[int, int] | None) -> Iterator[Observation]:
    """What the method is handed of a drive, or of its steps [first, end)."""
    if entry.needs.stereo:
        return stereo_observations_of(drive, *(stretch or (0, len(drive.samples.t_s))))
    if stretch is None:
        return drive.observations() if entry.needs.camera else drive.self_motion()
    return observations_of(drive, *stretch) if entry.needs.camera else islice(drive.self_motion(), *stretch)


def estimates_of(label: str, answers: Localizing) -> tuple[list[LocalizationEstimate], Cost | None]:
    """What ``localize`` gave, answer by answer; a method that yields them does its work here."""
    estimates = [as_estimate(answer, label) for answer in as_answers(answers, label)]
    return estimates, answers.cost if isinstance(answers, Localized) else None
