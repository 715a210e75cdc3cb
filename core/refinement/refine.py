"""Refinement of a semi-metric map to a topometric one: one call, two modes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from hippodrome.core.refinement.paper import PaperRefineConfig, refine_paper
from hippodrome.core.refinement.route import RouteRefineConfig, refine_route
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, HippodromeError, Refinement, StartPose


@dataclass(frozen=True, slots=True)
class RefineConfig:
    """``route``: unknown start and scale, decimetres. ``paper``: as published, needs a start pose."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    mode: Literal["route", "paper"] = "route"
    route: RouteRefineConfig = field(default_factory=RouteRefineConfig)
    paper: PaperRefineConfig = field(default_factory=PaperRefineConfig)


def refine(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: RefineConfig | None = None, start: StartPose | None = None
) -> Refinement:
    """The map in the network's frame, metres, with what could not be vouched for as breaks."""
    config = config or RefineConfig()
    if cognitive_map.frame != "semi-metric":
        raise HippodromeError(f"cognitive map: its frame is {cognitive_map.frame!r}; only a semi-metric map can be refined")
    if config.mode == "route":
        return refine_route(cognitive_map, network, config.route, start)
    if start is None:
        raise HippodromeError("refinement: mode 'paper' needs a start pose; give one or choose mode 'route'")
    return refine_paper(cognitive_map, network, start, config.paper)
