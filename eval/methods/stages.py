"""The stages of an evaluation, each alone: map, refine, localize. The first half times them, the second runs them on files.

Times are CPU seconds of this process, around the algorithms only: decoding frames is the simulator's part and is not counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import ParamSpec, Protocol, TypeVar

import numpy as np

from hippodrome.core import se2
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import (
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
from hippodrome.eval.methods.beforehand import UNITS, Beforehand, informed
from hippodrome.eval.methods.method import RefineMode
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.geo_start import GeoStart
from hippodrome.sim.georeference import GeoReferenceError, is_georeferenced, placed_start, read_georeference
from hippodrome.sim.map_import import sumo_network
from hippodrome.sim.network import junction_gaps, read_network
from hippodrome.sim.recording import open_recording
from hippodrome.sim.scenario import Scenario, load_scenario

FARTHEST_START_M = 1_000.0  # from the nearest road; a car park or a yard is nearer
FARTHEST_DEGREES_M = 100_000.0  # metres that are read as degrees lie so near to a network by chance in one of its square metres
MapT_co = TypeVar("MapT_co", covariant=True)
ResultT = TypeVar("ResultT")
ArgumentsP = ParamSpec("ArgumentsP")


class MapBuilder(Protocol[MapT_co]):
    """What takes observations one by one and then has a map: the mapper, and its rivals."""

    def step(self, observation: Observation, /) -> object: ...

    def finish(self) -> MapT_co: ...


@dataclass(frozen=True, slots=True)
class Localization:
    """The localizer's estimates, one after every observation, and the CPU time that each step took."""

    estimates: list[LocalizationEstimate]
    step_s: FloatArray  # (N,)

    def declared(self) -> Trajectory | None:
        """The poses of the steps that the localizer declared localized; None if there are none."""
        known = [estimate for estimate in self.estimates if estimate.localized]
        if not known:
            return None
        return Trajectory(np.array([e.t_s for e in known]), np.stack([e.pose for e in known]))


def map_recording(observations: Iterable[Observation], builder: MapBuilder[MapT_co]) -> tuple[MapT_co, float]:
    """The map that ``builder`` makes of a drive, and the CPU seconds that it took."""
    cpu_s = 0.0
    for observation in observations:
        began = process_time()
        builder.step(observation)
        cpu_s += process_time() - began
    finished, finishing_s = timed(builder.finish)
    return finished, cpu_s + finishing_s


def localize_recording(observations: Iterable[Observation], localizer: Localizer) -> Localization:
    """Localize a drive from an unknown start, with a ``localizer`` that has seen nothing yet."""
    estimates, step_s = [], []
    for observation in observations:
        began = process_time()
        estimates.append(localizer.step(observation))
        step_s.append(process_time() - began)
    return Localization(estimates, np.array(step_s))


def timed(
    function: Callable[ArgumentsP, ResultT], *arguments: ArgumentsP.args, **named: ArgumentsP.kwargs
) -> tuple[ResultT, float]:
    """What a call returns, and the CPU seconds that it took."""
    began = process_time()
    result = function(*arguments, **named)
    return result, process_time() - began


def dead_reckoning(observations: Iterable[Observation]) -> tuple[Trajectory, float]:
    """The self-motion of a drive integrated from the origin on, in map units, and the CPU seconds that it took."""
    sensed = np.array([(o.t_s, o.speed * o.dt_s, o.yaw_rate_radps * o.dt_s) for o in observations])
    began = process_time()
    half_turn = sensed[:, 2] / 2.0  # a step is a short arc; its chord is turned by half of the arc's angle
    motions = np.stack([sensed[:, 1] * np.cos(half_turn), sensed[:, 1] * np.sin(half_turn), sensed[:, 2]], axis=1)
    poses = se2.integrate(np.zeros(3), motions)
    return Trajectory(sensed[:, 0], poses), process_time() - began


