"""Visual localization in a topometric map from an unknown start, III.C of Li et al. 2025.

Per observation: path integration moves the networks. Per look, once the view has changed enough: the frame is scored against
all view cells, the scores are filtered along the paths of the map, and a cell that stands out is reactivated. Its pose is
injected where it agrees with the belief, with less weight where it only shows the same place; where it shows another place, it
becomes a challenger that has to win by further evidence. Evidence is counted in looks: standing still adds none and loses none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from hippodrome.core.localization import gyro as gyro_noise
from hippodrome.core.localization import places as localizer_places
from hippodrome.core.localization.beliefs.attractor import AttractorPose
from hippodrome.core.localization.beliefs.kalman import KalmanPose
from hippodrome.core.localization.beliefs.lanes import LanePose
from hippodrome.core.localization.beliefs.motion import Motion
from hippodrome.core.localization.beliefs.paper import PaperPose
from hippodrome.core.localization.config import Injection, LocalizerConfig
from hippodrome.core.localization.gyro import GyroNoise
from hippodrome.core.localization.places import is_same_place
from hippodrome.core.localization.recogniser import PlaceRecogniser, Recognised
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import (
    CognitiveMap,
    FloatArray,
    Frame,
    HippodromeError,
    IntArray,
    LocalizationEstimate,
    LocalizationStatus,
    Observation,
)
from hippodrome.core.views import keyframes
from hippodrome.core.views.index import ScoredViews
from hippodrome.core.views.odometry import VisualOdometry

__all__ = ["Localizer", "LocalizerConfig", "localize"]

ACROSS_SHARE = 0.1  # of a look in the running mean of what views disagree by across the road: some 30 m
LANE_M = 3.0  # they show the lane: farther off is another place, or a bend

PoseBelief: TypeAlias = AttractorPose | KalmanPose | LanePose | PaperPose


def localize(
    observations: Iterable[Observation], cognitive_map: CognitiveMap, network: RoadNetwork | None, config: LocalizerConfig
) -> list[LocalizationEstimate]:
    """Localize a whole drive from an unknown start."""
    localizer = Localizer(cognitive_map, network, config)
    return [localizer.step(observation) for observation in observations]


class Localizer:
    """Feed it observations in order; each ``step`` answers with the pose so far."""

    def __init__(self, cognitive_map: CognitiveMap, network: RoadNetwork | None, config: LocalizerConfig) -> None:
        if cognitive_map.frame != "network" or len(cognitive_map.poses) == 0:
            raise HippodromeError(
                f"localization needs a map in the network frame with vertices, got frame {cognitive_map.frame!r} with "
                f"{len(cognitive_map.poses)} vertices: refine the map first"
            )
        self._config = config
        self._places = localizer_places.places_of(cognitive_map, network, config.lane_sigma_m, config.injection.map_m)
        self._belief = _unknown(cognitive_map, network, config)
        self._recogniser = PlaceRecogniser(self._places, config)
        self._view_step = keyframes.start()
        self._gyro = GyroNoise()
        self._odometry = VisualOdometry(config.camera) if config.self_motion == "visual" else None
        self._step_m, self._turned_rad = 0.0, 0.0  # since the last look
        self._fixed = False  # an incumbent has been adopted
        self._evidence = 0.0  # modes "paper" and "lanes": summed margins so far
        self._support, self._challenge = 0.0, 0.0  # summed margins of the incumbent and the challenger, as far as remembered
        self._sq_map: FloatArray = np.zeros((3, 3))  # error of the map where it was recognised last
        self._sq_across = 0.0  # of the views about the belief, across the road, a running mean, m^2
        self._mapped = True  # as far as known
        self._astray = False  # dead reckoning has led off the roads: it began at the wrong place, or went wrong
        self._seen = 0.0  # z-score that the believed place has in the views, a running mean; 0: a new fix, none yet
        self._margin, self._cell = 0.0, -1
        self._weight = 0.0  # of the last look as a witness; 0 before the first

    def step(self, observation: Observation) -> LocalizationEstimate:
        """Take one observation in."""
        observation = observation if self._odometry is None else self._odometry.step(observation)
        self._move(observation)
        if observation.frame is not None and (self._cell < 0 or keyframes.is_due(self._view_step, self._config.steps)):
            self._look(observation.frame)
        return self._estimate(observation.t_s)

    def _move(self, observation: Observation) -> None:
        travelled, turned_rad = observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s
        self._view_step = keyframes.advance(self._view_step, observation, self._config.steps)
        least_radps = self._config.motion.gyro_rad_per_sqrt_s / math.sqrt(observation.dt_s)
        self._gyro = gyro_noise.update(self._gyro, observation.yaw_rate_radps, least_radps)
        walk = self._gyro.sigma_radps * math.sqrt(observation.dt_s)
        self._belief = self._belief.predict(Motion(travelled, turned_rad, observation.dt_s, walk))
        self._step_m += travelled * math.exp(self._belief.log_scale)
        self._turned_rad += turned_rad

    def _look(self, frame: Frame) -> None:
        config, here = self._config, self._here()
        seen = self._recogniser.look(frame, self._step_m, self._turned_rad, here)
        self._cell, self._margin = seen.cell, seen.margin
        first = self._weight == 0.0
        self._weight = 1.0 if first else min(1.0, self._step_m / config.independent_m)
        self._view_step = keyframes.restart(self._view_step)
        self._step_m, self._turned_rad = 0.0, 0.0
        self._support, self._challenge = config.evidence_memory * self._support, config.evidence_memory * self._challenge
        if self._margin >= config.margin and self._places.usable[self._cell]:
            self._reactivate(self._injection(seen))
        self._confirm(seen.found, here)

    def _here(self) -> IntArray:
        """Cells of the believed place; none without a fix or off the map."""
        if not self._fixed:
            return np.zeros(0, dtype=np.int32)
        return localizer_places.cells_here(self._places, self._belief.pose, _sigma_m(self._belief.covariance))

    def _confirm(self, found: ScoredViews, here: IntArray) -> None:
        """Where the map shows the believed place, the view has to be like it, whatever else it is like."""
        if not self._fixed:
            return
        self._mapped = len(here) > 0 or self._seen == 0.0
        sigma_m = _sigma_m(self._belief.covariance)
        self._astray |= not self._mapped and not localizer_places.is_on_road(self._places, self._belief.pose, sigma_m)
        place = np.minimum(np.searchsorted(found.cells, here), len(found.cells) - 1)
        similarity = found.similarity[place[found.cells[place] == here]]
        if len(similarity) > 0:
            z = float(self._recogniser.z_score(found, float(similarity.max())))
            memory = self._config.seen_memory if self._seen != 0.0 else 0.0
            self._seen = memory * self._seen + (1.0 - memory) * z

    def _injection(self, seen: Recognised) -> Injection:
        noise, pose = self._config.injection, self._recogniser.pose(seen)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        at_end = self._places.end[seen.cell]  # from as far beyond as two cells may be linked, it is still what looks most alike
        along_m = localizer_places.LINK_REACH_M if at_end else noise.along_m
        return Injection(pose, turn @ np.diag([along_m**2, noise.across_m**2, noise.heading_rad**2]) @ turn.T)

    def _reactivate(self, injection: Injection) -> None:
        """Agreement strengthens the incumbent, or the challenger until it wins; anything else starts a new challenge."""
        config, belief, gate = self._config, self._belief, self._config.injection.gate
        if isinstance(belief, PaperPose | LanePose):
            self._belief, self._evidence = belief.inject(injection), self._evidence + self._margin
            self._fixed = self._evidence >= config.fix_evidence
            self._sq_map = self._places.sq_map[self._cell]
        elif self._fixed and (belief.sq_distance(injection) <= gate or is_same_place(belief.pose, injection.pose)):
            self._support_incumbent(belief, injection)
        elif belief.challenged and belief.sq_distance(injection, challenger=True) <= gate:
            self._belief = belief.reinforce(injection)
            self._challenge += self._weight * self._margin
            if self._challenge >= config.fix_evidence + self._support:
                self._belief, self._fixed = self._belief.adopt(), True
                self._support, self._challenge = min(self._challenge, config.fix_evidence), 0.0
                self._sq_map, self._seen, self._astray = self._places.sq_map[self._cell], 0.0, False
        else:
            self._belief, self._challenge = belief.challenge(injection), self._weight * self._margin

    def _support_incumbent(self, belief: AttractorPose | KalmanPose, injection: Injection) -> None:
        """An outlier within the same place counts as much as a view at the gate: Student's weight, Huber's reason."""
        self._sq_across += ACROSS_SHARE * (_sq_across(belief.pose, injection.pose) - self._sq_across)
        excess = max(1.0, belief.sq_distance(injection) / self._config.injection.gate)
        self._belief = belief.inject(Injection(injection.pose, excess * injection.covariance))
        self._support, self._challenge = self._support + self._weight * self._margin, 0.0
        self._support = min(self._support, self._config.fix_evidence)
        self._sq_map, self._astray = self._places.sq_map[self._cell], False

    def _estimate(self, t_s: float) -> LocalizationEstimate:
        belief = self._belief
        status = self._status(_sigma_m(belief.covariance))
        return LocalizationEstimate(
            t_s=t_s,
            pose=belief.pose,
            covariance=belief.covariance + self._sq_map + self._wander(),
            localized=status in (LocalizationStatus.LOCALIZED, LocalizationStatus.OFF_MAP),
            confidence=self._margin,
            view_cell=self._cell,
            **_activity(belief),
            status=status,
        )

    def _wander(self) -> FloatArray:
        """Covariance (3, 3) of what views repeat for tens of metres, across the road: averaging does not take it away.

        Drivers wander in their lanes, which views hardly show; a drifting heading carries the pose along, and views disagree.
        """
        heading_rad = self._belief.pose[2]
        left = np.array([-math.sin(heading_rad), math.cos(heading_rad), 0.0])
        return (self._config.injection.wander_m**2 + self._sq_across) * np.outer(left, left)

    def _status(self, sigma_m: float) -> LocalizationStatus:
        if not self._fixed:
            return LocalizationStatus.UNKNOWN
        if sigma_m >= self._config.lost_sigma_m:
            return LocalizationStatus.LOST
        unseen = self._seen != 0.0 and self._seen < self._config.seen_z and self._config.mode != "paper"
        if self._astray or unseen or self._challenge >= max(self._config.doubt_evidence, self._support):
            return LocalizationStatus.DOUBTED
        return LocalizationStatus.LOCALIZED if self._mapped else LocalizationStatus.OFF_MAP


def _sq_across(pose: FloatArray, seen: FloatArray) -> float:
    """Squared distance (m^2) of a seen pose (3,) from the believed one's line of travel, that of the same place at most."""
    offset = seen[:2] - pose[:2]
    return min(float(offset[1] * math.cos(pose[2]) - offset[0] * math.sin(pose[2])) ** 2, LANE_M**2)


