"""``hippodrome score``: a map or a trajectory against the truth of a recording, ours or imported."""

from __future__ import annotations

from pathlib import Path

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.exported import truth_of
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.materials import RPE_DELTA_M
from hippodrome.eval.metrics.alignment import AlignmentName
from hippodrome.eval.metrics.trajectory import Score, ape, rpe
from hippodrome.proto.codec import load_map
from hippodrome.sim.recording import open_recording

MIN_COVERAGE = 0.5  # foreign truth often begins late or ends early; how much was scored is printed


def score_files(estimate: Path, recording: Path, network_frame: bool) -> None:
    """Print APE and RPE of an estimate with their definitions.

    Args:
        estimate: A map (.pbstream) or a TUM trajectory.
        recording: The recording whose truth it is held against.
        network_frame: Whether a TUM trajectory is given in the truth's frame, so that it needs no alignment.

    Raises:
        HippodromeError: A file cannot be read, the recording has no truth, or too little of it was estimated.
    """
    drive = open_recording(recording)
    if (truth := truth_of(drive)) is None:
        raise ExchangeError(f"{recording}: this drive was imported without truth, so there is nothing to score with")
    trajectory, metric = _estimate(estimate, network_frame)
    same_frame = metric and drive.manifest.get("truth_frame", "network") == "network"
    alignments: tuple[AlignmentName, ...] = ("none",) if same_frame else ("se2",) if metric else ("start", "se2", "sim2")
    for alignment in alignments:
        _say(ape(trajectory, truth, alignment, min_coverage=MIN_COVERAGE))
    for delta_m in (None, RPE_DELTA_M):
        try:
            _say(rpe(trajectory, truth, delta_m, min_coverage=MIN_COVERAGE))
        except HippodromeError as error:  # a drive shorter than the delta
            print(f"not scored: {error}")


def _estimate(path: Path, network_frame: bool) -> tuple[Trajectory, bool]:
    """The trajectory and whether it is metric, in the network's frame."""
    if path.suffix == ".pbstream":
        found = load_map(path)[0]
        return Trajectory(found.t_s, found.poses), found.frame == "network"
    return read_tum(path), network_frame


def _say(score: Score) -> None:
    print(f"mean {score.mean_m:.3f} m, median {score.median_m:.3f}, p95 {score.p95_m:.3f}, max {score.max_m:.3f}, "
          f"{score.matched} of {score.total} samples: {score.definition}")  # fmt: skip
