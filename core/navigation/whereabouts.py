"""Where the vehicle may be, while it is not known: hypotheses all over the road network, thinned out by what is sensed.

The particles themselves are in ``hypotheses``. Here they are begun, weighed by what ``Senses`` makes of the frames, renewed where
few of them carry the weight, and asked: which places are left, and how much speaks for the likeliest of them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.navigation import hypotheses as hyp
from hippodrome.core.navigation.glance import ground_cost, ground_points, mean_rad, segment_at
from hippodrome.core.navigation.paving import Paving, paving
from hippodrome.core.navigation.places import Place
from hippodrome.core.navigation.placing import lane_of, opposite_lanes
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.track import STOP_LINE_BEFORE_END_M
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, IntArray

SPACING_M: Final = 1.0  # between the particles at the beginning ..
MOST, LEAST = 8000, 500  # .. and the most of them, and the least later
ROOM: Final = 2000  # for those that split
PER_BIN, BIN_M = 15, 2.0  # later there are so many for each stretch of lane on which there are any
LOOK_EVERY_M: Final = 1.0  # the ground is compared so often ..
GROUND_PER_M: Final = 0.06  # .. and each point of it counts so much per metre: it is seen over and over again
READ_SIGMA_M, READ_GATE_M, READ_GATE_RAD, READ_GAIN, READ_WEIGHT = 0.4, 1.2, 0.35, 0.2, 0.15
END_SIGMA_M, END_OUTLIER, END_WEIGHT = 0.8, 0.2, 0.3
TOLD_M, TOLD_RAD, TOLD_OUTLIER, TOLD_PER_M = 1.5, 0.3, 0.02, 0.4  # of the localizer's pose, whose errors repeat
UNTHOUGHT, RESET, RESET_COUNT = 0.02, 0.05, 200  # where a recognised view has less of the weight, so much begins there anew
HELD: Final = 0.5  # and so much at the pose that is steered by, where all begin anew
SURE_M2: Final = 0.05  # variance of an offset in the lane that is taken in
JITTER: Final = (0.15, 0.15, 0.006, 0.15)  # of renewed particles: m, m, rad, and standard deviations of the scale
WIDE, WIDE_EVERY = 6.0, 10  # of every so many renewed ones one gets so much more, in case all are a little wrong
LEAST_SCALE_SIGMA: Final = 0.08  # of ln(scale): dashes that were counted wrongly are worse than they know
SCALE_MEMORY_M: Final = 60.0  # over which a scale is forgotten
LOST, LOST_PER_M = 0.75, 0.15  # the ground as the likeliest place has it, averaged over some 7 m: below that all are wrong
CLUSTER_M, CLUSTER_RAD = 5.0, 0.7  # particles so near to one another are of one place
LEAST_POINTS: Final = 20  # of the ground, which must be known
SPREAD: Final = (2.0, 2.0, 0.06)  # m, m, rad: how far off all may be that are beside the road
SEED: Final = 17


class Whereabouts:
    """The hypotheses of the vehicle's place.

    Args:
        roads: the network.
        seed: of the particles: the same seed and the same observations give the same places.
    """

    def __init__(self, roads: RoadGeometry, seed: int = SEED) -> None:
        self._roads, self._seed = roads, seed
        self._paving: Paving = paving(roads.network)
        self._cost = ground_cost()
        self._grid = ground_points()
        network = roads.network
        self._lanes = (
            roads.segment_lane, roads.segment_start, roads.segment_begin_m, roads.segment_direction, roads.segment_length_m,
            roads.segment_position_m, network.successor.astype(np.int32), network.successor_start.astype(np.int32),
            network.left_lane.astype(np.int32), network.right_lane.astype(np.int32), network.width_m.astype(np.float64),
            roads.lane_length_m,
        )  # fmt: skip
        self._opposite = np.array(opposite_lanes(roads), dtype=np.int32)
        self.restarts = 0
        self.begin()

    def begin(self, offset_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Begin anew: the vehicle may be anywhere, beside the middle of a lane by an offset and turned against it."""
        self._rng = np.random.default_rng(self._seed)
        lengths = self._roads.lane_length_m
        wanted = min(max(int(lengths.sum() / SPACING_M), LEAST), MOST)
        at_m = (np.arange(wanted) + 0.5) / wanted * float(lengths.sum())
        ends = np.cumsum(lengths)
        lane = np.minimum(np.searchsorted(ends, at_m, side="right"), len(lengths) - 1)
        position = np.clip(at_m - (ends - lengths)[lane], 0.0, lengths[lane])
        poses = poses_on_segments(self._roads, lane, position)
        self._rows = np.zeros((wanted + ROOM, hyp.COLUMNS))
        self._segments: IntArray = np.zeros(wanted + ROOM, dtype=np.int32)
        self._count = self._first = wanted
        rows = self._rows[:wanted]
        rows[:, hyp.X] = poses[:, 0] - offset_m * np.sin(poses[:, 2])
        rows[:, hyp.Y] = poses[:, 1] + offset_m * np.cos(poses[:, 2])
        rows[:, hyp.HEADING] = wrap(poses[:, 2] + heading_rad)
        rows[:, hyp.SCALE] = self._rng.standard_normal(wanted)
        rows[:, hyp.ALONG], rows[:, hyp.ASIDE], rows[:, hyp.TURN] = position, offset_m, heading_rad
        self._segments[:wanted] = segment_at(self._roads, lane, position)
        self._agreement = np.ones(wanted + ROOM)
        self.fits = 1.0
        self._since_look_m = self.driven_m = 0.0
        self._phase, self._scale_sigma = 0, LEAST_SCALE_SIGMA

    @property
    def count(self) -> int:
        """How many particles there are."""
        return self._count

    @property
    def log_scale(self) -> float:
        """By how much the particles' scale differs from the one that their metres were measured with: ln of the ratio."""
        return self._scale_sigma * float(self._shares() @ self._rows[: self._count, hyp.SCALE])

    def step(
        self,
        distance_m: float,
        turned_rad: float,
        senses: Senses,
        scale_sigma: float,
        told: FloatArray | None = None,
        held: FloatArray | None = None,
    ) -> None:
        """Take a step of the vehicle in.

        Args:
            distance_m: driven.
            turned_rad: meanwhile.
            senses: what is sensed.
            scale_sigma: standard deviation of ln(scale).
            told: (3,) the pose by the localizer, where it recognised a view.
            held: (3,) the pose that is steered by, if there is one.
        """
        if distance_m == 0.0 and turned_rad == 0.0:
            return
        self.driven_m += abs(distance_m)
        self._since_look_m += abs(distance_m)
        self._scale_sigma = max(scale_sigma, LEAST_SCALE_SIGMA)
        self._count = hyp.move(self._rows, self._segments, self._count, distance_m, turned_rad, self._scale_sigma, *self._lanes)
        if senses.reading is not None and distance_m != 0.0:
            self._read(senses.reading)
        if self._since_look_m >= LOOK_EVERY_M:
            self._wander(self._since_look_m)
            if told is not None:
                weight = TOLD_PER_M * self._since_look_m
                hyp.weigh_by_pose(self._rows, self._count, told, TOLD_M, TOLD_RAD, TOLD_OUTLIER, weight)
                if self.about(told, CLUSTER_M)[0] < UNTHOUGHT:
                    self._reset_to(told, RESET)
            if self._look(senses, self._since_look_m):
                self._doubt(senses, self._since_look_m, held)
            self._since_look_m = 0.0
            self._renew()

    def turn_round(self) -> None:
        """The vehicle has turned round: what has turned against its lane is on the lane of the opposite direction."""
        lanes = self._roads.segment_lane, self._roads.segment_start, *self._lanes[2:6], self._opposite, self._roads.lane_length_m
        hyp.turn_round(self._rows, self._segments, self._count, *lanes)

    def move_aside(self, aside_m: float) -> None:
        """Move all hypotheses to the left of their headings."""
        hyp.move_aside(self._rows[: self._count], aside_m)

    def spread(self) -> None:
        """Let each hypothesis be some metres off: the vehicle is beside the road, where none of the likely ones has it."""
        self._rows[: self._count, :3] += self._rng.standard_normal((self._count, 3)) * SPREAD
        self._rows[: self._count, hyp.WEIGHT] = 0.0
        self.fits = 1.0

    def _read(self, reading: RoadReading) -> None:
        """Weigh by the lane that was read."""
        internal, lanes = self._roads.network.is_internal, self._roads.segment_lane
        if reading.offset_variance_m2 < SURE_M2 and math.isfinite(reading.heading_rad):
            hyp.correct_by_lane(
                self._rows, self._segments, self._count, lanes, internal, self._roads.segment_direction, reading.offset_m,
                reading.heading_rad, READ_SIGMA_M, READ_GATE_M, READ_GATE_RAD, READ_GAIN, READ_WEIGHT,
            )  # fmt: skip
        if reading.end is not LaneEnd.NOTHING and math.isfinite(reading.end_m):
            end_m = reading.end_m + (STOP_LINE_BEFORE_END_M if reading.end is LaneEnd.STOP_LINE else 0.0)
            sigma_m = math.hypot(END_SIGMA_M, math.sqrt(min(reading.end_variance_m2, 100.0)))
            hyp.weigh_by_end(
                self._rows, self._segments, self._count, lanes, internal, self._roads.lane_length_m, end_m, sigma_m,
                END_OUTLIER, END_WEIGHT,
            )  # fmt: skip

    def _reset_to(self, pose: FloatArray, reset: float) -> None:
        """Begin hypotheses of some weight at a pose, whoever has it: sensor resetting (Lenser, Veloso, ICRA 2000)."""
        place = lane_of(self._roads, pose)
        if place is None or self._count < 2 * RESET_COUNT:
            return
        logs = self._rows[: self._count, hyp.WEIGHT]
        lightest = np.argpartition(logs, RESET_COUNT)[:RESET_COUNT]
        rest = float(np.exp(np.delete(logs, lightest) - logs.max()).sum())
        scatter = self._rng.standard_normal((RESET_COUNT, 4)) * (TOLD_M, 0.5 * TOLD_M, 0.2 * TOLD_RAD, 1.0)
        rows = hyp.scattered(pose, scatter, place.position_m, place.offset_m, place.heading_rad)
        rows[:, hyp.WEIGHT] = logs.max() + math.log(reset / (1.0 - reset) * rest / RESET_COUNT)
        self._rows[lightest] = rows
        self._segments[lightest] = segment_at(self._roads, np.array([place.lane]), np.array([place.position_m]))[0]
        self._agreement[lightest] = self.fits

    def _wander(self, driven_m: float) -> None:
        """Let the scales wander, as that of the odometry does: an Ornstein-Uhlenbeck process that keeps its spread."""
        kept = math.exp(-driven_m / SCALE_MEMORY_M)
        scale = self._rows[: self._count, hyp.SCALE]
        scale *= kept
        scale += math.sqrt(1.0 - kept**2) * self._rng.standard_normal(self._count)

    def _look(self, senses: Senses, driven_m: float) -> bool:
        """Weigh by the ground; whether there is enough of it in sight."""
        self._phase = 1 - self._phase
        points = self._grid[self._phase]
        kinds = senses.ground.kinds_at(points)
        known = (kinds == 1) | (kinds == 2)
        if known.sum() < LEAST_POINTS:
            return False
        hyp.see(
            self._rows, self._count, np.ascontiguousarray(points[known]), np.ascontiguousarray(kinds[known]), 2,
            self._paving.levels, self._paving.corner_m, self._paving.cell_m, self._cost, GROUND_PER_M * driven_m,
            self._agreement,
        )  # fmt: skip
        return True

    def _doubt(self, senses: Senses, driven_m: float, held: FloatArray | None) -> None:
        """Begin anew where not even the likeliest have the ground so. It may be misread in fog: half begin where it was."""
        self.fits += min(LOST_PER_M * driven_m, 1.0) * (float(self._shares() @ self._agreement[: self._count]) - self.fits)
        if self.fits < LOST:
            memory = senses.memory
            self.begin(*((memory.offset_m, memory.heading_rad) if memory.is_fresh else (0.0, 0.0)))
            self.restarts += 1
            if held is not None:
                self._reset_to(held, HELD)

    def _shares(self) -> FloatArray:
        """The weights (n,), adding up to 1."""
        logs = self._rows[: self._count, hyp.WEIGHT]
        share = np.exp(logs - logs.max())
        total: FloatArray = share / share.sum()
        return total

    def _renew(self) -> None:
        """Resample where few particles carry the weight."""
        share = self._shares()
        self._rows[: self._count, hyp.WEIGHT] -= self._rows[: self._count, hyp.WEIGHT].max()
        if 1.0 / float(share @ share) > 0.5 * self._count and self._count <= self._first:
            return
        heavy = share > 1e-3 / len(share)
        bins = np.unique(self._segments[: self._count][heavy].astype(np.int64) * 4096
                         + (self._rows[: self._count, hyp.ALONG][heavy] / BIN_M).astype(np.int64))  # fmt: skip
        wanted = min(max(PER_BIN * len(bins), LEAST), self._first)
        chosen = hyp.resampled(self._rows, self._segments, share, wanted, float(self._rng.random()))
        rows, segments = self._rows[chosen], self._segments[chosen]
        again = np.concatenate([[False], chosen[1:] == chosen[:-1]])
        noise = self._rng.standard_normal((wanted, 4)) * JITTER
        noise[np.arange(wanted) % WIDE_EVERY == 0] *= WIDE
        for k, column in enumerate((hyp.X, hyp.Y, hyp.HEADING, hyp.SCALE)):
            rows[again, column] += noise[again, k]
        rows[:, hyp.WEIGHT] = 0.0
        self._agreement[:wanted] = self._agreement[chosen]
        self._rows[:wanted], self._segments[:wanted], self._count = rows, segments, wanted

    def sample(self, count: int) -> FloatArray:
        """Poses (count, 3) that stand for all of the weight in equal parts."""
        chosen = hyp.resampled(self._rows, self._segments, self._shares(), count, 0.5)
        poses: FloatArray = self._rows[chosen, :3]
        return poses

    def best(self) -> Place:
        """The likeliest place: about the heaviest cell of a grid, all that is near."""
        share, rows = self._shares(), self._rows[: self._count]
        cells = np.floor(rows[:, :2] / CLUSTER_M).astype(np.int64)
        quarter = np.floor((rows[:, hyp.HEADING] + math.pi) / (0.5 * math.pi)).astype(np.int64) % 4
        key = (cells[:, 0] * 100_003 + cells[:, 1]) * 4 + quarter
        inverse = np.unique(key, return_inverse=True)[1]
        heaviest = int(np.argmax(np.bincount(inverse, weights=share)))
        mine = inverse == heaviest
        centre = np.array([*(share[mine] @ rows[mine, :2] / share[mine].sum()), mean_rad(rows[mine, hyp.HEADING], share[mine])])
        return self.near(centre, share)

    def about(self, pose: FloatArray, reach_m: float) -> tuple[float, float]:
        """Share of the weight within ``reach_m`` of a pose, and its standard deviation along the pose's heading (m)."""
        share, apart = self._shares(), self._rows[: self._count, :2] - pose[:2]
        turned = np.abs(wrap(self._rows[: self._count, hyp.HEADING] - pose[2]))
        mine = share * ((np.hypot(*apart.T) < reach_m) & (turned < CLUSTER_RAD))
        if (total := float(mine.sum())) <= 0.0:
            return 0.0, math.inf
        along = apart @ np.array([math.cos(pose[2]), math.sin(pose[2])])
        return total, math.sqrt(max(float(mine @ along**2) / total - (float(mine @ along) / total) ** 2, 0.0))

    def near(self, pose: FloatArray, share: FloatArray | None = None) -> Place:
        """The place of all the particles about a pose."""
        share, rows = self._shares() if share is None else share, self._rows[: self._count]
        centre = pose
        for _ in range(2):
            apart = rows[:, :2] - centre[:2]
            turned = wrap(rows[:, hyp.HEADING] - centre[2])
            mine = (np.einsum("ij,ij->i", apart, apart) < CLUSTER_M**2) & (np.abs(turned) < CLUSTER_RAD)
            total = float(share[mine].sum())
            if total <= 0.0:
                return Place(pose, np.diag([CLUSTER_M**2, CLUSTER_M**2, 1.0]), 0.0, 0.0)
            part = share[mine] / total
            mean = part @ np.column_stack([apart[mine], turned[mine]])
            centre = centre + mean
        off = np.column_stack([rows[mine, :2] - centre[:2], wrap(rows[mine, hyp.HEADING] - centre[2])])
        covariance = (part[:, None] * off).T @ off
        agreement = float(part @ self._agreement[: self._count][mine])
        return Place(np.array([centre[0], centre[1], wrap(centre[2])]), covariance, total, agreement)
