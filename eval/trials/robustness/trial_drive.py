"""A localization drive and what it is localized in: the input that all parts of the robustness trial work on."""

from __future__ import annotations

from dataclasses import dataclass

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, Observation
from hippodrome.sim.recording import Recording


@dataclass(frozen=True, slots=True, eq=False)
class TrialDrive:
    """A drive with the map, the roads and the settings of the localizer."""

    recording: Recording
    observations: list[Observation]  # one for each step of the recording
    cognitive_map: CognitiveMap  # the topometric map to localize in
    roads: RoadNetwork  # the network that the map was refined with
    config: LocalizerConfig
