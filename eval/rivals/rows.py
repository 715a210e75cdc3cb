"""The rivals that see what the mapper sees: RatSLAM, and the semi-metric map without its attractor networks. Rows of Table I.

The ablation: loop closures come from view cells and the sequence filter, edges from raw odometry, and neither asks the attractor
networks. So the map without the networks has the same poses to the last bit; what differs is CPU time and the stored states. What
the networks are for is localization, which the localization table measures.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import ClassVar, Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import AttractorStates, CognitiveMap, HippodromeError, Observation, Trajectory
from hippodrome.eval.methods.method import NO_ATTRACTOR, RATSLAM
from hippodrome.eval.methods.ours import mapped_of
from hippodrome.eval.methods.protocol import Given, Mapped, Needs
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.rivals.ablation import MapperWithoutAttractor
from hippodrome.eval.rivals.ratslam.system import RatSlam, RatSlamConfig, RatSlamMap
from hippodrome.proto.codec import save_map
from hippodrome.sim.scenario import Scenario

RATSLAM_LONGEST_S: Final = 3_600.0  # the paper's drive of 1,315 s takes RatSLAM a minute of CPU, so this takes some seven


class RatSlamMethod:
    """RatSLAM as the protocol has it."""

    card: ClassVar = RATSLAM
    needs: ClassVar = Needs()

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """RatSLAM's experience map. Raises HippodromeError for a drive that would take it too long."""
        if given.duration_s > RATSLAM_LONGEST_S:
            raise HippodromeError(
                f"not run: the drive takes {given.duration_s:.0f} s, more than {RATSLAM_LONGEST_S:.0f} s; relaxing the map at "
                "every experience takes the square of that"
            )
        system, times_s = RatSlam(RatSlamConfig()), []
        for observation in observations:
            system.step(observation)
            times_s.append(observation.t_s)
        found = system.finish()
        counts = {
            "vertices": len(found.poses),
            "edges": len(found.links.source),
            "view_cells": len(found.images),
        }
        trajectory = _held(found.trajectory, times_s[0], times_s[-1])
        return Mapped(trajectory, state=found, figures=counts, save=lambda path: save_ratslam(path, found))

    @staticmethod
    def warm_up() -> None:
        """Compile the inner loops."""
        _warm_up()


class NoAttractor:
    """The ablation as the protocol has it."""

    card: ClassVar = NO_ATTRACTOR
    needs: ClassVar = Needs()

    def __init__(self, config: MapperConfig) -> None:
        self._config = config

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> NoAttractor:
        """With the scenario's configuration of the mapper."""
        return cls(scenario.mapper)

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """The semi-metric map without the networks' states."""
        found = mapped_of(map_without_attractor(observations, self._config)[0])
        cognitive_map = found.cognitive_map
        assert cognitive_map is not None
        at_s, poses = found.trajectory.t_s, found.trajectory.poses
        wrapped = Trajectory(at_s, interpolate(at_s, poses, at_s))  # rounds its headings, as ever
        return replace(found, trajectory=wrapped, save=lambda path: save_map(path, cognitive_map, {"method": NO_ATTRACTOR.label}))


def _held(trajectory: Trajectory, first_s: float, last_s: float) -> Trajectory:
    """A trajectory of events, held from the first observation on and up to the last: between events the vehicle stays."""
    t_s, poses = trajectory.t_s, trajectory.poses
    if first_s < t_s[0]:
        t_s, poses = np.concatenate([[first_s], t_s]), np.concatenate([poses[:1], poses])
    if last_s > t_s[-1]:
        t_s, poses = np.concatenate([t_s, [last_s]]), np.concatenate([poses, poses[-1:]])
    return Trajectory(t_s, poses)


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
