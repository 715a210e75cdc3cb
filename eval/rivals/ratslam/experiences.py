"""RatSLAM's experience map: an experience is a view, a pose code and a place; links hold the self-motion between two of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core import se2
from hippodrome.core.mapping.experience_map import relax_ratslam
from hippodrome.core.types import EdgeKind, Edges, FloatArray


@dataclass(frozen=True)
class ExperienceConfig:
    """OpenRatSLAM's values."""

    code_threshold: float = 1.0  # cells; a pose code that is nearer to an experience's is at the same place
    correction: float = 0.5  # alpha; share of a link's error by which each of its ends is moved
    sweeps: int = 20  # relaxation sweeps whenever another experience becomes active


class ExperienceMap:
    """The graph of experiences, and the self-motion since the active one became active."""

    def __init__(self, config: ExperienceConfig) -> None:
        self._config = config
        self._since: FloatArray = np.zeros(3)
        self._links: dict[tuple[int, int], FloatArray] = {}
        self._edges = _edges(self._links)
        self.poses: FloatArray = np.zeros((0, 3))  # (V, 3) of the experiences, in map units
        self.codes: FloatArray = np.zeros((0, 3))  # (V, 3) their pose codes
        self.templates: list[int] = []  # (V,) their view templates
        self.active = -1  # number of the active experience; -1 before the first

    @property
    def links(self) -> Edges:
        """All links between experiences."""
        return self._edges

    def move(self, motion: FloatArray) -> None:
        """Add a self-motion (3,) of the body."""
        self._since = se2.compose(self._since, motion)

    def create(self, template: int, code: FloatArray) -> None:
        """Make a new experience where dead reckoning from the active one leads to, linked to that one; it becomes active.

        Args:
            template: The view template that is seen.
            code: The present pose code (3,).
        """
        before, created = self.active, len(self.templates)
        pose = se2.compose(self.poses[before], self._since) if before >= 0 else np.zeros(3)
        self.poses, self.codes = np.vstack([self.poses, pose]), np.vstack([self.codes, code])
        self.templates.append(template)
        if before >= 0:
            self._link(before, created, self._since)
        self.active, self._since = created, np.zeros(3)

    def revisit(self, experience: int, heading_rad: float) -> None:
        """Make an old experience active, with a link from the one before.

        Args:
            experience: Its number.
            heading_rad: The vehicle's heading relative to the heading that the experience was made with.
        """
        self._link(self.active, experience, se2.compose(self._since, np.array([0.0, 0.0, -heading_rad])))
        self.active, self._since = experience, np.array([0.0, 0.0, heading_rad])

    def relax(self) -> None:
        """Relax the map by a few sweeps, Eqs. (9)-(10), Milford & Wyeth 2008. The first experience stays at the origin."""
        share_of_both_ends = 2.0 * self._config.correction
        self.poses = relax_ratslam(self.poses, self._edges, share_of_both_ends, self._config.sweeps)

    def _link(self, source: int, target: int, motion: FloatArray) -> None:
        if source != target and (source, target) not in self._links and (target, source) not in self._links:
            self._links[source, target] = motion
            self._edges = _edges(self._links)


def _edges(links: dict[tuple[int, int], FloatArray]) -> Edges:
    """Links as edges. RatSLAM weighs all alike, so standard deviations are one; a link to an older experience is a closure."""
    count = len(links)
    ends = np.array(list(links), dtype=np.int32).reshape(count, 2)
    source, target = np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])
    kind = np.where(target == source + 1, EdgeKind.ODOMETRY, EdgeKind.CLOSURE).astype(np.uint8)
    motion = np.array(list(links.values()), dtype=np.float64).reshape(count, 3)
    return Edges(source, target, motion, np.ones((count, 3)), kind, np.zeros(count, dtype=np.float32))
