"""Real drives on real maps: KITTI's drives over OpenStreetMap's roads, of unknown start and scale.

    python -m benchmarks.real ../shared/real

Self-motion alone is laid on the roads; start, scale and frames are not given. Four tables follow.

*Drives*: the share of vertices that is vouched for, how many of these lie 10 m or more off, APE (mean) and RPE over 20 m (mean),
NEES per dimension of what is vouched for, the NEES that a right covariance has (the mean, and where 90 % lie), the accuracy that
the drive shows the map to have, and the processor's seconds of the refinement. The truth is laid over the result by one rigid fit
of the whole drive, which makes the NEES of a right covariance less than 1; both are those of the rear axle.

*Controls*: every drive in every other network, mirrored in all of them, and in its own without the streets that it drove. Nothing
may be vouched for.

*Metres*: how far each drive goes until a stretch of it is vouched for.

*What roads cannot tell*: the monocular odometry errs in its scale from step to step. First, the least RPE over 20 m along the
road of a linear estimate that knows how that scale errs and is told its place by all bends of the road: if the map is as far off
as the drive with the truth's self-motion shows it to be, and if it were better or worse. Then rows tell it the true scale of each
step, averaged over some metres, and refine it then: what the RPE over 20 m would be if something (wheels, stereo, a camera of
known height) told the scale as finely as that. The rows *speed* say how
much of the steps of the scale could be told from a change of the speed that the odometry sees, as cars keep their speed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.acceptance import DrivenRoads, metres_until_vouched, mirrored, print_metres, without_driven
from benchmarks.real_bounds import best_rpe_m, expected_nees, map_sigma_m, nees_after_fit
from benchmarks.real_drives import ABSENT, REAL, RealDrive, read_drives, scaled
from benchmarks.table import Row
from hippodrome.core import se2
from hippodrome.core.refinement.config import RouteRefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.refinement.route import keyframe_closures, solve_route
from hippodrome.core.refinement.solver import RouteSolution
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, MatchStatus, UInt8Array
from hippodrome.eval.metrics.alignment import umeyama

FAR_M = 10.0  # a vertex that is vouched for is right if it lies nearer than this to where it was
RPE_M = 20.0
AVERAGED_M = (5.0, 20.0, 40.0, 80.0, 160.0)  # over which the true scale is told
LENGTH_M = 60.0  # correlation length of a map's errors, as the refinement has it
MONOCULAR, ITS_TRUTH = "09 mono", "09"
SHARES = (2.0, 1.0, 0.5, 0.25)  # of the error of the map that the bound is asked for
STEP_M = 5.0  # between keyframes


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one drive in its own network."""

    vertices: int
    accepted: float  # share of the vertices
    wrong: int  # vertices that are vouched for, ``FAR_M`` or more off
    ape_m: float
    rpe_m: float
    nees: float  # per dimension, of what is vouched for
    map_sigma_m: float
    seconds: float  # of CPU


def refined(drive: RealDrive, network: RoadNetwork) -> Result:
    """Lay a drive on its own network."""
    began = time.process_time()
    _, solution, status = solve_route(drive.cognitive_map, network, RouteRefineConfig())
    return figures(drive, solution, status, time.process_time() - began)


def figures(drive: RealDrive, solution: RouteSolution, status: UInt8Array, seconds: float) -> Result:
    """The figures of a solution, which took so many seconds."""
    poses, true_m, vouched = solution.state.poses, drive.true_poses[:, :2], status == MatchStatus.MATCHED
    fit = umeyama(poses[:, :2], true_m, with_scale=False)
    error_m = np.hypot(*(poses[:, :2] @ fit.rotation.T + fit.translation_m - true_m).T)
    return Result(
        len(poses), float(np.mean(vouched)), int(np.sum(vouched & (error_m >= FAR_M))), float(np.mean(error_m)),
        rpe_m(poses, drive), nees_after_fit(poses[:, :2], solution.covariance[:, :2, :2], true_m, vouched),
        solution.shown_survey_sigma_m or 0.0, seconds,
    )  # fmt: skip


def rpe_m(poses: FloatArray, drive: RealDrive) -> float:
    """Mean error of the motion over ``RPE_M`` of way, in metres."""
    arc = np.concatenate([[0.0], np.cumsum(drive.true_steps_m)])
    after = np.searchsorted(arc, arc + RPE_M)
    first = np.flatnonzero(after < len(arc))
    pairs = [se2.between(one[first], one[after[first]])[:, :2] for one in (poses, drive.true_poses)]
    return float(np.mean(np.hypot(*(pairs[0] - pairs[1]).T)))


