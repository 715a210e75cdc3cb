"""What each method of the comparison is given, and whom that favours: the table of the report."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from hippodrome.eval.methods.method import (
    DEAD_RECKONING,
    NO_ATTRACTOR,
    ORBSLAM3,
    RATSLAM,
    SEMI_METRIC,
    TOPOMETRIC,
    TOPOMETRIC_PAPER,
    method_of,
)
from hippodrome.eval.results.model import Row

OURS: Final = "hippodrome"  # source of the methods that come with us
CAMERA: Final = "frames of one small camera, self-motion"
HEAD: Final = ("Method", "Is given", "How its map is laid on the truth", "What favours or burdens it")

# By the label of the method, or of the system that it is a variant of: both trajectories of ORB-SLAM3 have one entry.
GIVEN: Final[dict[str, tuple[str, str, str]]] = {
    DEAD_RECKONING.label: ("self-motion", "start pose, no scale", "no frame, no map: what the others begin with"),
    SEMI_METRIC.label: (
        CAMERA,
        "start pose, no scale",
        "its shape is right, its metres are not",
    ),
    RATSLAM.label: (CAMERA, "start pose, no scale", "constants of OpenRatSLAM, not tuned to these towns"),
    NO_ATTRACTOR.label: (CAMERA, "start pose, no scale", "the semi-metric map's poses to the last bit"),
    TOPOMETRIC_PAPER.label: (
        f"{CAMERA}, the road network, the start pose",
        "network, no alignment",
        "the network is metric and drawn from the truth, wheels and gyro bridge what the camera misses; no alignment helps it",
    ),
    TOPOMETRIC.label: (
        f"{CAMERA}, the road network",
        "network, no alignment",
        "the network is metric and drawn from the truth, wheels and gyro bridge what the camera misses; no alignment helps it",
    ),
    ORBSLAM3.label: (
        "640x480 pairs of two cameras, their baseline in metres; no self-motion, no road network",
        "best rigid fit, SE(2)",
        "scale from the pair, sixteen times the pixels, surfaces drawn with the grain that corners need, the best alignment; "
        "its start and its saving are not counted as CPU; "
        "set to be cheap: a third less CPU, up to 0.2 m more APE (docs/baselines.md)",
    ),
}


FRAMES: Final = {"own": "start pose, no scale", "network": "network, no alignment", "metric": "best rigid fit, SE(2)"}
TRUSTED: Final = "a class, trusted not to look for the truth"
APART: Final = "a process of its own, trusted not to look for the truth: this system cannot hide it"
ISOLATED: Final = "a process of its own, with nothing of the truth within its reach"


def fairness_rows(rows: Iterable[Row]) -> list[list[str]]:
    """One line per method or system among the rows of a results file, in the columns of ``HEAD``; others say it themselves."""
    lines: dict[str, list[str]] = {}
    for row in rows:
        method = method_of(row.method)
        name = method.system or method.label
        if name in GIVEN and (row.declaration is None or row.declaration.source == OURS):
            lines.setdefault(name, [name, *GIVEN[name]])
        elif (said := row.declaration) is not None:
            where = ISOLATED if said.isolated else APART if said.source.startswith(("exec:", "stream:")) else TRUSTED
            frame = "-" if row.ape is None and row.places is not None else FRAMES.get(said.frame, said.frame)
            lines[row.method] = [row.method, said.given, frame, where]
    return list(lines.values())
