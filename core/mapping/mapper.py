"""The mapper, Section III.A of Li et al. 2025: frames and self-motion in, a semi-metric cognitive map out.

Every so often a frame becomes a *keyframe*: its view and the raw motion since the keyframe before are kept. Each keyframe is a
vertex of the map; the stored map calls the sequence of keyframes its ``visits``. A keyframe whose place is recognised adds a loop
closure, and injects the place's pose into the attractor networks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from hippodrome.core import se2
from hippodrome.core.mapping import networks
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.experience_map import (
    Closure,
    closure_edges,
    concatenated,
    odometry_edges,
    relaxed_poses,
    with_median_offsets,
)
from hippodrome.core.mapping.memory import PlaceMemory, Recognition
from hippodrome.core.mapping.networks import NeuralPose
from hippodrome.core.mapping.road import RoadLog
from hippodrome.core.types import CognitiveMap, FloatArray, Frame, HippodromeError, Observation, Visits
from hippodrome.core.views import keyframes
from hippodrome.core.views.descriptors import describe


class MappingError(HippodromeError):
    """A drive that no map can be made of."""


class Mapper:
    """Makes a map while driving: ``step`` takes one observation after the other, ``finish`` returns the map."""

    def __init__(self, config: MapperConfig = MapperConfig()) -> None:
        self._config = config
        self._since_keyframe = keyframes.start()
        self._memory = PlaceMemory(config.memory)
        self._t_s: list[float] = []  # time of each keyframe
        self._motions: list[FloatArray] = []  # raw motion to each keyframe from the one before
        self._closures: list[Closure] = []
        self._neural: NeuralPose | None = None  # the networks now; None until they start
        self._road = RoadLog(config.camera) if config.road_reading else None
        self._neural_at: list[NeuralPose] = []  # the networks at each keyframe, once they have started

    def step(self, observation: Observation) -> None:
        """Take one observation in: integrate its motion, and make a keyframe of its frame if one is due.

        A keyframe whose place is recognised, perhaps together with keyframes shortly before it, closes loops.
        """
        self._since_keyframe = keyframes.advance(self._since_keyframe, observation, self._config.view_step)
        self._integrate_paths(observation)
        if self._road is not None:
            self._road.move(observation)
        if not keyframes.is_due(self._since_keyframe, self._config.view_step) or observation.frame is None:
            if self._road is not None and observation.frame is not None:
                self._road.see(observation.frame)
            return
        recognitions = self._add_keyframe(observation.t_s, observation.frame)
        self._close_loops(recognitions)
        self._reactivate(recognitions)
        self._since_keyframe = keyframes.restart(self._since_keyframe)

    def finish(self) -> CognitiveMap:
        """The semi-metric cognitive map of all observations so far, with its poses relaxed.

        If the drive was too short for the attractor networks to start, their states are those of dead reckoning.

        Raises:
            MappingError: no keyframe was made, as there was no frame while the vehicle moved.
        """
        if not self._t_s:
            raise MappingError("the drive has no view: no frame was taken while the vehicle moved")
        cells = self._memory.finish(self._since_keyframe.spacing)
        config, motions = self._config.experience_map, np.stack(self._motions)
        closures = with_median_offsets(self._closures, motions, config)
        edges = concatenated(odometry_edges(motions, config), closure_edges(closures, config))
        t_s, count = np.array(self._t_s), len(motions)
        return CognitiveMap(
            frame="semi-metric",
            t_s=t_s,
            poses=relaxed_poses(motions, edges, config),
            view_cell=np.array(self._memory.vertex_cell, dtype=np.int32),
            view_cells=cells,
            edges=edges,
            visits=Visits(t_s, np.arange(count, dtype=np.int32), motions, None if self._road is None else self._road.finish()),
            attractors=networks.recorded(self._neural_at or self._reckoned_states()),
        )

    def _integrate_paths(self, observation: Observation) -> None:
        """Integrate the motion of one observation in the attractor networks, once they have started."""
        if self._neural is not None:
            motion = keyframes.arc_motion(observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s)
            self._neural = networks.path_integrate(self._neural, motion, observation.dt_s, self._config.attractor)

    def _add_keyframe(self, t_s: float, frame: Frame) -> list[Recognition]:
        """Add a vertex for a new keyframe; returns the recognitions that its view triggers."""
        state, vertex = self._since_keyframe, len(self._t_s)
        if self._road is not None:
            self._road.read(frame, state.travelled, float(state.motion[2]))
            self._road.see(frame)
        self._t_s.append(t_s)
        self._motions.append(state.motion if vertex else np.zeros(3))
        descriptor = describe(frame, self._config.memory.view_cells)
        return self._memory.recognise(vertex, descriptor, state.travelled, float(state.motion[2]), state.spacing)

    def _close_loops(self, recognitions: list[Recognition]) -> None:
        """Add a loop closure for each recognition, from the vertex that made the view cell to the one that was recognised."""
        for found in recognitions:
            source, motion = self._memory.cell_vertex[found.cell], (found.along, 0.0, found.heading_rad)
            self._closures.append(Closure(source, found.vertex, motion, self._since_keyframe.spacing, found.margin))

    def _reactivate(self, recognitions: list[Recognition]) -> None:
        """Start the networks, or correct them by the view cell of a recognised place, and record them at this keyframe.

        They start with the first keyframe at which the memory could recognise a place. A recognised place then injects the pose
        that the networks had when its view cell was made, moved by where the keyframe lies from there.
        """
        if self._neural is None and self._memory.can_recognise:
            self._neural_at = self._reckoned_states()
            self._neural = self._neural_at.pop()
        elif self._neural is not None and recognitions:
            found = recognitions[-1]
            made_at = self._neural_at[self._memory.cell_vertex[found.cell]].pose
            seen = se2.compose(made_at, np.array([found.along, 0.0, found.heading_rad]))
            self._neural = networks.inject(self._neural, seen, self._config.attractor)
        if self._neural is not None:
            self._neural_at.append(self._neural)

    def _reckoned_states(self) -> list[NeuralPose]:
        """States of the networks at every keyframe so far, as they follow from dead reckoning alone."""
        poses = se2.integrate(np.zeros(3), np.stack(self._motions))
        return [networks.begin(pose, self._since_keyframe.spacing, self._config.attractor) for pose in poses]


def map_drive(
    observations: Iterable[Observation],
    config: MapperConfig = MapperConfig(),
    progress: Callable[[int], None] | None = None,
) -> CognitiveMap:
    """The semi-metric cognitive map of a whole drive.

    Args:
        observations: in the order of time, one for each sample of odometry, with a frame where the camera took one.
        config: the mapper's constants.
        progress: is called with the number of observations taken so far, after each of them.

    Returns:
        A map whose poses are in map units, in a frame that begins at the first keyframe.

    Raises:
        MappingError: the vehicle never moved with a frame in view.
    """
    mapper = Mapper(config)
    for count, observation in enumerate(observations, start=1):
        mapper.step(observation)
        if progress is not None:
            progress(count)
    return mapper.finish()
