"""A map from your own frames and odometry, laid on a road network of yours.

    python own_frames.py FOLDER town.net.xml

FOLDER holds two tables, as the TUM data sets have them; lines that begin with # are skipped:

    rgb.txt         t_s file                    one line a frame, the file relative to FOLDER
    odometry.csv    t_s,speed,yaw_rate_radps    means since the line before; speed in any unit that stays about the same

Both use one clock. `hippodrome export RECORDING --to tum --out DIR` writes such folders, to try this on.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import cv2

from hippodrome import Observation, map_drive, read_network, refine, save_map


def observations(folder: Path) -> Iterator[Observation]:
    """One observation a line of odometry; the frames taken since the line before end in a frame of their own observation."""
    frames = [(float(t_s), folder / file) for t_s, file in (line.split() for line in rows(folder / "rgb.txt"))]
    before_s, taken = 0.0, 0
    for line in rows(folder / "odometry.csv"):
        t_s, speed, yaw_rate_radps = (float(value) for value in line.split(","))
        frame = None
        while taken < len(frames) and frames[taken][0] <= t_s + 1e-6:
            frame = cv2.cvtColor(cv2.imread(str(frames[taken][1])), cv2.COLOR_BGR2RGB)
            taken += 1
        yield Observation(t_s=t_s, dt_s=t_s - before_s, speed=speed, yaw_rate_radps=yaw_rate_radps, frame=frame)
        before_s = t_s


def rows(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]


def main(folder: Path, network_file: Path) -> None:
    semi_metric = map_drive(observations(folder))
    save_map(folder / "semi-metric.pbstream", semi_metric)
    refinement = refine(semi_metric, read_network(network_file))
    save_map(folder / "topometric.pbstream", refinement.cognitive_map)
    total, refused = len(semi_metric.poses), sum(one.last_vertex - one.first_vertex + 1 for one in refinement.breaks)
    print(f"{folder}/topometric.pbstream: {refinement.cognitive_map}")
    print(f"{total - refused} of {total} vertices lie on roads that the drive vouches for")
    for stretch in refinement.breaks:
        print(f"  vertices {stretch.first_vertex} to {stretch.last_vertex}: {stretch.cause}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
