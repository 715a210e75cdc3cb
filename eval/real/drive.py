"""What the page of a drive shows, and the words and colours for what vouches for its map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, MatchBreak, MatchStatus, Trajectory, UInt8Array
from hippodrome.eval.exchange.drives.truth import stored_truth
from hippodrome.eval.metrics.alignment import apply_to_positions, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.real.findings import Finding
from hippodrome.sim.georeference import GeoReference
from hippodrome.sim.recording import Recording

FIX_GAP_S: Final = 2.5  # between samples of a truth that are joined on the page: a phone has a fix a second, and misses one
MAX_ROWS: Final = 200  # of a table on the page
COLOURS: Final = {
    MatchStatus.MATCHED: "#1a7f4b",
    MatchStatus.AMBIGUOUS: "#c77700",
    MatchStatus.OFF_NETWORK: "#c0331b",
    MatchStatus.NO_ROUTE: "#8b3fb5",
}
FINDING: Final = "#2563c9"  # colour of places where the map seems wrong
WORDS: Final = {
    MatchStatus.MATCHED: "on a road that vouches for it",
    MatchStatus.AMBIGUOUS: "several places fit",
    MatchStatus.OFF_NETWORK: "no road there",
    MatchStatus.NO_ROUTE: "no route",
}
NEXT: Final = {
    MatchStatus.MATCHED: "",
    MatchStatus.AMBIGUOUS: "Drive farther and round corners, so that only one place fits, or say with --start where it began.",
    MatchStatus.OFF_NETWORK: "Look at the place: a car park or a new road is missing in the map. Take a newer or larger extract.",
    MatchStatus.NO_ROUTE: "Look at one-way streets, forbidden turns and gaps of the map there. Does the self-motion jump?",
}


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """All that the page of a drive shows."""

    name: str
    network: str  # name of the map's file
    recording: Recording
    cognitive_map: CognitiveMap  # in the network's frame
    roads: RoadNetwork
    breaks: tuple[MatchBreak, ...]
    findings: tuple[Finding, ...]  # where the map seems wrong
    map_error_m: tuple[float, float] | None  # of the roads, where they vouch: median, 95 %; None: they were taken as exact
    reference: GeoReference | None  # where on Earth the network lies; None: it does not say
    scores: tuple[str, ...]  # lines of `hippodrome score`
    notes: tuple[str, ...]  # lines of the stages before
    stages: Mapping[str, float | None]  # seconds of each; None: done in an earlier run


def status_of(drive: Drive) -> UInt8Array:
    match = drive.cognitive_map.road_match
    return match.status if match is not None else np.zeros(len(drive.cognitive_map.t_s), dtype=np.uint8)


def same_frame(drive: Drive) -> bool:
    return bool(drive.recording.manifest.get("truth_frame", "network") == "network")


def truth_line(drive: Drive) -> FloatArray | None:
    """True positions (N, 2) over the map: as they are if they have the network's frame, else after a rigid fit to the map."""
    stored = stored_truth(drive.recording)
    if stored is None:
        return None
    truth = stored.trajectory
    if same_frame(drive):
        return truth.poses[:, :2]
    estimate = Trajectory(drive.cognitive_map.t_s, drive.cognitive_map.poses)
    try:
        pairs = associate(estimate, truth, min_coverage=0.0, max_gap_s=FIX_GAP_S)
        fit = find_alignment("se2", pairs.reference, pairs.estimate)
        return apply_to_positions(fit, truth.poses[:, :2])
    except (HippodromeError, ValueError):
        return None  # too little of the truth is known; the score says so


def marks(count: int) -> list[str]:
    """Names of so many places on the map: A to Z, then A2 to Z2, and so on."""
    return [f"{chr(ord('A') + i % 26)}{i // 26 + 1 if i >= 26 else ''}" for i in range(count)]
