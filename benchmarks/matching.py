"""Map matching, beside leuvenmapmatching and mappymatch: time and accuracy on the same trace in the same network.

The town is generated, with two lanes in each direction, so that lanes can be confused. They need metres in the network's frame:
all get such a trace, the true drive, a point every 10 m, with noise of 2 m. We also show what we are made for, the drive's raw
odometry with neither start nor scale known, which they cannot use; dead reckoned from the true start with the true scale of each
step, it is a trace that they can try.

Matched-edge accuracy: share of the points, those inside junctions aside, that are given the road (SUMO edge) that was driven.
Matched-lane accuracy: the same with the lane. A point without an answer counts as wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks import rivals
from benchmarks.table import Row
from hippodrome.core import se2
from hippodrome.core.matching.lane_choice import choose_lanes
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.route import Route, search_route
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from tests.core.synthetic import SyntheticDrive, semi_metric_drive

TOWN = TownSpec(kind="random", width_m=900.0, height_m=900.0, road_km=20.0, lanes=2)
POINTS, NOISE_M = 400, 2.0
SPACING = 2  # vertices of 5 m between points of the trace
Matcher = Callable[[RoadNetwork, FloatArray, float], IntArray]
RIVALS: dict[str, Matcher] = {"leuvenmapmatching": rivals.leuven, "mappymatch": rivals.mappymatch}


def run() -> list[Row]:
    rivals.quiet()
    with TemporaryDirectory() as folder:
        network = build_town(TOWN, 7, Path(folder)).network
    drive = semi_metric_drive(network, np.random.default_rng(8), length_m=5.0 * SPACING * POINTS, relaxed=False)
    truth, lane = drive.true_poses[::SPACING], drive.true_lane[::SPACING]
    noisy = truth[:, :2] + NOISE_M * np.random.default_rng(9).standard_normal((len(truth), 2))
    reckoned = _dead_reckoned(drive)[::SPACING]
    rows = _both(
        "ours, unknown start and scale, raw odometry",
        lambda: _ours(network, drive),
        network,
        lane,
        "the rivals have no such mode",
    )
    rows += _both(
        "ours, noisy trace", lambda: _ours_on_trace(network, noisy), network, lane, "the lane stage, which takes metres"
    )
    for name, trace in (("noisy trace", noisy), ("dead reckoning, true start and scale", reckoned)):
        for rival, matcher in RIVALS.items():
            case = f"{rival}, {name}"
            if find_spec(rival) is None:
                rows.append(Row("matching", case, float("nan"), "", "not installed: pip install .[bench]"))
            else:
                rows += _both(case, lambda m=matcher, t=trace: m(network, t, NOISE_M), network, lane, "building its map included")
    return rows


def _both(case: str, match: Callable[[], IntArray], network: RoadNetwork, lane: IntArray, remark: str) -> list[Row]:
    """Time and both accuracies of one matcher, its second call being the one that is timed: the first may compile."""
    match()
    began = time.process_time()
    found = match()
    spent = time.process_time() - began
    on_road = ~network.is_internal[lane]
    same_edge = (found >= 0) & (network.lane_edge[found] == network.lane_edge[lane])
    shares = 100.0 * np.mean(same_edge[on_road]), 100.0 * np.mean(found[on_road] == lane[on_road])
    text = f"{int(on_road.sum())} points on roads, {int(np.sum(found < 0))} of {len(found)} without an answer"
    return [
        Row("matching", f"{case}: CPU time", spent, "s", remark),
        Row("matching", f"{case}: matched-edge accuracy", float(shares[0]), "%", text),
        Row("matching", f"{case}: matched-lane accuracy", float(shares[1]), "%"),
    ]


def _ours(network: RoadNetwork, drive: SyntheticDrive) -> IntArray:
    visits = drive.cognitive_map.visits
    return _lanes_at(search_route(visits, network, RouteSearchConfig()))[::SPACING]


def _ours_on_trace(network: RoadNetwork, trace_m: FloatArray) -> IntArray:
    ahead = np.gradient(trace_m, axis=0)
    poses = np.column_stack([trace_m, np.arctan2(ahead[:, 1], ahead[:, 0])])
    return _lanes_at(choose_lanes(poses, np.ones(len(poses), dtype=bool), network, RouteSearchConfig()))


def _lanes_at(route: Route) -> IntArray:
    """Lane (S,) at each visit: that of the nearest sample of the track."""
    return route.lane[route.track.visit_samples()]


def _dead_reckoned(drive: SyntheticDrive) -> FloatArray:
    """Places (V, 2) by the raw motions, from the true start and at each motion's true scale."""
    motion = drive.cognitive_map.visits.motion * np.column_stack(
        [drive.metres_per_unit, drive.metres_per_unit, np.ones(len(drive.true_lane))]
    )
    return se2.integrate(drive.true_poses[0], motion)[:, :2]