def map_files(recording: Path, scenario: Path | None, out: Path) -> None:
    """``hippodrome map``: build the semi-metric map of a recording and save it. Raises HippodromeError on bad input."""
    source = open_recording(recording)
    config = _settings(scenario).mapper
    mapper = Mapper(config) if source.frame_count else MotionMapper(config)
    cognitive_map, cpu_s = map_recording(source.observations(), mapper)
    unit = {UNITS: str(source.manifest[UNITS])} if UNITS in source.manifest else {}
    size = save_map(out, cognitive_map, {"recording": recording.name, "mapper": repr(config), **unit})
    duration_s = source.samples.t_s[-1]
    print(f"{out}: {len(cognitive_map.t_s)} vertices, {len(cognitive_map.edges.source)} edges, {size} bytes, "
          f"CPU {100 * cpu_s / duration_s:.2f} % of the drive's {duration_s:.0f} s")  # fmt: skip


def refine_files(
    source: Path,
    network: Path,
    mode: RefineMode,
    start: StartPose | GeoStart | None,
    scenario: Path | None,
    out: Path,
    known: Beforehand | None = None,
) -> Refinement:
    """``hippodrome refine``: refine a semi-metric map with a road network. Raises HippodromeError on bad input.

    Args:
        source: The semi-metric map.
        network: A SUMO network, ``package:...`` of one that is installed, or a map that is converted and kept beside ``out``.
        mode: Mode of the refinement.
        start: Where the mapping drive began, in the network's frame or on Earth; mode ``paper`` needs it.
        scenario: Where the refinement's settings are from; None takes the defaults.
        out: The topometric map.
        known: Unit of the odometry and accuracy of the network, where they are known.
    """
    if mode == "paper" and start is None:
        raise HippodromeError("mode 'paper' begins at a known pose: give --start X,Y,HEADING, or use --mode route")
    cognitive_map, provenance = load_map(source)
    config, lines = informed(replace(_settings(scenario).refine, mode=mode), known or Beforehand(), provenance)
    for line in lines:
        print(line)
    net_file = network_file(network, out.parent)
    known_start = placed_start(start, net_file, mode)
    roads = _read_lanes(net_file)
    if isinstance(start, StartPose):
        _require_metres(start, roads, net_file)
    if known_start is not None:
        _require_start_near(known_start, roads, net_file)
    refinement, cpu_s = timed(refine, cognitive_map, roads, config, known_start)
    if not np.isfinite(refinement.cognitive_map.poses).all():
        raise HippodromeError(
            f"{source}: {len(cognitive_map.t_s)} vertices, too few or without any turn, cannot be laid on roads; drive farther, "
            "some 100 m and a corner"
        )
    save_map(out, refinement.cognitive_map, {**provenance, "network": network.name, "refine": repr(config)})
    for stretch in refinement.breaks:
        print(f"vertices {stretch.first_vertex}-{stretch.last_vertex}: {stretch.status.name.lower()}: {stretch.cause}")
    print(f"{out}: {len(cognitive_map.t_s)} vertices refined in {cpu_s:.1f} s of CPU; "
          + ", ".join(f"{name} {value:.3g}" for name, value in refinement.estimates.items()))  # fmt: skip
    if (warning := refusal_note(refinement.cognitive_map)) is not None:
        print(f"{out}: {warning}")
    return refinement


def _require_metres(start: StartPose, roads: RoadNetwork, net_file: Path) -> None:
    """Raise HippodromeError if x and y of a start are the latitude and longitude of a place about the network."""
    if abs(start.x_m) > 90.0 or abs(start.y_m) > 180.0 or not is_georeferenced(net_file):
        return
    try:
        place_m = read_georeference(net_file).to_network(np.array([start.x_m]), np.array([start.y_m]))
    except GeoReferenceError:
        return
    away_m = float(np.hypot(*(roads.points_m - place_m).T).min())
    if away_m <= FARTHEST_DEGREES_M:
        place = f"{start.x_m},{start.y_m}"
        raise HippodromeError(
            f"--start: {place} looks like latitude and longitude, {away_m / 1e3:.1f} km from the nearest road of {net_file}; "
            f"give geo:{place}, or geo:{place},{np.degrees(start.heading_rad):g} with a compass's heading, or x and y in metres"
        )