def controls(drive: RealDrive, networks: dict[str, RoadNetwork]) -> Iterator[tuple[str, RealDrive, RoadNetwork]]:
    """What a drive is offered that it did not drive."""
    turned = drive.with_visits(mirrored(drive.visits))
    for sequence, network in networks.items():
        if sequence != drive.sequence:
            yield f"in {sequence}", drive, network
        yield f"mirrored in {sequence}", turned, network
    gone = without_driven(DrivenRoads(drive.name, drive.visits, drive.true_poses, networks[drive.sequence]))
    if gone is not None:
        yield "its streets removed", drive, gone


def accepted(drive: RealDrive, network: RoadNetwork) -> float:
    """Share of the vertices that is vouched for."""
    try:
        match = refine(drive.cognitive_map, network).cognitive_map.road_match
    except HippodromeError:  # no route is as long as the drive
        return 0.0
    assert match is not None
    return float(np.mean(match.status == MatchStatus.MATCHED))


def told_scale(drive: RealDrive, over_m: float) -> RealDrive:
    """The drive whose steps are told their true scale, averaged over some metres around them."""
    log_scale = _true_log_scale(drive)
    steps = max(round(over_m / STEP_M), 1)
    kernel = np.ones(min(steps, len(log_scale)))
    mean = np.convolve(log_scale, kernel, "same") / np.convolve(np.ones_like(log_scale), kernel, "same")
    return scaled(drive, mean - np.mean(log_scale))


def told_by_speed(drive: RealDrive, over_m: float) -> float:
    """Share of the variance of the scale's changes over some metres that a linear fit on the seen changes of speed explains."""
    steps = max(round(over_m / STEP_M), 1)
    mean = np.ones(steps) / steps
    seen = np.log(np.maximum(_seen_steps(drive), 1e-3) / np.diff(drive.visits.t_s))
    changes = [(lambda a: a[steps:] - a[:-steps])(np.convolve(one, mean, "valid")) for one in (_true_log_scale(drive), seen)]
    return float(np.corrcoef(*changes)[0, 1] ** 2)


def _true_log_scale(drive: RealDrive) -> FloatArray:
    """Logarithm (S - 1,) of the true length of each step over the one that the odometry has seen."""
    ratio: FloatArray = np.log(np.maximum(drive.true_steps_m, 1e-3) / np.maximum(_seen_steps(drive), 1e-3))
    return ratio


def _seen_steps(drive: RealDrive) -> FloatArray:
    steps: FloatArray = np.hypot(drive.visits.motion[1:, 0], drive.visits.motion[1:, 1])
    return steps


def run() -> list[Row]:
    """The drives' figures as rows; without the data a sentence, and none."""
    if not REAL.is_dir():
        print(f"{REAL}: {ABSENT}", file=sys.stderr)
        return []
    drives, networks = read_drives(REAL)
    return [row for drive in drives for row in _rows(drive.name, refined(drive, networks[drive.sequence]))]


def _rows(name: str, found: Result) -> list[Row]:
    remark = f"{found.accepted:.1%} of {found.vertices} vouched for, {found.wrong} of them wrong"
    return [
        Row("real", f"KITTI {name}, APE", found.ape_m, "m", remark),
        Row("real", f"KITTI {name}, RPE over 20 m", found.rpe_m, "m"),
        Row("real", f"KITTI {name}, NEES per dimension", found.nees, "", f"the map shown to be {found.map_sigma_m:.2f} m off"),
        Row("real", f"KITTI {name}, refinement", found.seconds, "CPU s"),
    ]


