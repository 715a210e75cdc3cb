"""Real drives to measure on: KITTI's over OpenStreetMap's roads, where they lie beside the checkout."""

from __future__ import annotations

import gzip
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, Observation, Trajectory, Visits
from hippodrome.eval.exchange.drives.foreign import motion_of
from hippodrome.eval.exchange.drives.lever import at_axle, lever_of
from hippodrome.sim.network import read_network

REAL = Path(__file__).parents[1].parent / "shared" / "real"  # data of others, which is no part of the project
ABSENT = "no drives there (KITTI's over OpenStreetMap's roads, whose licences forbid to copy them): nothing is measured"
FRAME_S = 0.1037  # between KITTI's frames
DRIVES = (  # name, self-motion, its file, sequence
    ("00", "the truth's", "00.txt.gz", "00"),
    ("05", "the truth's", "05.txt.gz", "05"),
    ("09", "the truth's", "09.txt.gz", "09"),
    ("00 stereo", "stereo ORB-SLAM", "KITTI_00_ORB.txt.gz", "00"),
    ("09 mono", "a learned monocular odometry", "vo_example1_09.txt.gz", "09"),
)


@dataclass(frozen=True, slots=True, eq=False)
class RealDrive:
    """A semi-metric map made of self-motion alone, and where its vertices really were."""

    name: str
    sequence: str  # the network that it was driven in
    cognitive_map: CognitiveMap
    true_poses: FloatArray  # (S, 3) rear axle, in the network's frame

    @property
    def visits(self) -> Visits:
        """The raw motions."""
        return self.cognitive_map.visits

    def with_visits(self, visits: Visits) -> RealDrive:
        """The drive with other raw motions."""
        return replace(self, cognitive_map=replace(self.cognitive_map, visits=visits))

    @property
    def true_steps_m(self) -> FloatArray:
        """True lengths (S - 1,) of the steps from each keyframe to the next."""
        steps: FloatArray = np.hypot(*np.diff(self.true_poses[:, :2], axis=0).T)
        return steps


def read_drives(folder: Path) -> tuple[list[RealDrive], dict[str, RoadNetwork]]:
    """The drives that a folder holds, and the networks by their sequences."""
    kitti = folder / "kitti" if (folder / "kitti").is_dir() else folder
    drives = [
        _read_drive(kitti, name, kitti / file, sequence)
        for name, _, file, sequence in DRIVES
        if (kitti / file).exists() and (kitti / f"truth{sequence}.npy").exists()
    ]
    return drives, {s: read_network(kitti / f"k{s}.net.xml.gz") for s in sorted({drive.sequence for drive in drives})}


def _read_drive(kitti: Path, name: str, odometry: Path, sequence: str) -> RealDrive:
    """The drive, at the rear axle: the camera's lever is taken out of self-motion and truth, as ``hippodrome import`` does."""
    estimated, laid = _poses(odometry), np.load(kitti / f"truth{sequence}.npy")
    t_s = FRAME_S * np.arange(len(laid))
    truth = Trajectory(t_s, laid)
    truth = at_axle(truth, lever_of(truth, "auto", name).ahead)
    seen = Trajectory(t_s[: len(estimated)], estimated)
    motion = motion_of(at_axle(seen, lever_of(seen, "auto", name).ahead), name)
    mapper = MotionMapper()
    for t, speed, yaw_rate in zip(motion.t_s, motion.speed, motion.yaw_rate_radps, strict=True):
        mapper.step(Observation(float(t), FRAME_S, float(speed), float(yaw_rate), None))
    made = mapper.finish()
    return RealDrive(name, sequence, made, truth.poses[np.searchsorted(t_s, made.t_s - 1e-6)])


def _poses(path: Path) -> FloatArray:
    """Planar poses (N, 3) of KITTI's camera, which looks ahead along z with y down."""
    rows = np.loadtxt(io.BytesIO(gzip.decompress(path.read_bytes()))).reshape(-1, 3, 4)
    ahead = rows[:, :, 2]
    return np.column_stack([rows[:, 2, 3], -rows[:, 0, 3], np.arctan2(-ahead[:, 0], ahead[:, 2])])


def scaled(drive: RealDrive, log_scale: FloatArray) -> RealDrive:
    """The drive with each step (S - 1,) made longer by exp(log_scale)."""
    motion = drive.visits.motion.copy()
    motion[1:, :2] *= np.exp(log_scale)[:, None]
    return drive.with_visits(replace(drive.visits, motion=motion))
