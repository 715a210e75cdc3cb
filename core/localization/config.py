"""The localizer's parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.views.config import CameraGeometry, KeyframeConfig, SearchConfig, SequenceConfig, ViewCellConfig


@dataclass(frozen=True)
class LocalizerConfig(BeliefConfig):
    """All constants of the localizer. Those of its pose beliefs are inherited.

    Mode "coupled": attractor networks with covariances between them. Mode "paper": the networks as printed. Yardsticks that are
    given the same motions and measurements: "kalman", an extended Kalman filter, and "lanes", a Bayes filter on the lanes.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    self_motion: Literal["wheel", "visual"] = "wheel"  # wheel: as observed; visual: estimated from the frames alone
    camera: CameraGeometry = field(default_factory=CameraGeometry)  # for self_motion "visual", and for road_reading
    road_reading: bool = False  # place in the lane, and its end, by the lines in the frames; modes coupled, kalman
    views: ViewCellConfig = field(default_factory=ViewCellConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    steps: KeyframeConfig = field(default_factory=lambda: KeyframeConfig(interval_s=0.4))  # denser than the map: 15 % less error
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    margin: float = 1.2  # margin of the sequence evidence from which on a view counts as recognised: 87 % of such views are right
    fix_evidence: float = 5.0  # summed margin that makes or overturns a fix; margins of 2, as in a similar street, never reach it
    independent_m: float = 3.0  # query frames closer together, as in a slow turn, see nearly the same and count less
    doubt_evidence: float = 1.5  # summed margin of another place from which on the fix is doubted, unless its own is larger
    seen_z: float = 2.0  # z-score of the believed place below which the fix is doubted: 6 at the right place, 1 by chance
    seen_memory: float = 0.8  # weight of the past in the mean of that z-score: a lorry or a turn hides a place for some frames
    evidence_memory: float = 0.6  # share of summed margins that is left after one more query frame, as in the sequence filter
    lost_sigma_m: float = 6.0  # standard deviation of the position from which on the vehicle counts as lost
    lane_sigma_m: float = 0.5  # standard deviation of drivers about the lane's centre, to which map poses are drawn; 0: none are
    step_tolerance_m: float = 3.5  # in place of sequence.length_tolerance: scale and spacing differ between the two drives
    mean_trust: int = 16  # how many views the map's mean descriptor counts for in the running mean of the query frames