def print_drives(drives: list[RealDrive], networks: dict[str, RoadNetwork]) -> None:
    """The table of the drives in their own networks."""
    print(f"{'drive':12}{'vertices':>9}{'accepted':>9}{'wrong':>6}{'APE m':>7}{'RPE20 m':>8}{'NEES':>6}", end="")
    print(f"{'a right one':>20}{'map m':>6}{'CPU s':>7}")
    for drive in drives:
        began = time.process_time()
        _, solution, status = solve_route(drive.cognitive_map, networks[drive.sequence], RouteRefineConfig())
        one, closures = figures(drive, solution, status, time.process_time() - began), keyframe_closures(drive.cognitive_map)
        vouched = status == MatchStatus.MATCHED
        right, low, high = expected_nees(solution, closures, drive.true_poses[:, :2], vouched, np.random.default_rng(0))
        print(
            f"{drive.name:12}{one.vertices:9}{one.accepted:9.3f}{one.wrong:6}{one.ape_m:7.2f}{one.rpe_m:8.3f}"
            f"{one.nees:6.2f}{right:7.2f} ({low:.2f}-{high:.2f}){one.map_sigma_m:6.2f}{one.seconds:7.1f}",
            flush=True,
        )


def print_controls(drives: list[RealDrive], networks: dict[str, RoadNetwork]) -> None:
    """The drives where they did not drive: what of each is vouched for, as it is found, and how many were vouched for at all."""
    count, wrong, longest = 0, 0, 0.0
    for drive in drives:
        for words, offered, network in controls(drive, networks):
            began = time.process_time()
            share = accepted(offered, network)
            seconds = time.process_time() - began
            longest, count, wrong = max(longest, seconds), count + 1, wrong + (share > 0.0)
            said = f"{share:.1%} vouched for, though it did not drive there" if share > 0.0 else "refused"
            print(f"{count:3} {drive.name} {words}: {said}, {seconds:.1f} s of CPU", flush=True)
    print(f"\n{count} controls, {wrong} of them vouched for anywhere; the longest took {longest:.1f} s of CPU", flush=True)


def until_vouched(drives: list[RealDrive], networks: dict[str, RoadNetwork]) -> FloatArray:
    """Metres of each drive until a stretch of it is vouched for, printed as they are found."""
    print(flush=True)
    metres = []
    for drive in drives:
        metres.append(metres_until_vouched(drive.visits, networks[drive.sequence]))
        print(f"{drive.name}: vouched for after {metres[-1]:.0f} m", flush=True)
    return np.array(metres)


def print_best(drive: RealDrive, exact: RealDrive, network: RoadNetwork) -> None:
    """The least RPE along the road that the odometry of a drive and all bends of its roads allow; ``exact`` is its truth's."""
    line, solution, _ = solve_route(exact.cognitive_map, network, RouteRefineConfig())
    off_m, log_scale = map_sigma_m(exact, solution, line, LENGTH_M), _true_log_scale(drive)
    print(f"\nKITTI {drive.name}: least RPE20 m along the road of a linear estimate, by all its bends, if it is drawn off by")
    for share in SHARES:
        least_m = best_rpe_m(drive, log_scale, share * off_m, LENGTH_M, RPE_M)
        print(f"{share * off_m:8.2f} m{' (as it is)' if share == 1.0 else '':12}{least_m:10.3f}", flush=True)


def print_bounds(drive: RealDrive, network: RoadNetwork) -> None:
    """What the RPE would be if the odometry's scale were told, and what the speed tells of it."""
    print(f"\nKITTI {drive.name}, RPE20 m: {refined(drive, network).rpe_m:.3f} m; told its true scale, averaged over")
    for over_m in AVERAGED_M[::-1]:
        print(f"{over_m:6.0f} m{refined(told_scale(drive, over_m), network).rpe_m:10.3f}", flush=True)
    for over_m in AVERAGED_M[1:3]:
        print(f"speed, changes over {over_m:.0f} m, explains {told_by_speed(drive, over_m):.1%} of those of the scale")


def main(arguments: list[str]) -> int:
    """Find the drives and print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.real", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    where = "where the drives lie (default: %(default)s)"
    parser.add_argument("folder", type=Path, nargs="?", default=REAL, metavar="DIR", help=where)
    folder = parser.parse_args(arguments).folder
    drives, networks = read_drives(folder) if folder.is_dir() else ([], {})
    if not drives:
        print(f"{folder}: {ABSENT}")
        return 0
    refined(drives[0], networks[drives[0].sequence])  # compiles, or loads, what is compiled
    print_drives(drives, networks)
    print_controls(drives, networks)
    print_metres(until_vouched(drives, networks))
    named = {drive.name: drive for drive in drives}
    if MONOCULAR in named and ITS_TRUTH in named:
        network = networks[named[MONOCULAR].sequence]
        print_best(named[MONOCULAR], named[ITS_TRUTH], network)
        print_bounds(named[MONOCULAR], network)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
