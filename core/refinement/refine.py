"""Refinement of a semi-metric map to a topometric one: one call, two modes."""

from __future__ import annotations

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.paper import refine_paper
from hippodrome.core.refinement.route import refine_route
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, HippodromeError, Refinement, StartPose

LEAST_VERTICES = 2  # one place has no direction


def refine(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: RefineConfig | None = None, start: StartPose | None = None
) -> Refinement:
    """The topometric map: every vertex in the network's frame, in metres.

    Args:
        cognitive_map: a semi-metric map.
        network: the roads of the town that it was driven in.
        config: the mode and its constants; None is ``RefineConfig()``.
        start: pose of the first keyframe in the network's frame, where it is known; mode ``paper`` needs it.

    Returns:
        The map with scale, covariance (mode ``route``) and place on the roads at each vertex; the stretches that could not be
        vouched for, with the reason; and the parameters that were estimated on the way.

    Raises:
        HippodromeError: the map is refined already or has no drive in it, or mode ``paper`` got no start pose.
    """
    config = config or RefineConfig()
    if cognitive_map.frame != "semi-metric":
        raise HippodromeError(f"cognitive map: its frame is {cognitive_map.frame!r}; only a semi-metric map can be refined")
    if len(cognitive_map.t_s) < LEAST_VERTICES or not len(cognitive_map.visits.t_s):
        found = f"{len(cognitive_map.t_s)} vertices and {len(cognitive_map.visits.t_s)} visits"
        raise HippodromeError(f"cognitive map: {found} are no drive to be laid on roads; record a longer drive")
    if config.mode == "route":
        return refine_route(cognitive_map, network, config.route, start)
    if start is None:
        raise HippodromeError("refinement: mode 'paper' needs a start pose; give one or choose mode 'route'")
    return refine_paper(cognitive_map, network, start, config.paper)
