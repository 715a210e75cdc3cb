"""What each method of the comparison is given, and whom that favours: the table of the report."""

from __future__ import annotations

from typing import Final

HEAD: Final = ("Method", "Is given", "Frame of its APE", "What favours or burdens it")

# Keyed by the method's name, that of both trajectories of the tracker being one.
GIVEN: Final[dict[str, tuple[str, str, str]]] = {
    "dead reckoning": ("self-motion", "start pose, no scale", "no frame, no map: what the others begin with"),
    "semi-metric": (
        "frames of one small camera, self-motion",
        "start pose, no scale",
        "its shape is right, its metres are not",
    ),
    "RatSLAM": ("the same", "start pose, no scale", "constants of OpenRatSLAM, not tuned to these towns"),
    "semi-metric, no attractor": ("the same", "start pose, no scale", "the semi-metric map's poses to the last bit"),
    "topometric (paper)": (
        "the same, the road network, the start pose",
        "network, no alignment",
        "the network is metric and drawn from the truth, wheels and gyro bridge what the camera misses; no alignment helps it",
    ),
    "topometric": (
        "the same, the road network",
        "network, no alignment",
        "the network is metric and drawn from the truth, wheels and gyro bridge what the camera misses; no alignment helps it",
    ),
    "ORB-SLAM3": (
        "640x480 pairs of two cameras, their baseline in metres; no self-motion, no road network",
        "best rigid fit, SE(2)",
        "scale from the pair, sixteen times the pixels, surfaces drawn with the grain that corners need, the best alignment; "
        "its start and its saving are not counted as CPU; "
        "set to be cheap: a third less CPU, up to 0.2 m more APE (docs/baselines.md)",
    ),
}


def fairness_rows(methods: list[str]) -> list[list[str]]:
    """A line for each of these methods of a results file, each once."""
    names = dict.fromkeys("ORB-SLAM3" if method.startswith("ORB-SLAM3") else method for method in methods)
    return [[name, *GIVEN[name]] for name in names if name in GIVEN]
