"""``hippodrome scenario preview``: both drives and a few frames, in seconds instead of the whole run."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hippodrome._native import give_back_memory
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, Frame, IntArray
from hippodrome.eval.authoring.network_notes import network_notes
from hippodrome.eval.pool import Workers, worker_pool
from hippodrome.sim.episode import Samples, draw_frame
from hippodrome.sim.network import edge_lengths_m
from hippodrome.sim.record import ROLES, RecordingPlan, Role, simulate
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.types import Drive, Town

STILLS = 3  # frames of each drive: one row of six shows town, light and traffic
LITTLE_OVERLAP = 0.9  # a note is given below this share of mapped roads: the second drive is meant to stay on the map


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """What a scenario's drives will be, without mapping them."""

    town: Town
    drives: dict[Role, Drive]
    samples: dict[Role, Samples]
    town_notes: tuple[str, ...]  # what is odd about the network, where, and what to do
    mapped_share: float  # share of the localization drive's edges, by length, that the mapping drive goes along too

    def lines(self) -> list[str]:
        """Statistics for the terminal, one line each."""
        return [
            _town_line(self.town),
            *(_drive_line(role, self.drives[role], self.samples[role]) for role in ROLES),
            f"localization drive on mapped roads, same direction: {self.mapped_share:.0%}",
            *(f"note: {note}" for note in self.notes()),
        ]

    def notes(self) -> list[str]:
        """What is odd about the network and the drives."""
        few = f"{1.0 - self.mapped_share:.0%} of the localization drive is on roads that the map will not have; " \
              "lengthen mapping.tour or shorten localization.tour"  # fmt: skip
        return [*self.town_notes, *([few] if self.mapped_share < LITTLE_OVERLAP else [])]


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """A drive, what is sensed on it, and what the camera sees here and there."""

    drive: Drive
    samples: Samples
    frames: list[Frame]
    captions: list[str]


def preview_scenario(scenario: Scenario, out: Path, require_gl: Callable[[], str]) -> Preview:
    """Simulate both drives, and draw ``overview.png`` and ``stills.png`` into ``out``.

    Args:
        scenario: What to drive.
        out: Folder for the pictures.
        require_gl: Raises where OpenGL does not work, and is asked when the town is there: what is wrong with that is said first.

    Raises:
        HippodromeError: The network cannot be used, or OpenGL does not work.
    """
    plans = [RecordingPlan(scenario, role, out) for role in ROLES]
    with _workers(scenario) as pool, ThreadPoolExecutor(1) as helper:
        if pool is None:
            helper.submit(_load_figures)
            town = plans[0].town()
            simulated = [simulate(plan, town) for plan in plans]
            require_gl()
            shown = [_with_stills(plan, town, *result) for plan, result in zip(plans, simulated, strict=True)]
        else:
            with suppress(BrokenProcessPool):  # a process that died is told when it is asked to drive
                for _ in plans:
                    pool.executor.submit(_load)  # what the processes need, while the town is read
            town, network = plans[0].town(), str(scenario.town.network)
            require_gl()
            helper.submit(_load_figures)
            tasks = [(plan, town) for plan in plans]
            shown = pool.run("simulate and draw", _simulate_and_draw, tasks, place=lambda _: network)
    return _drawn(scenario, town, dict(zip(ROLES, shown, strict=True)), out)


def _drawn(scenario: Scenario, town: Town, shown: dict[Role, _Shown], out: Path) -> Preview:
    """Draw both pictures."""
    from hippodrome.eval.figures.frames import draw_contact_sheet  # see _load_figures
    from hippodrome.eval.figures.preview import draw_preview

    drives = {role: one.drive for role, one in shown.items()}
    mapping, second = drives["mapping"], drives["localization"]
    draw_preview(out / "overview.png", town.network, mapping.poses_m, visits_of_road(town.network, mapping.lane),
                 second.poses_m, f"{scenario.name}: the two drives")  # fmt: skip
    frames, captions = ([one for part in shown.values() for one in getattr(part, name)] for name in ("frames", "captions"))
    draw_contact_sheet(out / "stills.png", frames, captions, title=f"{scenario.name}: stills of the mapping and the second drive")
    samples = {role: one.samples for role, one in shown.items()}
    return Preview(town, drives, samples, network_notes(scenario, town), mapped_share(town.network, mapping, second))


