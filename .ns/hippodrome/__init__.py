"""Topometric cognitive maps from one camera, wheel odometry and a road network.

The whole chain, on any sequence of ``Observation``::

    from hippodrome import localize, map_drive, read_network, refine

    semi_metric = map_drive(observations)                      # a map right in its connections, wrong in its metres
    network = read_network("town.net.xml")
    refinement = refine(semi_metric, network)                  # laid on the roads: metres, and what could not be vouched for
    estimates = localize(later_observations, refinement.cognitive_map, network)

What is named here is public: it changes only with notice in the changelog; everything else may move. See ``docs/python.md``.
Each name is imported from its part when it is first used, so that ``import hippodrome`` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from hippodrome.core.localization.localizer import Localizer, localize
    from hippodrome.core.mapping.mapper import Mapper, map_drive
    from hippodrome.core.refinement.refine import refine
    from hippodrome.core.roads.network import RoadNetwork
    from hippodrome.core.types import CognitiveMap, Observation, StartPose, Trajectory
    from hippodrome.eval.metrics.trajectory import ape, rpe
    from hippodrome.proto.codec import load_map, save_map
    from hippodrome.sim.network import read_network

    __version__: str

_HOMES: Final = {
    "CognitiveMap": "core.types",
    "Localizer": "core.localization.localizer",
    "Mapper": "core.mapping.mapper",
    "Observation": "core.types",
    "RoadNetwork": "core.roads.network",
    "StartPose": "core.types",
    "Trajectory": "core.types",
    "ape": "eval.metrics.trajectory",
    "load_map": "proto.codec",
    "localize": "core.localization.localizer",
    "map_drive": "core.mapping.mapper",
    "read_network": "sim.network",
    "refine": "core.refinement.refine",
    "rpe": "eval.metrics.trajectory",
    "save_map": "proto.codec",
}

__all__ = [
    "CognitiveMap",
    "Localizer",
    "Mapper",
    "Observation",
    "RoadNetwork",
    "StartPose",
    "Trajectory",
    "__version__",
    "ape",
    "load_map",
    "localize",
    "map_drive",
    "read_network",
    "refine",
    "rpe",
    "save_map",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("hippodrome")
    elif name in _HOMES:
        value = getattr(import_module(f"hippodrome.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'hippodrome' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
