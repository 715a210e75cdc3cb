"""A drive of unknown start and scale in a city's roads and in a country's: time and memory, and their ratio.

One made town of streets, as the tests' synthetic ones are, small and large; each size runs in a process of its own, so that its
peak memory is its own, and the time is the processor's.

    python -m benchmarks.large
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.table import Row, table
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.types import FloatArray, MatchStatus
from tests.core.synthetic import grid_network, semi_metric_drive

SIDES = (33, 78)  # crossings along a side of the town: some 180 and 1,000 km of road
DRIVE_M = 2500.0


def run() -> list[Row]:
    small, large = (_in_own_process(side) for side in SIDES)
    rows = []
    for one in (small, large):
        said = (
            f"{one['accepted']:.0%} vouched for, at most {one['error_m']:.1f} m off" if one["accepted"] else "nothing vouched for"
        )
        rows += [
            Row("large", f"unknown start in {one['road_km']:.0f} km of road, refinement", one["seconds"], "CPU s", said),
            Row("large", f"unknown start in {one['road_km']:.0f} km of road, peak memory", one["peak_mib"], "MiB"),
        ]
    wider = large["road_km"] / small["road_km"]
    for name, key in (("time", "seconds"), ("memory", "peak_mib")):
        rows.append(Row("large", f"ratio of {name}", large[key] / small[key], "", f"for {wider:.1f} times the road"))
    return rows


def measure(side: int) -> dict[str, float]:
    """Road [km], processor's seconds, peak memory [MiB], share that is vouched for and the largest error of that [m]."""
    _found(8)  # compiles, or loads, what is compiled
    network, error_m, vouched, seconds = _found(side)
    on_roads = ~network.is_internal
    return {
        "road_km": float(np.sum(network.lane_lengths_m()[on_roads])) / 2000.0,  # both directions have a lane
        "seconds": seconds,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "accepted": float(np.mean(vouched)),
        "error_m": float(np.max(error_m[vouched], initial=0.0)),
    }


def _found(side: int) -> tuple[RoadNetwork, FloatArray, BoolArray, float]:
    """The town, the error of each vertex of a drive through it, whether it is vouched for, and the seconds of the refinement."""
    network = grid_network(np.random.default_rng(0), columns=side, rows=side)
    drive = semi_metric_drive(network, np.random.default_rng(1), length_m=DRIVE_M, closures=50, relaxed=False)
    visits = drive.cognitive_map.visits
    brisk = replace(visits, t_s=visits.t_s * 8.0 / float(network.speed_limit_mps[0]))  # it drives at 8 m/s; people at the limit
    began = time.process_time()
    found = refine(replace(drive.cognitive_map, visits=brisk), network).cognitive_map
    seconds = time.process_time() - began
    assert found.road_match is not None
    error_m: FloatArray = np.hypot(*(found.poses[:, :2] - drive.true_poses[:, :2]).T)
    return network, error_m, found.road_match.status == MatchStatus.MATCHED, seconds


def _in_own_process(side: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.large", "--measure", str(side)]
    figures: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return figures


def main(arguments: list[str]) -> int:
    """Measure a town of its own process, or both as a table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.large", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--measure", type=int, metavar="CROSSINGS", help="one town with so many crossings along a side, as JSON")
    side = parser.parse_args(arguments).measure
    print(table(run()) if side is None else json.dumps(measure(side)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
