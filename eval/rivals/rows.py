"""The rivals that see what the mapper sees: RatSLAM, and the semi-metric map without its attractor networks. Rows of Table I.

The ablation: loop closures come from the view cells and the sequence filter, edges from raw odometry, and neither asks the
attractor networks. The map without them has therefore the same poses to the last bit; what differs is CPU and the stored states.
What the networks are for, localization, is measured in the localization table.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.mapping.mapper import MapperConfig
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import AttractorStates, CognitiveMap, FloatArray, HippodromeError, Observation, Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.materials import (
    Materials,
    Scored,
    file_stem,
    score_trajectory,
)
from hippodrome.eval.methods.stages import built
from hippodrome.eval.rivals.ablation import MapperWithoutAttractor
from hippodrome.eval.rivals.ratslam.system import RatSlam, RatSlamConfig, RatSlamMap
from hippodrome.proto.codec import save_map

RATSLAM, NO_ATTRACTOR = "RatSLAM", "semi-metric, no attractor"
RATSLAM_LONGEST_S = 3_600.0  # the paper's drive of 1,315 s takes a minute of CPU, so this some seven


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """A method in a frame and scale of its own, and the fields of its row; one that failed has the cause there, and no score."""

    method: str
    scored: Scored | None
    fields: dict[str, Any]


def rivals(materials: Materials, at_s: FloatArray) -> list[Rival]:
    """Every rival on the mapping drive, sampled at the same instants (N,); maps and trajectories go to the scenario's folder."""
    found = []
    for method, attempt in ((RATSLAM, _ratslam), (NO_ATTRACTOR, _no_attractor)):
        try:
            found.append(attempt(materials, at_s))
        except HippodromeError as error:
            found.append(Rival(method, None, {"failure": str(error)}))
    return found


def _ratslam(materials: Materials, at_s: FloatArray) -> Rival:
    if materials.duration_s > RATSLAM_LONGEST_S:
        raise HippodromeError(
            f"not run: the drive takes {materials.duration_s:.0f} s, more than {RATSLAM_LONGEST_S:.0f} s; relaxing the map at "
            "every experience takes the square of that"
        )
    found, cpu_s = run_ratslam(materials.mapping.observations())
    map_bytes = save_ratslam(materials.folder / "ratslam.npz", found)
    visits = found.trajectory
    trajectory = Trajectory(at_s, interpolate(visits.t_s, visits.poses, at_s))
    counts = {"vertices": len(found.poses), "edges": len(found.links.source), "view_cells": len(found.images)}
    return _rival(RATSLAM, trajectory, materials, cpu_s, map_bytes=map_bytes, **counts)


def _no_attractor(materials: Materials, at_s: FloatArray) -> Rival:
    found, cpu_s = map_without_attractor(materials.mapping.observations(), materials.scenario.mapper)
    map_bytes = save_map(materials.folder / f"{file_stem(NO_ATTRACTOR)}.pbstream", found, {"method": NO_ATTRACTOR})
    counts = {"vertices": len(found.t_s), "edges": len(found.edges.source)}
    trajectory = Trajectory(at_s, interpolate(found.t_s, found.poses, at_s))
    return _rival(NO_ATTRACTOR, trajectory, materials, cpu_s, map_bytes=map_bytes, **counts)


def _rival(method: str, trajectory: Trajectory, materials: Materials, cpu_s: float, **fields: Any) -> Rival:
    write_tum(materials.folder / f"{file_stem(method)}.tum", trajectory)
    scored = score_trajectory(trajectory, materials.mapping.ground_truth(), metric=False)
    return Rival(method, scored, {"cpu_percent": 100 * cpu_s / materials.duration_s, **fields})


def run_ratslam(observations: Iterable[Observation], config: RatSlamConfig | None = None) -> tuple[RatSlamMap, float]:
    """RatSLAM's map and the CPU seconds that it took, measured as the mapper's are."""
    _warm_up()
    return built(RatSlam(config or RatSlamConfig()), observations)


def map_without_attractor(observations: Iterable[Observation], config: MapperConfig) -> tuple[CognitiveMap, float]:
    """The semi-metric map without the networks' states, and the CPU seconds that it took."""
    cognitive_map, cpu_s = built(MapperWithoutAttractor(config), observations)
    return replace(cognitive_map, attractors=_no_states(len(cognitive_map.t_s))), cpu_s


def _no_states(vertices: int) -> AttractorStates:
    """What a map file must hold of the networks, for networks that are not there: zeros, no grid module."""
    nothing, no_module = np.zeros((vertices, 2), dtype=np.float32), np.zeros((vertices, 0, 2, 2), dtype=np.float32)
    return AttractorStates(nothing, nothing, np.zeros(0, dtype=np.float32), no_module, no_module)


def save_ratslam(path: Path, found: RatSlamMap) -> int:
    """What RatSLAM needs in order to go on: templates, pose codes, experiences and links, packed; the file's size in bytes."""
    links = asdict(found.links)
    arrays = {
        "images": found.images,
        "codes": found.codes.astype(np.float32),
        "poses": found.poses.astype(np.float32),
        "template": found.template,
        "link_ends": np.stack([links["source"], links["target"]]),
        "link_motion": links["motion"].astype(np.float32),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(path, stream.getvalue())
    return len(stream.getvalue())


@cache
def _warm_up() -> None:
    """Compile RatSLAM's inner loops before they are timed, once per process."""
    system, rng = RatSlam(RatSlamConfig()), np.random.default_rng(0)
    frames = rng.integers(0, 256, (3, 120, 160, 3), dtype=np.uint8)
    for i, frame in enumerate([*frames, *frames]):
        system.step(Observation(0.1 * (i + 1), 0.1, 5.0, 0.1, frame))
    system.finish()
