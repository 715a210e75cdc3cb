"""Which answers of the route search are accepted: right roads, and roads on which nobody drove.

Drives through generated towns, without frames, and parts of them of several lengths are offered their own town and, as controls
that must be refused, another town of the same kind, their mirror image in their own town, and their own town without the streets
that they drove. ``--networks`` adds drives through other networks; each drive is offered the next one's.

    python -m benchmarks.acceptance --seeds 3
    python -m benchmarks.acceptance --seeds 1 --networks a.net.xml b.net.xml

A row of the table is one kind of offer at one length. *Accepted* is the share of samples that are vouched for, *wrong* the share
that is vouched for and 20 m or more off the true place (of a control: all that is vouched for), *some wrong* the number of drives
with any of that. Below, the evidence by which segments are accepted, as a curve (ROC): for each threshold, the share of the
segments on the right road that have as much, and of those that are not. The logistic fit to them is the probability that a
segment is right. Last, how far each drive goes in its own network until any of it is vouched for. ``benchmarks.real`` asks the
same of real drives.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import KDTree

from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.matching.confidence import explained_samples, match_status
from hippodrome.core.matching.config import ConfidenceConfig
from hippodrome.core.matching.control import control_of
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.problem import search_problem
from hippodrome.core.matching.search.route import most_likely_drive
from hippodrome.core.matching.segments import route_segments, with_evidence
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, MatchStatus, Visits
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.trials.stress.perturbations import without_roads
from hippodrome.sim.record import RecordingPlan, simulate
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec

TOWNS = Path(__file__).parent.parent / "scenarios/towns"
KINDS = ("grid", "radial", "random", "rural")
LENGTHS = (60, 100, 200, 400)  # keyframes, some 5 m apart; and the whole drive
NOISE = ("paper", "realistic", "harsh")
FAR_M = 20.0  # as far off as a false fix
DRIVEN_M = 12.0  # a road is gone if any point of it lies this close to the path
CUT_NATS = 30.0  # evidence beyond this is not told apart
LONGER = 20  # keyframes (100 m) by which the beginning of a drive grows until something is vouched for


@dataclass(frozen=True, slots=True, eq=False)
class DrivenRoads:
    """A drive's raw motions, where it really was, and the network that it drove in."""

    name: str
    visits: Visits
    poses_m: FloatArray  # (S, 3)
    network: RoadNetwork


@dataclass(frozen=True, slots=True)
class Offer:
    """What became of one drive in one network."""

    kind: str  # own, foreign, mirrored, removed
    keyframes: int  # 0: the whole drive
    accepted: float  # share of samples
    wrong: float
    seconds: float  # of CPU
    segments: tuple[tuple[float, bool], ...]  # evidence in nats, on the right road or not


def drives_of(scenario: Scenario, folder: Path) -> DrivenRoads:
    """The mapping drive of a scenario, without frames."""
    plan = RecordingPlan(scenario, "mapping", folder)
    _, samples = simulate(plan)
    mapper = MotionMapper()
    for i in range(len(samples.t_s)):
        mapper.step(samples.observation(i, None))
    visits = mapper.finish().visits
    at = np.searchsorted(samples.t_s, visits.t_s - 1e-9)
    return DrivenRoads(scenario.name, visits, samples.poses_m[at], plan.town().network)


def part_of(drive: DrivenRoads, first: int, count: int) -> DrivenRoads:
    """Keyframes ``first`` to ``first + count - 1`` of a drive."""
    own = slice(first, first + count)
    motion = drive.visits.motion[own].copy()
    motion[0] = 0.0
    visits = Visits(drive.visits.t_s[own], np.arange(len(motion), dtype=np.int32), motion)
    return replace(drive, visits=visits, poses_m=drive.poses_m[own])


def mirrored(visits: Visits) -> Visits:
    """Every turn to the other side."""
    return replace(visits, motion=visits.motion * [1.0, -1.0, -1.0])


