"""``hippodrome method list`` and ``check``: what methods there are, and whether one keeps to the protocol on a short drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import BUILT_IN, GROUP, Added, Entry, entries_of, with_methods
from hippodrome.eval.contest.perform import Performance, perform
from hippodrome.eval.contest.trials import with_bases
from hippodrome.eval.methods.materials import Materials, Outcome, gather
from hippodrome.eval.methods.method import ALIGNMENTS
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.alignment import find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.results.model import Row
from hippodrome.eval.rivals.orbslam3.method import OrbSlam3
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.record import ROLES, RecordingPlan, record
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

TOWN: Final = TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9)
WAY_M: Final = 250.0  # of each drive: about half a minute
# A trajectory that says it lies on the network, and is off by more than this many times what a rigid fit leaves, does not lie
# there. Ours differ by less than 2.
FRAME_FACTOR: Final = 5.0
FRAME_LEAST_M: Final = 2.0  # and by this much at least: less is an error and not another frame
# Median angle between headings and the way from pose to pose: ours are off by one or two degrees, in tight curves by ten.
HEADING_RAD: Final = 0.7
CHECK_LIMIT_S: Final = 600.0  # of time for a drive of half a minute, unless the method has one of its own
SCALE: Final = (0.8, 1.25)  # metres per metre of a trajectory that says it is metric


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the verdict."""

    good: bool
    text: str

    def __str__(self) -> str:
        return f"{'ok  ' if self.good else 'FAIL'} {self.text}"


def list_lines() -> list[tuple[str, str]]:
    """What ``method list`` prints: names and words of ours, and of those that installed packages make known."""
    lines = [(f"{cls.card.key:<18} {cls.card.label:<28}", cls.needs.in_words()) for cls in BUILT_IN]
    lines += [(f"{OrbSlam3.card.key:<18} {OrbSlam3.label:<28}", f"{OrbSlam3.needs.in_words()}; --method {OrbSlam3.label}")]
    lines += [(f"{point.name:<18} {point.value:<28}", f"installed: --method {point.name}") for point in entry_points(group=GROUP)]
    return lines


def check(wanted: str | Added, out: Path) -> Iterator[Finding]:
    """Run a method twice on a short drive, and find whether it keeps to the protocol.

    Args:
        wanted: Key or label of one of ours, or a method as ``--method`` names it.
        out: Folder for the drive, which is made once, and for what the method leaves.

    Raises:
        HippodromeError: There is no such method, or the drive cannot be made.
    """
    scenario = with_methods(short_scenario(), [_limited(wanted)] if isinstance(wanted, Added) else [])
    entries = entries_of(scenario)
    entry = entries[-1] if isinstance(wanted, Added) else _ours(wanted, entries)
    yield Finding(True, f"{entry.method.label}: loads; it does {', '.join(entry.does)}, answers in frame '{entry.method.frame}'")
    yield Finding(True, f"is given {entry.declaration.given}{'' if not entry.apart else ', in a process of its own'}")
    require_gl()
    for role in ROLES:
        record(RecordingPlan(scenario, role, out))
    warm_up()
    materials = gather(scenario, out)
    once, again = (perform(materials, with_bases(entry, entries)) for _ in range(2))
    yield from findings(entry, materials, once, again)


def _limited(wanted: Added) -> Added:
    """The method with the limit of time of the check, unless it has one of its own."""
    usual_s = MethodSpec.model_fields["time_limit_s"].default
    if wanted.spec.time_limit_s != usual_s:
        return wanted
    return replace(wanted, spec=wanted.spec.model_copy(update={"time_limit_s": CHECK_LIMIT_S}))


def short_scenario() -> Scenario:
    """The town and the drives on which methods are checked."""
    drive = DriveSpec(tour=TourSpec(length_m=WAY_M), traffic=TrafficSpec(vehicles=2))
    camera = Scenario(name="camera").camera.model_copy(update={"rate_hz": 5.0})
    return Scenario(name="check", town=TOWN, camera=camera, mapping=drive, localization=drive)


def findings(entry: Entry, materials: Materials, once: Performance, again: Performance) -> Iterator[Finding]:
    """The verdict on two runs of the same method."""
    row = once.rows[-1]
    if row.places is not None and entry.does == ("describe",):
        yield Finding(True, f"describe: {100.0 * row.places.best_is_right:.0f} % of {row.places.mapped} mapped queries are right")
        yield Finding(row.places == again.rows[-1].places, "again: the same answers, if this is ok")
        yield from _cost(row, materials)
        return
    mine = [one for one in once.outcomes if one.method == entry.method]
    if not mine:
        yield Finding(False, f"map: {row.failure}")
        return
    outcome, truth = mine[0], materials.mapping.ground_truth()
    t_s = outcome.mapped.trajectory.t_s
    span = f"from {t_s[0]:.1f} s to {t_s[-1]:.1f} s of {truth.t_s[-1]:.1f} s"
    yield Finding(True, f"map: {len(t_s)} poses {span}, all finite and in order")
    if row.covered is not None and row.covered < 1.0:
        yield Finding(True, f"note: it has poses for {row.covered:.0%} of the drive; its row says so")
    yield _frame_finding(outcome, materials)
    yield from _heading_finding(outcome)
    yield _repeated(outcome, again)
    yield from _cost(row, materials)
    if "localize" in entry.does:
        yield _localization(row)


