"""Visual localization in a topometric map from an unknown start, III.C of Li et al. 2025.

Each observation moves the pose belief by path integration. When the view has changed enough, its frame is a query frame: it is
scored against the view cells of the map, and the scores are filtered along the paths of the map. If a cell then stands out, its
pose is a measurement. Where it agrees with the belief, it is injected; where it shows another place, it becomes a challenger that
has to win by further evidence.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from hippodrome.core.localization import gyro
from hippodrome.core.localization.beliefs.belief import competes
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement
from hippodrome.core.localization.beliefs.start import start_belief
from hippodrome.core.localization.competition import relation_of, updated
from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.fix import Fix, PlaceCheck, RecognisedView, challenger_wins, checked, faded, recognised, status
from hippodrome.core.localization.paint import PaintSense
from hippodrome.core.localization.places import LINK_REACH_M, cells_around, make_place_map, may_be_on_road
from hippodrome.core.localization.recogniser import PlaceMatch, PlaceRecogniser
from hippodrome.core.localization.road import RoadSense
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
from hippodrome.core.views.odometry import VisualOdometry
from hippodrome.core.views.sequence import Step

__all__ = ["Localizer", "LocalizerConfig", "localize"]

LANE_M = 3.0  # a lateral disagreement counts as at most this: a larger one comes from another place or from a bend
READ_SHARE = (
    0.5  # of lateral errors that a lane which was just read takes away: the rest is the network's, which may be drawn askew
)
UNREAD_AFTER_M = 20.0  # after this way the place in the lane that was read says little of the place in it
NOT_MOVED = Step(0.0, 0.0)


def localize(
    observations: Iterable[Observation],
    cognitive_map: CognitiveMap,
    network: RoadNetwork | None = None,
    config: LocalizerConfig = LocalizerConfig(),
) -> list[LocalizationEstimate]:
    """Localize a whole drive from an unknown start.

    Args:
        observations: the drive, in order of time.
        cognitive_map: a refined map, in the network frame.
        network: the road network of the map; without it poses are not drawn to lanes, and mode "lanes" is not possible.
        config: mode and constants.

    Returns:
        One estimate for each observation.

    Raises:
        HippodromeError: the map is not refined or empty, or does not fit the configuration.
    """
    localizer = Localizer(cognitive_map, network, config)
    return [localizer.step(observation) for observation in observations]


class Localizer:
    """Localization step by step: give ``step`` the observations in order; each answer is the pose so far.

    Args and errors are those of ``localize``.
    """

    def __init__(
        self, cognitive_map: CognitiveMap, network: RoadNetwork | None = None, config: LocalizerConfig = LocalizerConfig()
    ) -> None:
        if cognitive_map.frame != "network" or len(cognitive_map.poses) == 0:
            raise HippodromeError(
                f"localization needs a map in the network frame with vertices, got frame {cognitive_map.frame!r} with "
                f"{len(cognitive_map.poses)} vertices: refine the map first"
            )
        if len(cognitive_map.view_cells.templates) == 0:
            raise HippodromeError(
                "the map has no views: it was made of a drive without frames, and no place in it can be recognised"
            )
        centre_m = np.mean(cognitive_map.poses[:, :2], axis=0)
        self._config = config
        self._places = make_place_map(cognitive_map, network, config.lane_sigma_m, config.injection.map_m)
        self._belief = start_belief(centre_m, _expected_log_scale(cognitive_map, config), network, config)
        self._recogniser = PlaceRecogniser(self._places, config)
        self._odometry = VisualOdometry(config.camera) if config.self_motion == "visual" else None
        self._view_change = keyframes.start()
        self._gyro = gyro.GyroNoise()
        self._since_query = NOT_MOVED  # metres and rad since the last query frame
        self._match: PlaceMatch | None = None  # what the last query frame showed
        self._fix = Fix()
        roads = self._places.roads
        if config.road_reading and roads is None:
            raise HippodromeError(
                "localizer.road_reading compares the lane in the frames with a road network, and none was given: give one, or "
                "set road_reading to false"
            )
        self._road = RoadSense(roads, config.camera) if config.road_reading and roads is not None else None
        self._paint = PaintSense(cognitive_map)
        self._since_frame = NOT_MOVED  # metres and rad since the last frame

    @property
    def metres_per_unit(self) -> float:
        """How long a unit of this drive's self-motion is believed to be; what is expected beforehand, until views tell."""
        return math.exp(self._belief.log_scale)

    def looks_at(self, observation: Observation) -> bool:
        """Whether ``step`` looks at the frame of the next observation. If not, the answers are the same without that frame.

        Args:
            observation: the next one, with its frame or without.
        """
        if self._odometry is not None or (self._road is not None and competes(self._belief)):
            return True
        steps = self._config.steps
        return self._match is None or keyframes.is_due(keyframes.advance(self._view_change, observation, steps), steps)

    def step(self, observation: Observation) -> LocalizationEstimate:
        """Take one observation in and return the estimate at its time.

        The first frame, and every later frame for which the view has changed enough, is searched for in the map.
        """
        observation = observation if self._odometry is None else self._odometry.step(observation)
        self._predict(observation)
        if observation.frame is not None and (self._match is None or keyframes.is_due(self._view_change, self._config.steps)):
            self._query(observation.frame)
        if observation.frame is not None and self._road is not None:
            self._read_road(observation.frame, self._road)
        return self._estimate(observation.t_s)

    def _read_road(self, frame: Frame, road: RoadSense) -> None:
        """Update the belief with what the road ahead tells, once there is a fix that nothing challenges."""
        since, self._since_frame, belief = self._since_frame, NOT_MOVED, self._belief
        if not self._fix.adopted or not competes(belief) or belief.challenged:
            return
        measurement = road.measure(frame, since.length, since.turn_rad, belief.pose, belief.covariance)
        if measurement is not None:
            belief = belief.inject(measurement)
        along = self._paint.measure(road.paint, belief.pose, belief.covariance)
        self._belief = belief if along is None else belief.inject(along)

    def _predict(self, observation: Observation) -> None:
        """Move the belief by the observed self-motion, with the gyro noise that the signal itself shows."""
        travelled, turned_rad = observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s
        self._view_change = keyframes.advance(self._view_change, observation, self._config.steps)
        least_radps = self._config.motion.gyro_rad_per_sqrt_s / math.sqrt(observation.dt_s)
        self._gyro = gyro.update(self._gyro, observation.yaw_rate_radps, least_radps)
        walk = self._gyro.sigma_radps * math.sqrt(observation.dt_s)
        self._belief = self._belief.predict(Motion(travelled, turned_rad, observation.dt_s, walk))
        travelled_m = travelled * math.exp(self._belief.log_scale)
        self._since_query = Step(self._since_query.length + travelled_m, self._since_query.turn_rad + turned_rad)
        if self._road is not None:
            self._road.move(travelled_m)
            self._paint.move(travelled_m)
            self._since_frame = Step(self._since_frame.length + travelled_m, self._since_frame.turn_rad + turned_rad)

    def _query(self, frame: Frame) -> None:
        """Recognise the place that a query frame shows, and update belief and fix with it.

        The cells of the believed place are taken before the belief is updated, so that the frame is compared with what was
        believed without it.
        """
        config, believed = self._config, self._believed_cells()
        match = self._recogniser.recognise(frame, self._since_query, believed)
        weight = 1.0 if self._match is None else min(1.0, abs(self._since_query.length) / config.independent_m)
        self._match, self._since_query = match, NOT_MOVED
        self._view_change = keyframes.restart(self._view_change)
        self._fix = faded(self._fix, config)
        if match.margin >= config.margin and self._places.usable[match.cell]:
            self._take(self._measurement(match), match, weight)
        if self._fix.adopted:
            self._fix = checked(self._fix, self._place_check(match, believed), config)

    def _believed_cells(self) -> IntArray:
        """Return the cells around the believed pose; none without a fix, or where the map does not reach."""
        if not self._fix.adopted:
            return np.zeros(0, dtype=np.int32)
        return cells_around(self._places, self._belief.pose, _sigma_m(self._belief.covariance))

    def _measurement(self, match: PlaceMatch) -> PoseMeasurement:
        """Turn the match of a query frame into a measured pose, whose covariance is aligned with the heading of the cell.

        Once the vehicle has driven past the end of a mapped road, the last cell of the road still looks most alike. Its error
        along the road may therefore be as large as the longest link between two cells.
        """
        noise, pose = self._config.injection, self._recogniser.pose(match)
        along_m = LINK_REACH_M if self._places.at_end[match.cell] else noise.along_m
        if self._road is not None:
            along_m *= self._road.distrust()
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return PoseMeasurement(pose, turn @ np.diag([along_m**2, noise.across_m**2, noise.heading_rad**2]) @ turn.T)

    def _take(self, measurement: PoseMeasurement, match: PlaceMatch, weight: float) -> None:
        """Update the belief with a measured pose, and ``_fix``, the evidence about the believed place, with the view's.

        If the belief can hold a challenger, a pose that agrees with the incumbent or the challenger updates that one; a pose
        that conflicts becomes the challenger. ``match`` gives the margin of the view and the cell, and so the map's error there.
        ``weight`` (0 to 1) discounts a frame that was taken close to the one before it, since the two show nearly the same.
        """
        config, belief, gate = self._config, self._belief, self._config.injection.gate
        sq_distance = belief.sq_distance(measurement) if self._fix.adopted and competes(belief) else None
        relation = relation_of(measurement, belief, self._fix.adopted, gate, sq_distance)
        sq_lateral_m2 = _sq_lateral_m2(belief.pose, measurement.pose)
        view = RecognisedView(relation, match.margin, weight, self._places.map_covariance[match.cell], sq_lateral_m2)
        self._belief = updated(belief, measurement, relation, challenger_wins(self._fix, view, config), gate, sq_distance)
        self._fix = recognised(self._fix, view, config)

    def _place_check(self, match: PlaceMatch, believed: IntArray) -> PlaceCheck:
        """Check whether the map covers the believed place, and whether the query frame looks like it.

        ``believed`` (K,) are the cells around the pose that was believed before the frame. If there are none, the map does not
        reach there, and it is checked whether the pose can at least be on a road of the network.
        """
        pose, sigma_m = self._belief.pose, _sigma_m(self._belief.covariance)
        on_map = len(believed) > 0
        scored = match.scored
        row = np.minimum(np.searchsorted(scored.cells, believed), len(scored.cells) - 1)  # scored cells are in ascending order
        similarity = scored.similarity[row[scored.cells[row] == believed]]
        return PlaceCheck(
            on_map=on_map,
            may_be_on_road=on_map or may_be_on_road(self._places, pose, sigma_m),
            z_score=float(self._recogniser.z_score(scored, float(similarity.max()))) if len(similarity) > 0 else None,
        )

    def _estimate(self, t_s: float) -> LocalizationEstimate:
        """Return the estimate at ``t_s``: the believed pose, its covariance, and the status of the fix.

        To the covariance of the belief are added the errors that successive views share, so that averaging over views cannot
        reduce them: those of the map and the lateral ones.
        """
        pose, covariance = self._belief.pose, self._belief.covariance
        state = status(self._fix, _sigma_m(covariance), self._config)
        activity = self._belief.activity()
        return LocalizationEstimate(
            t_s=t_s,
            pose=pose,
            covariance=covariance + self._fix.map_covariance + self._lateral_covariance(pose[2]),
            localized=state in (LocalizationStatus.LOCALIZED, LocalizationStatus.OFF_MAP),
            confidence=0.0 if self._match is None else self._match.margin,
            view_cell=-1 if self._match is None else self._match.cell,
            head_direction_rad=activity.head_direction_rad,
            head_reliability=activity.head_reliability,
            grid_phase_rad=activity.grid_phase_rad,
            grid_reliability=activity.grid_reliability,
            status=state,
        )

    def _lateral_covariance(self, heading_rad: float) -> FloatArray:
        """Return the covariance (3, 3) of lateral errors that averaging over views cannot reduce.

        Such errors stay the same for tens of metres. One is the driver's wander within the lane, which views hardly show. The
        other arises where a drifting heading pulls the pose aside: it is measured by how far views and belief disagree laterally.
        """
        left = np.array([-math.sin(heading_rad), math.cos(heading_rad), 0.0])
        unread = 1.0 if self._road is None else 1.0 - READ_SHARE * math.exp(-self._road.since_m / UNREAD_AFTER_M)
        return unread * (self._config.injection.wander_m**2 + self._fix.sq_lateral_m2) * np.outer(left, left)


def _sq_lateral_m2(believed: FloatArray, measured: FloatArray) -> float:
    """Squared distance of a measured pose (3,) from the line of travel through the believed one, at most ``LANE_M`` squared."""
    east_m, north_m = measured[:2] - believed[:2]
    return min(float(north_m * math.cos(believed[2]) - east_m * math.sin(believed[2])) ** 2, LANE_M**2)


def _sigma_m(covariance: FloatArray) -> float:
    """Standard deviation of the position in metres, as the root mean square over both axes."""
    return float(np.sqrt(0.5 * (covariance[0, 0] + covariance[1, 1])))


def _expected_log_scale(cognitive_map: CognitiveMap, config: LocalizerConfig) -> float:
    """Return the ln(metres per map unit) that this drive is expected to have before anything is known of it.

    Wheel odometry has the same unit in the mapping drive and in this one, so that the median scale of the map is expected. Visual
    odometry measures in metres, since it knows the height of the camera, so that its log scale is 0.
    """
    if config.self_motion == "visual" or cognitive_map.log_scale is None:
        return 0.0
    return float(np.median(cognitive_map.log_scale))
