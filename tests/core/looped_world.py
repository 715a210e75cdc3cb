"""A closed street whose every place looks unlike the others: frames blend random pictures along the way. No renderer needed."""

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import (
    AttractorStates,
    CognitiveMap,
    Edges,
    Observation,
    ViewCells,
    Visits,
)
from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.scoring import template_mean

CORNER_M, STRAIGHT_M = 20.0, (220.0, 160.0)  # radius of the corners, lengths of the sides between them
PICTURE_SPACING_M = 4.0


def loop_length():
    return 2.0 * sum(STRAIGHT_M) + 2.0 * np.pi * CORNER_M


def loop_pose(s_m):
    """Pose (3,) at arc length ``s_m`` of a rounded rectangle, driven counter-clockwise from its lower left corner."""
    s, pose = s_m % loop_length(), np.zeros(3)
    for side in range(4):
        straight, arc = STRAIGHT_M[side % 2], 0.5 * np.pi * CORNER_M
        if s <= straight:
            return se2.compose(pose, np.array([s, 0.0, 0.0]))
        pose, s = se2.compose(pose, np.array([straight, 0.0, 0.0])), s - straight
        turn = min(s, arc) / CORNER_M
        corner = np.array([CORNER_M * np.sin(turn), CORNER_M * (1.0 - np.cos(turn)), turn])
        if s <= arc:
            return se2.compose(pose, corner)
        pose, s = se2.compose(pose, corner), s - arc
    return pose


class Pictures:
    """Frames (60, 80) along the loop. ``seed`` is the town's."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.count = round(loop_length() / PICTURE_SPACING_M)
        coarse = rng.uniform(0.0, 255.0, (self.count, 15, 20))
        self.pictures = np.kron(coarse, np.ones((4, 4)))

    def frame(self, s_m, rng, noise=6.0):
        place = (s_m % loop_length()) / loop_length() * self.count
        low = int(place)
        share = place - low
        picture = (1.0 - share) * self.pictures[low % self.count] + share * self.pictures[(low + 1) % self.count]
        return np.clip(picture + noise * rng.standard_normal(picture.shape), 0, 255).astype(np.uint8)


def topometric_map(pictures, rng, spacing_m=5.0, pose_noise_m=0.3, metres_per_unit=2.0, span_m=None):
    """A refined map of the loop: true poses with noise, one view cell per vertex."""
    s = np.arange(0.0, span_m or loop_length(), spacing_m)
    poses = np.array([loop_pose(x) for x in s])
    poses[:, :2] += pose_noise_m * rng.standard_normal((len(s), 2))
    config = ViewCellConfig()
    templates = np.array([describe(pictures.frame(x, rng), config) for x in s])
    motion = np.zeros((len(s), 3))
    motion[1:] = se2.between(poses[:-1], poses[1:]) / [metres_per_unit, metres_per_unit, 1.0]
    index = np.arange(len(s), dtype=np.int32)
    no_edges = Edges(index[:0], index[:0], motion[:0], motion[:0], np.zeros(0, np.uint8), np.zeros(0, np.float32))
    silent = AttractorStates(
        np.zeros((len(s), 2), np.float32), np.zeros((len(s), 2), np.float32), np.zeros(0, np.float32),
        np.zeros((len(s), 0, 2, 2), np.float32), np.zeros((len(s), 0, 2, 2), np.float32),
    )  # fmt: skip
    return CognitiveMap(
        frame="network",
        t_s=s / 8.0,
        poses=poses,
        view_cell=index,
        view_cells=ViewCells("gradient", templates, template_mean("gradient", templates), config.shape),
        edges=no_edges,
        visits=Visits(s / 8.0, index, motion),
        attractors=silent,
        log_scale=np.full(len(s), np.log(metres_per_unit)),
    )


def drive(pictures, rng, start_m, length_m, metres_per_unit=2.0, speed_mps=8.0, rate_hz=10.0, frame_every=2, kidnap=None):
    """Observations and true poses of a drive; ``kidnap`` = (after_m, to_m) moves the vehicle without telling it."""
    observations, truth, s, dt_s = [], [], start_m, 1.0 / rate_hz
    turns = 0.0
    for i in range(round(length_m / speed_mps * rate_hz)):
        if kidnap is not None and i == round(kidnap[0] / speed_mps * rate_hz):
            s = kidnap[1]
        before, s = loop_pose(s), s + speed_mps * dt_s
        after = loop_pose(s)
        turned = float(se2.wrap(after[2] - before[2]))
        turns += turned
        speed = speed_mps / metres_per_unit * (1.0 + 0.03 * rng.standard_normal() / np.sqrt(dt_s) * 0.3)
        yaw_rate = turned / dt_s + 0.005 / np.sqrt(dt_s) * rng.standard_normal()
        frame = pictures.frame(s, rng) if (i + 1) % frame_every == 0 else None
        observations.append(Observation((i + 1) * dt_s, dt_s, speed, yaw_rate, frame))
        truth.append(after)
    return observations, np.array(truth)
