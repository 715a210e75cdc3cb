"""Our own methods: dead reckoning, the semi-metric map, and the topometric maps, as the protocol has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import CognitiveMap, LocalizationEstimate, Observation, Trajectory
from hippodrome.eval.methods.materials import refine_config
from hippodrome.eval.methods.method import DEAD_RECKONING, SEMI_METRIC, TOPOMETRIC, TOPOMETRIC_PAPER, Method, RefineMode
from hippodrome.eval.methods.protocol import Given, Mapped, MethodError, Needs
from hippodrome.eval.methods.stages import dead_reckoning
from hippodrome.sim.scenario import Scenario


def mapped_of(cognitive_map: CognitiveMap) -> Mapped:
    """A cognitive map as the answer of ``map``, with the numbers of its vertices and edges."""
    trajectory = Trajectory(cognitive_map.t_s, cognitive_map.poses)
    return Mapped(trajectory, cognitive_map, figures=map_size(cognitive_map))


def map_size(cognitive_map: CognitiveMap) -> dict[str, int]:
    """Fields of a row: the numbers of vertices and edges."""
    return {"vertices": len(cognitive_map.t_s), "edges": len(cognitive_map.edges.source)}


class DeadReckoning:
    """The self-motion integrated, and nothing else."""

    card: ClassVar = DEAD_RECKONING
    needs: ClassVar = Needs(camera=False)

    def map(self, observations: Iterator[Observation], given: Given) -> Trajectory:
        """The integrated path, in map units."""
        return dead_reckoning(observations)[0]


class SemiMetric:
    """The mapper: right in its connections, wrong in its metres."""

    card: ClassVar = SEMI_METRIC
    needs: ClassVar = Needs(frames_optional=True)

    def __init__(self, config: MapperConfig) -> None:
        self._config = config

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> SemiMetric:
        """With the scenario's configuration of the mapper."""
        return cls(scenario.mapper)

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """The semi-metric map."""
        mapper = Mapper(self._config) if given.frames else MotionMapper(self._config)
        for observation in observations:
            mapper.step(observation)
        return mapped_of(mapper.finish())


class Topometric:
    """The semi-metric map refined with the road network, and the localizer in it."""

    card: ClassVar[Method] = TOPOMETRIC
    needs: ClassVar = Needs(road_network=True, frames_optional=True)
    builds_on: ClassVar = SEMI_METRIC.key
    mode: ClassVar[RefineMode] = "route"

    def __init__(self, config: RefineConfig, localizer: LocalizerConfig) -> None:
        self._config = config
        self._localizer = localizer

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> Topometric:
        """With the scenario's configuration of the refinement and the localizer."""
        return cls(refine_config(scenario, cls.mode), scenario.localizer)

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """The refined map of the one that it builds on. Raises HippodromeError if the refinement refuses that."""
        assert given.roads is not None
        refinement = refine(_map_of(given.base), given.roads, self._config, given.start)
        refined = mapped_of(refinement.cognitive_map)
        estimates = {name: value if np.isfinite(value) else None for name, value in refinement.estimates.items()}
        return Mapped(refined.trajectory, refined.cognitive_map, refinement, {**refined.figures, "estimates": estimates})

    def localize(self, observations: Iterator[Observation], given: Given) -> Iterator[LocalizationEstimate]:
        """The localizer's answers, one per observation."""
        localizer = Localizer(_map_of(given.mapped), given.roads, self._localizer)
        for observation in observations:
            yield localizer.step(observation)


class TopometricPaper(Topometric):
    """The paper's own matching, which is told where the mapping drive began."""

    card: ClassVar[Method] = TOPOMETRIC_PAPER
    needs: ClassVar = Needs(road_network=True, start_pose=True, frames_optional=True)
    mode: ClassVar[RefineMode] = "paper"


def _map_of(mapped: Mapped | None) -> CognitiveMap:
    if mapped is None or mapped.cognitive_map is None:
        raise MethodError("there is no map to work on: the method that it builds on made none")
    return mapped.cognitive_map