def _workers(scenario: Scenario) -> AbstractContextManager[Workers | None]:
    """A process for each drive on somebody's network: SUMO crashes on some. Generated towns need none."""
    return nullcontext() if scenario.town.network is None else worker_pool(len(ROLES))


def _load() -> None:
    import hippodrome.sim.ego  # noqa: F401  # takes seconds; OpenGL is loaded when SUMO has gone, since both need memory


def _load_figures() -> None:
    """Matplotlib takes a second to load, and is needed at the end only; the processes of the drives never need it."""
    import hippodrome.eval.figures.frames
    import hippodrome.eval.figures.preview  # noqa: F401


def _simulate_and_draw(task: tuple[RecordingPlan, Town]) -> _Shown:
    """One task and not two: the shorter drive need not wait for the longer one, nor the town be sent again."""
    plan, town = task
    drive, samples = simulate(plan, town)
    give_back_memory()  # what SUMO held of a large network
    return _with_stills(plan, town, drive, samples)


def visits_of_road(network: RoadNetwork, lane: IntArray) -> IntArray:
    """How often (N,) the edge under each sample is entered during the whole drive; 1 inside junctions, which are shared."""
    edge = network.lane_edge[lane]
    entered = np.concatenate([[True], edge[1:] != edge[:-1]])
    times = np.bincount(edge[entered], minlength=len(network.edge_ids))
    return np.where(network.is_internal[lane], 1, times[edge]).astype(np.int32)


def mapped_share(network: RoadNetwork, mapping: Drive, second: Drive) -> float:
    """Share of the second drive's edges, by length and without junctions, that the mapping drive goes along too."""
    lengths_m = edge_lengths_m(network)
    known, wanted = (np.unique(network.lane_edge[drive.lane[~network.is_internal[drive.lane]]]) for drive in (mapping, second))
    return float(lengths_m[np.intersect1d(known, wanted)].sum() / lengths_m[wanted].sum())


def _with_stills(plan: RecordingPlan, town: Town, drive: Drive, samples: Samples) -> _Shown:
    """``STILLS`` frames of a drive, spread evenly over it, and their captions."""
    from hippodrome.sim.render.renderer import FrameRenderer  # after require_gl, which names what is missing

    conditions, camera = plan.drive_spec.conditions, plan.scenario.camera
    numbers = np.linspace(0, len(samples.frame_steps) - 1, 2 * STILLS + 1).astype(int)[1::2]  # not where a drive begins
    views_m = samples.poses_m[samples.frame_steps[numbers]]
    half_view_rad = float(np.radians(0.5 * camera.fov_deg + abs(camera.yaw_offset_deg)))
    scene = build_scene(town, plan.scenario.seed, conditions, views_m, half_view_rad)  # of a large town only what they show
    with FrameRenderer(scene, camera) as renderer:
        frames = [draw_frame(renderer, drive, samples, number, conditions, plan.seed)[0] for number in numbers.tolist()]
    captions = [f"{plan.role}, {samples.t_s[samples.frame_steps[number]]:.0f} s" for number in numbers]
    return _Shown(drive, samples, frames, captions)


def _town_line(town: Town) -> str:
    roads = edge_lengths_m(town.network)
    return f"{town.name}: {np.count_nonzero(roads)} edges, {roads.sum() / 1e3:.2f} km of directed road, " \
           f"{len(town.junction_polygons_m)} junctions, {'left' if town.left_hand else 'right'}-hand traffic"  # fmt: skip


def _drive_line(role: Role, drive: Drive, samples: Samples) -> str:
    return f"{role}: {_length_m(drive.poses_m):.0f} m in {drive.t_s[-1]:.0f} s, {len(samples.frame_steps)} frames, " \
           f"{drive.coverage:.0%} of the drivable roads seen, {drive.revisit_share:.0%} driven before"  # fmt: skip


def _length_m(poses_m: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(poses_m[:, :2], axis=0), axis=1).sum())
