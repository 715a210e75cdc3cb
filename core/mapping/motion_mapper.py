"""A map of a drive without any frame: keyframes by motion alone, for matching a bare odometry to roads."""

from __future__ import annotations

import numpy as np

from hippodrome.core import se2
from hippodrome.core.mapping import networks
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.experience_map import odometry_edges, relaxed_poses
from hippodrome.core.mapping.mapper import MappingError
from hippodrome.core.types import CognitiveMap, FloatArray, Observation, ViewCells, Visits
from hippodrome.core.views import keyframes


class MotionMapper:
    """Takes observations whose frames it does not look at: ``step`` one after the other, ``finish`` returns the map."""

    def __init__(self, config: MapperConfig = MapperConfig()) -> None:
        self._config = config
        self._since_keyframe = keyframes.start()
        self._t_s: list[float] = []  # time of each keyframe
        self._motions: list[FloatArray] = []  # motion (3,) of each keyframe since the one before

    def step(self, observation: Observation) -> None:
        """Integrate the motion of one observation, and make a keyframe where one is due."""
        self._since_keyframe = keyframes.advance(self._since_keyframe, observation, self._config.view_step)
        if keyframes.is_due(self._since_keyframe, self._config.view_step):
            self._motions.append(self._since_keyframe.motion if self._t_s else np.zeros(3))
            self._t_s.append(observation.t_s)
            self._since_keyframe = keyframes.restart(self._since_keyframe)

    def finish(self) -> CognitiveMap:
        """The semi-metric map: dead reckoning, with no view cells and no loop closures; ``view_cell`` is -1 throughout.

        Raises:
            MappingError: the vehicle never moved.
        """
        if not self._t_s:
            raise MappingError("the vehicle never moved, so there is nothing to map; record a longer drive")
        motions, t_s, count = np.stack(self._motions), np.array(self._t_s), len(self._t_s)
        edges = odometry_edges(motions, self._config.experience_map)
        reckoned, spacing = se2.integrate(np.zeros(3), motions), self._since_keyframe.spacing
        return CognitiveMap(
            frame="semi-metric",
            t_s=t_s,
            poses=relaxed_poses(motions, edges, self._config.experience_map),
            view_cell=np.full(count, -1, dtype=np.int32),
            view_cells=self._no_view_cells(),
            edges=edges,
            visits=Visits(t_s, np.arange(count, dtype=np.int32), motions),
            attractors=networks.recorded([networks.begin(pose, spacing, self._config.attractor) for pose in reckoned]),
        )

    def _no_view_cells(self) -> ViewCells:
        """A store of view cells of the configured kind that holds none."""
        views = self._config.memory.view_cells
        size = int(np.prod(views.shape))
        none = np.zeros((0, size), np.int8) if views.kind == "gradient" else np.zeros((0, size), np.uint8)
        return ViewCells(views.kind, none, np.zeros(size, dtype=np.float32), views.shape)
