"""The rivals that see what the mapper sees: RatSLAM, and the semi-metric map without its attractor networks. Rows of Table I.

The ablation: loop closures come from view cells and the sequence filter, edges from raw odometry, and neither asks the attractor
networks. So the map without the networks has the same poses to the last bit; what differs is CPU time and the stored states. What
the networks are for is localization, which the localization table measures.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.mapping.mapper import MapperConfig
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import AttractorStates, CognitiveMap, FloatArray, HippodromeError, Observation, Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import Materials, ScoredTrajectory, score_trajectory
from hippodrome.eval.methods.method import NO_ATTRACTOR, RATSLAM, Method
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.results.model import Row
from hippodrome.eval.results.rows import map_size, own_frame_row
from hippodrome.eval.rivals.ablation import MapperWithoutAttractor
from hippodrome.eval.rivals.ratslam.system import RatSlam, RatSlamConfig, RatSlamMap
from hippodrome.proto.codec import save_map

RATSLAM_LONGEST_S: Final = 3_600.0  # the paper's drive of 1,315 s takes RatSLAM a minute of CPU, so this takes some seven


@dataclass(frozen=True, slots=True, eq=False)
class RivalResult:
    """A rival's row, and its trajectory with its errors; None if it failed, as the row says."""

    method: Method
    row: Row
    scored: ScoredTrajectory | None


def run_rivals(materials: Materials, at_s: FloatArray) -> list[RivalResult]:
    """Run every rival on the mapping drive. Maps and trajectories go to the scenario's folder; a rival that fails has a row too.

    Args:
        materials: The drive, and the scenario.
        at_s: Times (N,) at which all trajectories are sampled, those of the semi-metric map's vertices.
    """
    results = []
    for method, run in ((RATSLAM, _ratslam), (NO_ATTRACTOR, _no_attractor)):
        try:
            results.append(run(materials, at_s))
        except HippodromeError as error:
            results.append(RivalResult(method, Row(method=method.label, failure=str(error)), None))
    return results


def _ratslam(materials: Materials, at_s: FloatArray) -> RivalResult:
    if materials.duration_s > RATSLAM_LONGEST_S:
        raise HippodromeError(
            f"not run: the drive takes {materials.duration_s:.0f} s, more than {RATSLAM_LONGEST_S:.0f} s; relaxing the map at "
            "every experience takes the square of that"
        )
    ratslam_map, cpu_s = run_ratslam(materials.mapping.observations())
    map_bytes = save_ratslam(RATSLAM.map_path(materials.folder), ratslam_map)
    counts = {
        "vertices": len(ratslam_map.poses),
        "edges": len(ratslam_map.links.source),
        "view_cells": len(ratslam_map.images),
    }
    return _result(RATSLAM, ratslam_map.trajectory, at_s, materials, cpu_s, map_bytes=map_bytes, **counts)


def _no_attractor(materials: Materials, at_s: FloatArray) -> RivalResult:
    cognitive_map, cpu_s = map_without_attractor(materials.mapping.observations(), materials.scenario.mapper)
    map_bytes = save_map(NO_ATTRACTOR.map_path(materials.folder), cognitive_map, {"method": NO_ATTRACTOR.label})
    trajectory = Trajectory(cognitive_map.t_s, cognitive_map.poses)
    return _result(NO_ATTRACTOR, trajectory, at_s, materials, cpu_s, map_bytes=map_bytes, **map_size(cognitive_map))


def _result(
    method: Method, trajectory: Trajectory, at_s: FloatArray, materials: Materials, cpu_s: float, **fields: Any
) -> RivalResult:
    """Sample, write and score a rival's trajectory; ``fields`` are further fields of its row."""
    truth = materials.mapping.ground_truth()
    sampled = Trajectory(at_s, interpolate(trajectory.t_s, trajectory.poses, at_s))
    write_tum(materials.folder / f"{method.stem}.tum", sampled)
    scored = score_trajectory(sampled, truth, method.alignment)
    row = own_frame_row(method, scored, truth, cpu_percent=100 * cpu_s / materials.duration_s, **fields)
    return RivalResult(method, row, scored)


def run_ratslam(observations: Iterable[Observation], config: RatSlamConfig | None = None) -> tuple[RatSlamMap, float]:
    """RatSLAM's map of a drive and the CPU seconds that it took, measured as the mapper's are."""
    _warm_up()
    return map_recording(observations, RatSlam(config or RatSlamConfig()))


def map_without_attractor(observations: Iterable[Observation], config: MapperConfig) -> tuple[CognitiveMap, float]:
    """The semi-metric map of a drive without the networks' states, and the CPU seconds that it took."""
    cognitive_map, cpu_s = map_recording(observations, MapperWithoutAttractor(config))
    return replace(cognitive_map, attractors=_no_states(len(cognitive_map.t_s))), cpu_s


def _no_states(vertices: int) -> AttractorStates:
    """Attractor states for a map file of a mapper that has no networks: zeros, and no grid module."""
    nothing, no_module = np.zeros((vertices, 2), dtype=np.float32), np.zeros((vertices, 0, 2, 2), dtype=np.float32)
    return AttractorStates(nothing, nothing, np.zeros(0, dtype=np.float32), no_module, no_module)


def save_ratslam(path: Path, ratslam_map: RatSlamMap) -> int:
    """Save what RatSLAM needs in order to go on: templates, pose codes, experiences and links. Returns the size in bytes."""
    links = asdict(ratslam_map.links)
    arrays = {
        "images": ratslam_map.images,
        "codes": ratslam_map.codes.astype(np.float32),
        "poses": ratslam_map.poses.astype(np.float32),
        "template": ratslam_map.template,
        "link_ends": np.stack([links["source"], links["target"]]),
        "link_motion": links["motion"].astype(np.float32),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(path, stream.getvalue())
    return len(stream.getvalue())


@cache
def _warm_up() -> None:
    """Compile RatSLAM's inner loops, so that compiling them is not timed; once per process."""
    system, rng = RatSlam(RatSlamConfig()), np.random.default_rng(0)
    frames = rng.integers(0, 256, (3, 120, 160, 3), dtype=np.uint8)
    for i, frame in enumerate([*frames, *frames]):
        system.step(Observation(0.1 * (i + 1), 0.1, 5.0, 0.1, frame))
    system.finish()
