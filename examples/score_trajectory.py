"""Score any trajectory, of any method, against a ground truth: the harness's figures, which agree with evo's.

    python score_trajectory.py ESTIMATE.tum TRUTH.tum

Each line of a TUM file is `t_s x y z qx qy qz qw`; `hippodrome eval` writes one for the truth and for each method.
"""

import sys
from pathlib import Path

import numpy as np

from hippodrome import Trajectory, ape, rpe


def read_tum(path: Path) -> Trajectory:
    """A planar trajectory: x, y and the rotation about the vertical."""
    t_s, x, y, _, qx, qy, qz, qw = np.loadtxt(path, ndmin=2).T
    heading_rad = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy**2 + qz**2))
    return Trajectory(t_s, np.column_stack([x, y, heading_rad]))


def main(estimate_file: Path, truth_file: Path) -> None:
    estimate, truth = read_tum(estimate_file), read_tum(truth_file)
    for alignment in ("none", "start", "se2", "sim2"):
        score = ape(estimate, truth, alignment)
        print(f"APE {score.mean_m:8.3f} m in the mean, {score.max_m:8.3f} m at worst: {score.definition}")
    score = rpe(estimate, truth, delta_m=20.0)
    print(f"RPE {score.mean_m:8.3f} m in the mean, {score.max_m:8.3f} m at worst: {score.definition}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
