"""The mapper: III.A of Li et al. 2025. Frames and self-motion in, a semi-metric cognitive map out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from hippodrome.core import se2
from hippodrome.core.mapping import experience_map
from hippodrome.core.mapping import networks as mapper_attractor
from hippodrome.core.mapping.experience_map import Closure, ExperienceMapConfig
from hippodrome.core.mapping.memory import PlaceMemory, PlaceMemoryConfig, Recognition
from hippodrome.core.mapping.networks import MapperAttractorConfig, NeuralPose
from hippodrome.core.types import CognitiveMap, FloatArray, Frame, HippodromeError, Observation, Visits
from hippodrome.core.views import keyframes as view_step
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.keyframes import ViewStepConfig


@dataclass(frozen=True)
class MapperConfig:
    """Every constant of the mapper, each declared beside its algorithm."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    view_step: ViewStepConfig = field(default_factory=ViewStepConfig)
    memory: PlaceMemoryConfig = field(default_factory=PlaceMemoryConfig)
    experience_map: ExperienceMapConfig = field(default_factory=ExperienceMapConfig)
    attractor: MapperAttractorConfig = field(default_factory=MapperAttractorConfig)


class MappingError(HippodromeError):
    """A drive that no map can be made of."""


class Mapper:
    """``step`` takes one observation after the other; ``finish`` returns the map."""

    def __init__(self, config: MapperConfig) -> None:
        self._config = config
        self._step_state = view_step.start()
        self._memory = PlaceMemory(config.memory)
        self._t_s: list[float] = []  # per visit
        self._motions: list[FloatArray] = []  # per visit, since the one before
        self._closures: list[Closure] = []
        self._neural: NeuralPose | None = None
        self._neural_at: list[NeuralPose] = []  # per visit, once the networks run

    def step(self, observation: Observation) -> None:
        """One observation: path integration, and a visit where a view is due."""
        self._step_state = view_step.advance(self._step_state, observation, self._config.view_step)
        self._integrate_paths(observation)
        if not view_step.is_due(self._step_state, self._config.view_step) or observation.frame is None:
            return
        recognitions = self._visit(observation.t_s, observation.frame)
        self._close_loops(recognitions)
        self._reactivate(recognitions)
        self._step_state = view_step.restart(self._step_state)

    def finish(self) -> CognitiveMap:
        """The semi-metric cognitive map of everything seen."""
        if not self._t_s:
            raise MappingError("the drive has no view: no frame was taken while the vehicle moved")
        cells = self._memory.finish(self._step_state.spacing)
        config, motions = self._config.experience_map, np.stack(self._motions)
        odometry = experience_map.odometry_edges(motions, config)
        closures = experience_map.steadied(self._closures, motions, config)
        edges = experience_map.joined(odometry, experience_map.closure_edges(closures, config))
        t_s, count = np.array(self._t_s), len(motions)
        return CognitiveMap(
            frame="semi-metric",
            t_s=t_s,
            poses=experience_map.relaxed_poses(motions, edges, config),
            view_cell=np.array(self._memory.vertex_cell, dtype=np.int32),
            view_cells=cells,
            edges=edges,
            visits=Visits(t_s, np.arange(count, dtype=np.int32), motions),
            attractors=mapper_attractor.recorded(self._neural_at or self._reckoned_states()),
        )

    def _integrate_paths(self, observation: Observation) -> None:
        if self._neural is not None:
            motion = view_step.arc(observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s)
            self._neural = mapper_attractor.path_integrate(self._neural, motion, observation.dt_s, self._config.attractor)

    def _visit(self, t_s: float, frame: Frame) -> list[Recognition]:
        """A new vertex, and what its view brings to mind."""
        state, vertex = self._step_state, len(self._t_s)
        self._t_s.append(t_s)
        self._motions.append(state.motion if vertex else np.zeros(3))
        descriptor = describe(frame, self._config.memory.view_cells)
        return self._memory.recognise(vertex, descriptor, state.travelled, float(state.motion[2]), state.spacing)

    def _close_loops(self, recognitions: list[Recognition]) -> None:
        for found in recognitions:
            source, motion = self._memory.cell_vertex[found.cell], (found.along, 0.0, found.heading_rad)
            self._closures.append(Closure(source, found.vertex, motion, self._step_state.spacing, found.margin))

    def _reactivate(self, recognitions: list[Recognition]) -> None:
        """The view cell of the present place injects the pose at which it was made."""
        if self._neural is None and self._memory.can_recognise:
            self._neural_at = self._reckoned_states()
            self._neural = self._neural_at.pop()
        elif self._neural is not None and recognitions:
            found = recognitions[-1]
            made_at = self._neural_at[self._memory.cell_vertex[found.cell]].pose
            seen = se2.compose(made_at, np.array([found.along, 0.0, found.heading_rad]))
            self._neural = mapper_attractor.inject(self._neural, seen, self._config.attractor)
        if self._neural is not None:
            self._neural_at.append(self._neural)

    def _reckoned_states(self) -> list[NeuralPose]:
        """The networks at every visit so far, from path integration alone."""
        poses = se2.integrate(np.zeros(3), np.stack(self._motions))
        return [mapper_attractor.begin(pose, self._step_state.spacing, self._config.attractor) for pose in poses]


def build_map(
    observations: Iterable[Observation], config: MapperConfig, progress: Callable[[int], None] | None = None
) -> CognitiveMap:
    """The map of a whole drive; ``progress`` hears the number of observations taken."""
    mapper = Mapper(config)
    for count, observation in enumerate(observations, start=1):
        mapper.step(observation)
        if progress is not None:
            progress(count)
    return mapper.finish()
