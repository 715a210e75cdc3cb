"""Refinement of long drives with a known start: time and memory against the number of vertices.

One synthetic town of about 80 km of road for all sizes, driven again and again; vertices 5 m apart, loop closures, drift and a
wandering scale as the tests' synthetic drives have them. Each size runs in a process of its own, so that its peak memory is its
own; the time is the processor's. ``python -m benchmarks.scaling 1000 30000`` runs those sizes, ``--full`` those of ``FULL``. A
log-log plot goes to ``PLOT``.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import matplotlib as mpl
import numpy as np

from benchmarks.table import Row, table
from hippodrome.core.refinement import route
from hippodrome.core.types import StartPose
from tests.core.synthetic import SyntheticDrive, grid_network, semi_metric_drive

SIZES = (1_000, 3_000, 10_000)
FULL = (1_000, 3_000, 10_000, 30_000, 100_000)
PLOT = Path("out/bench/scaling.png")
SPACING_M = 5.0
CLOSURES_PER_VERTEX = 0.1  # as in the paper's map: 150 of 1,400 vertices
STAGES = {
    "most_likely_drive": "route search",
    "match_status": "acceptance",
    "choose_lanes": "lane choice",
    "_line_and_places": "route line",
    "refine_along_route": "solver",
}


def run(sizes: tuple[int, ...] = SIZES) -> list[Row]:
    measured = [_in_own_process(size) for size in sizes]
    plot(measured, PLOT)
    return [row for figures in measured for row in _rows(figures)]


def measure(vertices: int) -> dict[str, float]:
    """Wall seconds of a refinement and of its stages, its peak memory [MiB], and the mean error [m]."""
    network = grid_network(np.random.default_rng(0), columns=19, rows=18)
    _refined(network, 300)  # compiles, or loads, what is compiled
    before = _peak_mib()
    spent: dict[str, float] = {}
    drive = _drive(network, vertices)
    began = time.process_time()
    with _stopwatches(spent):
        refined = _refine(network, drive)
    whole = time.process_time() - began
    error = np.hypot(*(refined.cognitive_map.poses[:, :2] - drive.true_poses[:, :2]).T)
    return {
        "vertices": len(drive.true_poses), "whole": whole, **spent, "peak_mib": _peak_mib(), "before_mib": before,
        "error_m": float(error.mean()),
    }  # fmt: skip


def _refined(network: Any, vertices: int) -> None:
    _refine(network, _drive(network, vertices))


def _drive(network: Any, vertices: int) -> SyntheticDrive:
    closures = int(CLOSURES_PER_VERTEX * vertices)
    length_m = SPACING_M * vertices
    drive = semi_metric_drive(network, np.random.default_rng(1), length_m=length_m, closures=closures, relaxed=False)
    visits = drive.cognitive_map.visits
    brisk = replace(visits, t_s=visits.t_s * 8.0 / float(network.speed_limit_mps[0]))  # they drive at 8 m/s; people at the limit
    return replace(drive, cognitive_map=replace(drive.cognitive_map, visits=brisk))


def _refine(network: Any, drive: SyntheticDrive) -> Any:
    start = StartPose(*(float(value) for value in drive.true_poses[0]))
    return route.refine_route(drive.cognitive_map, network, route.RouteRefineConfig(), start)


@contextmanager
def _stopwatches(spent: dict[str, float]) -> Iterator[None]:
    """While this is open, the time that each stage of the refinement takes is added to ``spent``."""

    def timed(name: str, stage: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            began = time.process_time()
            try:
                return stage(*args, **kwargs)
            finally:
                spent[name] = spent.get(name, 0.0) + time.process_time() - began

        return call

    with ExitStack() as stack:
        for attribute, name in STAGES.items():
            stack.enter_context(patch.object(route, attribute, timed(name, getattr(route, attribute))))
        yield


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _in_own_process(vertices: int) -> dict[str, float]:
    print(f"  {vertices} vertices ...", file=sys.stderr, flush=True)
    command = [sys.executable, "-m", "benchmarks.scaling", "--measure", str(vertices)]
    figures: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return figures


def _rows(figures: dict[str, float]) -> list[Row]:
    vertices = int(figures["vertices"])
    stages = ", ".join(f"{name} {figures[name]:.2f}" for name in STAGES.values() if name in figures)
    remark = f"{1e3 * figures['whole'] / vertices:.2f} ms a vertex; {stages}; error {figures['error_m']:.2f} m"
    memory = f"{figures['before_mib']:.0f} of them before the drive: Python, libraries, town"
    return [
        Row("scaling", f"refine {vertices} vertices, known start", figures["whole"], "s", remark),
        Row("scaling", f"refine {vertices} vertices, peak memory", figures["peak_mib"], "MiB", memory),
    ]


def plot(measured: list[dict[str, float]], path: Path) -> None:
    """Time of each stage and peak memory against vertices, log-log, with a line of slope 1 through the whole's last point."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    vertices = np.array([figures["vertices"] for figures in measured])
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    for name in ("whole", *STAGES.values()):
        spent = np.array([figures.get(name, np.nan) for figures in measured])
        left.loglog(vertices, spent, "o-", label=name, linewidth=2.0 if name == "whole" else 1.0)
    left.loglog(vertices, measured[-1]["whole"] * vertices / vertices[-1], "k:", label="linear")
    left.set(xlabel="vertices", ylabel="seconds", title="Refinement, known start")
    left.legend()
    right.loglog(vertices, [figures["peak_mib"] for figures in measured], "o-", label="peak")
    right.loglog(vertices, [figures["before_mib"] for figures in measured], "k:", label="before the drive")
    right.set(xlabel="vertices", ylabel="MiB", title="Peak memory")
    right.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description="time and memory against vertices")
    parser.add_argument("sizes", nargs="*", type=int, default=[], metavar="VERTICES")
    parser.add_argument("--full", action="store_true", help=f"the sizes {', '.join(map(str, FULL))}")
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.measure:
        print(json.dumps(measure(options.measure)))
        return 0
    print(table(run(FULL if options.full else tuple(options.sizes) or SIZES)))
    print(f"plot: {PLOT}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
