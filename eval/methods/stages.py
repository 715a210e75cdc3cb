"""The stages of an evaluation, each alone and on files: map, refine, localize.

CPU times are this process's, around the algorithms only: decoding frames is the simulator's part.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Literal, Protocol, TypeVar

import numpy as np

from hippodrome.core import se2
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.mapping.mapper import Mapper, MapperConfig
from hippodrome.core.refinement.refine import RefineConfig, refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import (
    CognitiveMap,
    FloatArray,
    HippodromeError,
    LocalizationEstimate,
    Observation,
    Refinement,
    StartPose,
    Trajectory,
)
from hippodrome.eval.files.scenarios import located
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.network import read_network
from hippodrome.sim.recording import open_recording
from hippodrome.sim.scenario import Scenario, load_scenario

MapT_co = TypeVar("MapT_co", covariant=True)


@dataclass(frozen=True, slots=True)
class Localization:
    """Estimates after every observation, and the compute time that each step took."""

    estimates: list[LocalizationEstimate]
    step_s: FloatArray  # (N,) process CPU time


class MapBuilder(Protocol[MapT_co]):
    """What takes observations one by one and then has a map."""

    def step(self, observation: Observation, /) -> object: ...

    def finish(self) -> MapT_co: ...


def map_recording(observations: Iterable[Observation], config: MapperConfig) -> tuple[CognitiveMap, float]:
    """The semi-metric map and the CPU seconds that it took."""
    return built(Mapper(config), observations)


def built(builder: MapBuilder[MapT_co], observations: Iterable[Observation]) -> tuple[MapT_co, float]:
    """The builder's map and the CPU seconds that it took."""
    cpu_s = 0.0
    for observation in observations:
        began = process_time()
        builder.step(observation)
        cpu_s += process_time() - began
    began = process_time()
    finished = builder.finish()
    return finished, cpu_s + process_time() - began


def refine_map(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: RefineConfig, start: StartPose | None
) -> tuple[Refinement, float]:
    """The topometric map and the CPU seconds that it took."""
    began = process_time()
    refinement = refine(cognitive_map, network, config, start)
    return refinement, process_time() - began


def localize_recording(
    observations: Iterable[Observation], cognitive_map: CognitiveMap, network: RoadNetwork | None, config: LocalizerConfig
) -> Localization:
    """Localize a drive from an unknown start."""
    localizer, estimates, step_s = Localizer(cognitive_map, network, config), [], []
    for observation in observations:
        began = process_time()
        estimates.append(localizer.step(observation))
        step_s.append(process_time() - began)
    return Localization(estimates, np.array(step_s))


def dead_reckoning(observations: Iterable[Observation]) -> tuple[Trajectory, float]:
    """The self-motion integrated, in map units, and the CPU seconds of doing so."""
    sensed = np.array([(o.t_s, o.speed * o.dt_s, o.yaw_rate_radps * o.dt_s) for o in observations])
    began = process_time()
    half_turn = sensed[:, 2] / 2.0  # the chord of a short arc points half a turn ahead
    motions = np.stack([sensed[:, 1] * np.cos(half_turn), sensed[:, 1] * np.sin(half_turn), sensed[:, 2]], axis=1)
    poses = se2.integrate(np.zeros(3), motions)
    return Trajectory(sensed[:, 0], poses), process_time() - began


def map_files(recording: Path, scenario: Path | None, out: Path) -> None:
    """``hippodrome map``."""
    source = open_recording(recording)
    config = _settings(scenario).mapper
    cognitive_map, cpu_s = map_recording(source.observations(), config)
    size = save_map(out, cognitive_map, {"recording": recording.name, "mapper": repr(config)})
    duration_s = source.samples.t_s[-1]
    print(f"{out}: {len(cognitive_map.t_s)} vertices, {len(cognitive_map.edges.source)} edges, {size} bytes, "
          f"CPU {100 * cpu_s / duration_s:.2f} % of the drive's {duration_s:.0f} s")  # fmt: skip


def refine_files(
    source: Path, network: Path, mode: Literal["route", "paper"], start: StartPose | None, scenario: Path | None, out: Path
) -> None:
    """``hippodrome refine``."""
    if mode == "paper" and start is None:
        raise HippodromeError("mode 'paper' begins at a known pose: give --start X,Y,HEADING, or use --mode route")
    cognitive_map, provenance = load_map(source)
    config = replace(_settings(scenario).refine, mode=mode)
    refinement, cpu_s = refine_map(cognitive_map, read_network(located(network, "--network")), config, start)
    save_map(out, refinement.cognitive_map, {**provenance, "network": network.name, "refine": repr(config)})
    for stretch in refinement.breaks:
        print(f"vertices {stretch.first_vertex}-{stretch.last_vertex}: {stretch.status.name.lower()}: {stretch.cause}")
    print(f"{out}: {len(cognitive_map.t_s)} vertices refined in {cpu_s:.1f} s of CPU; "
          + ", ".join(f"{name} {value:.3g}" for name, value in refinement.estimates.items()))  # fmt: skip


def localize_files(source: Path, recording: Path, network: Path | None, scenario: Path | None, out: Path) -> None:
    """``hippodrome localize``."""
    cognitive_map, _ = load_map(source)
    if cognitive_map.frame != "network":
        raise HippodromeError(f"{source}: a semi-metric map has no metric frame to localize in; run `hippodrome refine` first")
    drive = open_recording(recording)
    roads = read_network(located(network, "--network")) if network else None
    run = localize_recording(drive.observations(), cognitive_map, roads, _settings(scenario).localizer)
    known = [estimate for estimate in run.estimates if estimate.localized]
    if known:
        write_tum(out, Trajectory(np.array([e.t_s for e in known]), np.stack([e.pose for e in known])))
    first = f"first at {known[0].t_s:.1f} s, written to {out}" if known else "never localized, nothing written"
    print(f"localized in {len(known)} of {len(run.estimates)} steps, {first}; {1e3 * run.step_s.mean():.3f} ms a step")


def _settings(scenario: Path | None) -> Scenario:
    return load_scenario(scenario) if scenario else Scenario(name="defaults")