def _frame_finding(outcome: Outcome, materials: Materials) -> Finding:
    """Whether the trajectory lies in the frame that the method declares."""
    frame = outcome.method.frame
    pairs = associate(outcome.scored.trajectory, materials.mapping.ground_truth())
    off_m = outcome.scored.ape.mean_m
    try:
        fit = find_alignment("sim2", pairs.estimate, pairs.reference)
        rigid = find_alignment("se2", pairs.estimate, pairs.reference)
    except HippodromeError as error:
        return Finding(False, f"frame: {error}; did it move at all?")
    moved = pairs.estimate[:, :2] @ rigid.rotation.T + rigid.translation_m
    fitted_m = float(np.hypot(*(moved - pairs.reference[:, :2]).T).mean())
    if frame == "network" and off_m > max(FRAME_FACTOR * fitted_m, FRAME_LEAST_M):
        return Finding(
            False,
            f"frame: it lies {off_m:.1f} m off and a rigid fit leaves {fitted_m:.1f} m: is it in the road network's frame? "
            "Else declare frame 'metric' or 'own'",
        )
    if frame != "own" and not SCALE[0] < fit.scale < SCALE[1]:
        return Finding(False, f"frame: it is {1.0 / fit.scale:.2f} times too large to be in metres; declare frame 'own'")
    aligned = f"aligned by '{ALIGNMENTS[frame]}'"
    return Finding(True, f"frame: off by {off_m:.2f} m in the mean, {aligned}; its scale is {1.0 / fit.scale:.2f}")


def _heading_finding(outcome: Outcome) -> Iterator[Finding]:
    """Whether the headings are those of a vehicle that drives ahead along its own trajectory; nothing if it does not move."""
    poses = outcome.mapped.trajectory.poses
    way = np.diff(poses[:, :2], axis=0)
    moved = np.hypot(*way.T)
    drives = moved > 0.5 * moved.mean()  # of a stretch that hardly moves, the direction says little
    if not drives.any() or moved.mean() == 0.0:
        return
    course = np.arctan2(way[:, 1], way[:, 0])[drives]
    off_rad = float(np.median(np.abs(se2.wrap(se2.wrap(poses[:-1, 2])[drives] - course))))
    if off_rad > HEADING_RAD:
        cure = "headings are in radians, counter-clockwise from x, and of the vehicle, which drives ahead"
        words = f"heading: it is {np.degrees(off_rad):.0f} degrees off the direction of travel in the median: {cure}"
        is_harmless = outcome.method.frame == "metric"  # a fit of the positions alone lays it on the truth
        yield Finding(is_harmless, f"note: {words}" if is_harmless else words)


def _repeated(outcome: Outcome, again: Performance) -> Finding:
    """Whether the same drive gives the same bytes, and how far apart two runs are if not."""
    others = [one.scored.trajectory for one in again.outcomes if one.method == outcome.method]
    if not others:
        return Finding(False, f"again: the second run failed: {again.rows[-1].failure}")
    first, second = outcome.scored.trajectory, others[0]
    if np.array_equal(first.t_s, second.t_s) and np.array_equal(first.poses, second.poses):
        return Finding(True, "again: the same bytes")
    if len(first.t_s) != len(second.t_s):
        counts = f"{len(first.t_s)} and {len(second.t_s)} scored poses"
        return Finding(True, f"again: not deterministic: {counts}; give a spread over several runs")
    apart_m = float(np.hypot(*(first.poses - second.poses)[:, :2].T).max())
    return Finding(True, f"again: not deterministic: two runs are up to {apart_m:.3g} apart; give a spread over several runs")


def _cost(row: Row, materials: Materials) -> Iterator[Finding]:
    if row.cpu_percent is not None:
        words = f"cost: {row.cpu_percent:.2f} % CPU of the drive's {materials.duration_s:.0f} s"
        if row.latency_ms is not None:
            words += f", {row.latency_ms.median:.2f} ms an observation (p99 {row.latency_ms.p99:.2f} ms)"
        if row.peak_rss_bytes is not None:
            words += f", {row.peak_rss_bytes / 1e6:.0f} MB at most"
        slow = row.cpu_percent > 100.0
        yield Finding(True, words + ("; slower than the drive: it could not keep up with it" if slow else ""))


def _localization(row: Row) -> Finding:
    if row.localization is None:
        return Finding(False, str(row.failure))
    found = row.localization
    words = f"localize: localized in {100.0 * (found.localized_share or 0.0):.0f} % of the steps"
    if not found.success:
        return Finding(True, f"{words}, never within 20 m of the truth")
    return Finding(True, f"{words}, to {found.error_mean_m or 0.0:.2f} m, {found.false_fixes} false fixes")


def _ours(name: str, entries: Sequence[Entry]) -> Entry:
    for entry in entries:
        if name in (entry.method.key, entry.method.label):
            return entry
    raise MethodError(f"there is no method '{name}'; `hippodrome method list` says which there are")