def _sigma_m(covariance: FloatArray) -> float:
    """Standard deviation of the position, the mean over directions."""
    return float(np.sqrt(0.5 * (covariance[0, 0] + covariance[1, 1])))


def _unknown(cognitive_map: CognitiveMap, network: RoadNetwork | None, config: LocalizerConfig) -> PoseBelief:
    """Belief before the first observation: anywhere in the map, self-motion scaled as in the mapping drive."""
    wheel = config.self_motion == "wheel"  # of the same unit in both drives; visual odometry has the camera's height for unit, m
    log_scale = float(np.median(cognitive_map.log_scale)) if wheel and cognitive_map.log_scale is not None else 0.0
    centre_m = np.mean(cognitive_map.poses[:, :2], axis=0)
    if config.mode == "paper":
        return PaperPose.uniform(centre_m, log_scale, config)
    if config.mode == "lanes":
        if network is None:
            raise HippodromeError("localizer mode 'lanes' is a filter on the road network's lanes: give the network (--network)")
        return LanePose.uniform(network, log_scale, config)
    if config.mode == "kalman":
        return KalmanPose.uniform(centre_m, log_scale, config)
    return AttractorPose.uniform(centre_m, log_scale, config)


def _activity(belief: PoseBelief) -> dict[str, FloatArray]:
    """State of the networks; the yardsticks have none."""
    if isinstance(belief, KalmanPose | LanePose):
        heading_rad, sq_heading = belief.pose[2], belief.covariance[2, 2]
        none = np.zeros((0, 2, 2))
        return {
            "head_direction_rad": np.full(2, heading_rad),
            "head_reliability": np.array([1.0 / sq_heading, 0.0]),
            "grid_phase_rad": none,
            "grid_reliability": none,
        }
    return {
        "head_direction_rad": belief.head.mean_rad,
        "head_reliability": belief.head.reliability,
        "grid_phase_rad": belief.grid.mean_rad,
        "grid_reliability": belief.grid.reliability,
    }
