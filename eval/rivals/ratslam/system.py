"""Classical RatSLAM, the ancestor of the cognitive map: frames and self-motion in, an experience map out.

Milford & Wyeth, "Mapping a suburb with a single camera using a biologically inspired SLAM system", 2008; OpenRatSLAM, Ball et
al. 2013. Written from the published equations. One deviation: OpenRatSLAM sets the side of a pose cell by hand in metres for each
data set; here the unit of the odometry is unknown, so it is the distance that the vehicle typically travels in a given time.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hippodrome.core.types import Edges, FloatArray, HippodromeError, IntArray, Observation, Trajectory, UInt8Array
from hippodrome.core.views import keyframes
from hippodrome.core.views.config import KeyframeConfig
from hippodrome.eval.rivals.ratslam import pose_cells
from hippodrome.eval.rivals.ratslam.experiences import ExperienceConfig, ExperienceMap
from hippodrome.eval.rivals.ratslam.pose_cells import PoseCellConfig
from hippodrome.eval.rivals.ratslam.views import Recognised, ViewConfig, ViewTemplates


@dataclass(frozen=True)
class RatSlamConfig:
    """Every constant of RatSLAM, each declared beside its algorithm."""

    pose_cells: PoseCellConfig = field(default_factory=PoseCellConfig)
    views: ViewConfig = field(default_factory=ViewConfig)
    experiences: ExperienceConfig = field(default_factory=ExperienceConfig)
    speed: KeyframeConfig = field(default_factory=lambda: KeyframeConfig(interval_s=0.25))  # a cell: 2 m at 30 km/h


@dataclass(frozen=True, slots=True, eq=False)
class RatSlamMap:
    """The finished map, in map units, with the first experience at the origin."""

    poses: FloatArray  # (V, 3) of the experiences
    codes: FloatArray  # (V, 3) their pose codes, in cells
    template: IntArray  # (V,) their view templates
    links: Edges
    images: UInt8Array  # (C, D) view templates
    visit_t_s: FloatArray  # (S,) times at which an experience became active
    visit: IntArray  # (S,) number of the experience that became active

    @property
    def trajectory(self) -> Trajectory:
        """Where the vehicle was according to the finished map, at the times at which an experience became active."""
        return Trajectory(self.visit_t_s, self.poses[self.visit])


class RatSlam:
    """``step`` takes one observation after the other; ``finish`` returns the map."""

    def __init__(self, config: RatSlamConfig) -> None:
        self._config = config
        self._speeds = keyframes.start()
        self._cells = pose_cells.start(config.pose_cells)
        self._templates = ViewTemplates(config.views)
        self._map = ExperienceMap(config.experiences)
        self._visits: list[tuple[float, int]] = []
        self._template = -1

    def step(self, observation: Observation) -> None:
        """One observation: the view templates, the pose cells and the experience map, in the order of the publication."""
        code = pose_cells.read_out(self._cells, self._config.pose_cells)
        seen = None if observation.frame is None else self._templates.recognise(observation.frame, code)
        if seen is not None:
            self._inject(seen)
        self._integrate_paths(observation)
        if seen is not None:
            self._experience(seen, observation.t_s)

    def finish(self) -> RatSlamMap:
        """The experience map of all observations. Raises HippodromeError if none had a frame."""
        if not self._visits:
            raise HippodromeError("RatSLAM: the drive has no frame")
        t_s, visit = zip(*self._visits, strict=True)
        return RatSlamMap(
            poses=self._map.poses,
            codes=self._map.codes,
            template=np.array(self._map.templates, dtype=np.int32),
            links=self._map.links,
            images=self._templates.images,
            visit_t_s=np.array(t_s),
            visit=np.array(visit, dtype=np.int32),
        )

    def _inject(self, seen: Recognised) -> None:
        config, energy = self._config.pose_cells, self._templates.energy(seen)
        if energy > 0.0:
            turned = seen.heading_rad * config.cells_heading / (2.0 * np.pi)
            self._cells = pose_cells.inject(
                self._cells, self._templates.code(seen.template) + np.array([0.0, 0.0, turned]), energy
            )

    def _integrate_paths(self, observation: Observation) -> None:
        length, turn_rad = observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s
        self._speeds = keyframes.advance(self._speeds, observation, self._config.speed)
        self._map.move(keyframes.arc_motion(length, turn_rad))
        distance = length / self._speeds.spacing if self._speeds.spacing > 0.0 else 0.0
        cells = pose_cells.attract(self._cells, self._config.pose_cells)
        self._cells = pose_cells.path_integrate(cells, distance, turn_rad)

    def _experience(self, seen: Recognised, t_s: float) -> None:
        """Stay at the active experience, go back to an old one, or make a new one, by view and pose code together."""
        code, places = pose_cells.read_out(self._cells, self._config.pose_cells), self._map
        same_view, self._template = seen.template == self._template, seen.template
        apart = pose_cells.code_distance(places.codes, code, self._config.pose_cells)
        threshold = self._config.experiences.code_threshold
        if places.active >= 0 and same_view and apart[places.active] <= threshold:
            return
        of_view = [i for i, template in enumerate(places.templates) if template == seen.template and i != places.active]
        nearest = min(of_view, key=lambda i: float(apart[i]), default=-1)
        if nearest >= 0 and apart[nearest] < threshold:
            places.revisit(nearest, seen.heading_rad)
        else:
            places.create(seen.template, code)
        places.relax()
        self._visits.append((t_s, places.active))