def _require_start_near(start: StartPose, roads: RoadNetwork, net_file: Path) -> None:
    """Raise HippodromeError if a start lies so far from all roads that it must be another place's, or in other coordinates."""
    away_m = float(np.hypot(*(roads.points_m - (start.x_m, start.y_m)).T).min())
    if away_m > FARTHEST_START_M:
        raise HippodromeError(
            f"--start: lies {away_m / 1e3:.1f} km from the nearest road of {net_file}, at x {start.x_m:.0f}, y {start.y_m:.0f} m "
            "of it; look whether latitude and longitude are in this order, or leave it out"
        )


def read_roads(network: Path, folder: Path) -> RoadNetwork:
    """The lanes of a road network of any kind; what there is to know about it is printed. As ``network_file``, and its errors."""
    return _read_lanes(network_file(network, folder))


def _read_lanes(net_file: Path) -> RoadNetwork:
    """The lanes of a SUMO network; where it lacks lanes inside junctions, a note says so."""
    roads = read_network(net_file)
    for note in junction_gaps(roads, net_file):
        print(f"note: {note}")
    return roads


def network_file(network: Path, folder: Path) -> Path:
    """A road network of any kind as a SUMO network; netconvert's notes are printed.

    Args:
        network: A SUMO network, ``package:...`` of one that is installed, or an OpenStreetMap or OpenDRIVE map.
        folder: Where the network that is made of such a map is kept, to be made once.

    Raises:
        HippodromeError: There is no such file, or the map cannot be converted.
    """
    source = located(network, "--network")
    net_file, notes = sumo_network(source, folder)
    if net_file != source:
        print(f"{source}: a map to convert; its roads are in {net_file}")
    for note in notes:
        print(f"note: {note}")
    return net_file


def localize_files(source: Path, recording: Path, network: Path | None, scenario: Path | None, out: Path) -> None:
    """``hippodrome localize``: localize a recording in a topometric map. Raises HippodromeError on bad input.

    Args:
        source: The topometric map.
        recording: The drive to localize.
        network: The road network, as for ``refine_files``, to whose lanes the estimate is pulled; None does without,
            and reads no road.
        scenario: Where the localizer's settings are from; None takes the defaults.
        out: The poses that the localizer declared, as TUM. Not written if it never declared one.
    """
    cognitive_map, _ = load_map(source)
    if (warning := refusal_note(cognitive_map)) is not None:
        print(f"{source}: {warning}")
    if cognitive_map.frame != "network":
        raise HippodromeError(f"{source}: a semi-metric map has no metric frame to localize in; run `hippodrome refine` first")
    drive = open_recording(recording)
    roads = read_roads(network, out.parent) if network else None
    run = localize_recording(drive.observations(), Localizer(cognitive_map, roads, _localizer_config(scenario, roads)))
    declared = run.declared()
    if declared is not None:
        write_tum(out, declared)
    count = 0 if declared is None else len(declared.t_s)
    first = "never localized, nothing written" if declared is None else f"first at {declared.t_s[0]:.1f} s, written to {out}"
    print(f"localized in {count} of {len(run.estimates)} steps, {first}; {1e3 * run.step_s.mean():.3f} ms a step")


def _localizer_config(scenario: Path | None, roads: RoadNetwork | None) -> LocalizerConfig:
    """The settings of a drive whose camera is unknown if no scenario says where it sits; without roads there is none to read."""
    config = load_scenario(scenario).localizer if scenario else LocalizerConfig()
    return config if roads is not None else replace(config, road_reading=False)


def _settings(scenario: Path | None) -> Scenario:
    return load_scenario(scenario) if scenario else Scenario(name="defaults")