def without_driven(drive: DrivenRoads) -> RoadNetwork | None:
    """The network without the streets, in both directions, that were driven; None if nothing is left of it."""
    near = KDTree(_dense(drive.poses_m)).query(drive.network.points_m, distance_upper_bound=DRIVEN_M)[0] < DRIVEN_M
    share = np.add.reduceat(near.astype(float), drive.network.point_start[:-1]) / np.diff(drive.network.point_start)
    driven = np.unique(drive.network.lane_edge[share > 0.0])
    if np.all(drive.network.is_internal[~np.isin(drive.network.lane_edge, driven)]):
        return None
    return without_roads(drive.network, driven.tolist())


def _dense(poses_m: FloatArray) -> FloatArray:
    """Points a metre or so apart on the path through the poses."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses_m[:, :2], axis=0).T))])
    every_metre = np.arange(0.0, arc[-1], 1.0)
    return np.column_stack([np.interp(every_metre, arc, poses_m[:, axis]) for axis in (0, 1)])


def offer(kind: str, keyframes: int, visits: Visits, network: RoadNetwork, poses_m: FloatArray | None) -> Offer:
    """Search a drive in a network. ``poses_m`` (S, 3) are its true poses, or None if it did not drive there."""
    config, confidence = RouteSearchConfig(), ConfidenceConfig()
    began = time.process_time()
    try:
        problem = search_problem(visits, network, config)
        route = most_likely_drive(problem, config)
    except HippodromeError:  # no route is as long as the drive: refused
        return Offer(kind, keyframes, 0.0, 0.0, time.process_time() - began, ())
    control = control_of(problem, config, route)
    vouched = match_status(route, control, confidence) == MatchStatus.MATCHED
    seconds = time.process_time() - began
    right = np.zeros(len(vouched), dtype=bool)
    if poses_m is not None:
        truth = [np.interp(route.track.arc, route.track.visit_arc, poses_m[:, axis]) for axis in (0, 1)]
        right = np.hypot(*(route.points_m.T - np.array(truth))) < FAR_M
    segments = with_evidence(route_segments(route, explained_samples(route, confidence)), route, control, CUT_NATS)
    judged = tuple((s.evidence_nats, bool(np.mean(right[s.first : s.end]) > 0.5)) for s in segments if s.evidence_nats != 0.0)
    return Offer(kind, keyframes, float(np.mean(vouched)), float(np.mean(vouched & ~right)), seconds, judged)


def offers(drive: DrivenRoads, elsewhere: RoadNetwork | None, rng: np.random.Generator) -> Iterator[Offer]:
    """All offers of one drive."""
    total = len(drive.visits.t_s)
    for keyframes in (*LENGTHS, 0):
        count = min(keyframes, total) or total
        part = part_of(drive, int(rng.integers(0, total - count + 1)), count)
        yield offer("own", keyframes, part.visits, part.network, part.poses_m)
        yield offer("mirrored", keyframes, mirrored(part.visits), part.network, None)
        for kind, network in (("removed", without_driven(part)), ("foreign", elsewhere)):
            if network is not None:
                yield offer(kind, keyframes, part.visits, network, None)


def metres_until_vouched(visits: Visits, network: RoadNetwork) -> float:
    """Metres of the shortest beginning of a drive, in steps of ``LONGER`` keyframes, of which a stretch is vouched for.

    It is infinite if nothing of the whole drive is. The metres are those of the route that is found.
    """
    config, confidence = RouteSearchConfig(), ConfidenceConfig()
    for count in range(2 * LONGER, len(visits.t_s) + LONGER, LONGER):
        begun = replace(visits, t_s=visits.t_s[:count], vertex=visits.vertex[:count], motion=visits.motion[:count])
        try:
            problem = search_problem(begun, network, config)
            route = most_likely_drive(problem, config)
        except HippodromeError:
            continue
        if np.any(match_status(route, control_of(problem, config, route), confidence) == MatchStatus.MATCHED):
            return float(np.sum(problem.track.step * np.exp(route.log_scale[1:])))
    return float("inf")


def print_metres(metres: FloatArray) -> None:
    """How far the drives go until something is vouched for: half of them, nine of ten, and the longest."""
    half, most, longest = np.quantile(metres, [0.5, 0.9, 1.0], method="higher")
    print(f"\n{len(metres)} drives, driven until vouched for: median {half:.0f} m, 90 % {most:.0f} m, all {longest:.0f} m")


def print_table(found: list[Offer]) -> None:
    """One row for each kind of offer and length."""
    groups: dict[tuple[str, int], list[Offer]] = defaultdict(list)
    for one in found:
        groups[one.kind, one.keyframes].append(one)
    heads = ("keyframes", "drives", "accepted", "refused whole", "wrong", "some wrong", "CPU s, mean", "CPU s, most")
    print(f"{'offered':9}" + "".join(f"{head:>15}" for head in heads))
    for (kind, keyframes), own in sorted(groups.items(), key=lambda item: (item[0][0], item[0][1] or 10**6)):
        accepted, wrong, seconds = (np.array([getattr(one, name) for one in own]) for name in ("accepted", "wrong", "seconds"))
        refused, some_wrong = np.sum(accepted == 0.0), np.sum(wrong > 0.0)
        print(
            f"{kind:9}{keyframes or 'whole':>15}{len(own):15}{accepted.mean():15.3f}"
            f"{refused:15}{wrong.mean():15.4f}{some_wrong:15}{seconds.mean():15.2f}{seconds.max():15.2f}"
        )


def print_curve(found: list[Offer]) -> None:
    """The evidence of all segments: shares above each threshold, and the logistic fit."""
    evidence, right = (np.array(column) for column in zip(*(pair for one in found for pair in one.segments), strict=True))
    print(f"\n{len(right)} segments with evidence, {int(right.sum())} on the right road")
    print(f"{'evidence nats':>13} {'right kept':>10} {'wrong kept':>10}")
    for nats in (-10.0, -5.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0):
        print(f"{nats:13.0f} {np.mean(evidence[right] >= nats):10.4f} {np.mean(evidence[~right] >= nats):10.4f}")

    def loss(parameters: FloatArray) -> float:
        z = (evidence - parameters[0]) / np.exp(parameters[1])
        return float(np.mean(np.logaddexp(0.0, np.where(right, -z, z))))

    even, log_width = minimize(loss, np.array([4.0, 0.5]), method="Nelder-Mead").x
    print(f"probability of being right: 1 / (1 + exp(-(evidence - {even:.2f}) / {np.exp(log_width):.2f}))")


def main(arguments: list[str]) -> int:
    """Make the drives, offer them, print the table and the curve."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.acceptance", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=2, metavar="N", help="towns of each kind (default: 2)")
    parser.add_argument("--networks", type=Path, nargs="*", default=[], metavar="NET.xml", help="SUMO networks to drive in, too")
    options = parser.parse_args(arguments)
    rng, found = np.random.default_rng(0), []
    with TemporaryDirectory() as folder:
        drives = []
        for number, kind in enumerate(KINDS):
            for seed in range(1, options.seeds + 1):
                scenario = read_scenario(TOWNS / f"{kind}.yaml", seed=seed)
                noise = NOISE[(number + seed) % len(NOISE)]
                drives.append(drives_of(scenario.model_copy(update={"noise": noise}), Path(folder)))
        for number, network in enumerate(options.networks):
            scenario = Scenario(
                name=f"network-{number}", town=TownSpec(network=network.resolve()), noise=NOISE[number % len(NOISE)],
                mapping=DriveSpec(tour=TourSpec(length_m=5000)),
            )  # fmt: skip
            drives.append(drives_of(scenario, Path(folder)))
    for number, drive in enumerate(drives):
        other = drives[(number + 1) % len(drives)]
        print(f"{number + 1}/{len(drives)} {drive.name}", file=sys.stderr, flush=True)
        found += offers(drive, None if other is drive else other.network, rng)
    print_table(found)
    print_curve(found)
    print_metres(np.array([metres_until_vouched(drive.visits, drive.network) for drive in drives]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
