"""A drive as a viewer shows it: where estimates with a frame of their own are laid, and how much of a map there is when."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import CognitiveMap, EdgeKind, FloatArray, Trajectory
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.figures.style import SERIES
from hippodrome.eval.methods.method import METHODS, method_of

GROWTH_S = 5.0  # time between two states of a growing map: some 40 m of road, and few enough states to keep a file small
NETWORK_FRAME, VEHICLE_FRAME, CAMERA_FRAME = "network", "vehicle", "camera"


@dataclass(frozen=True, slots=True, eq=False)
class MapState:
    """A map as far as it was made at one time; vertices lie where the finished map has them."""

    t_s: float
    path: FloatArray  # (V, 2) positions of the vertices
    closures: FloatArray  # (C, 2, 2) positions of both ends of each loop closure


def frame_id(drive: ExportedDrive, method: str) -> str:
    """Name of the frame in which a method's trajectory is given."""
    return NETWORK_FRAME if drive.estimates[method].frame == "network" else f"own/{method}"


def map_frame_id(name: str, cognitive_map: CognitiveMap) -> str:
    """Name of the frame in which a map's vertices are given."""
    return NETWORK_FRAME if cognitive_map.frame == "network" else f"own/{name}"


def own_frames(drive: ExportedDrive) -> dict[str, FloatArray]:
    """Where each method's own frame lies in the network's, as a pose (3,) by the frame's name.

    The method's first pose is laid on the truth at that time; nothing is scaled.
    """
    starts = {
        f"own/{method}": (estimate.trajectory.t_s[0], estimate.trajectory.poses[0])
        for method, estimate in drive.estimates.items()
        if estimate.frame == "own"
    }
    placed = {name: _laid(drive.truth, float(t_s), pose) for name, (t_s, pose) in starts.items()}
    map_truth = drive.truth if drive.map_truth is None else drive.map_truth
    for name, found in drive.maps.items():
        if found.frame != "network" and len(found.t_s):
            placed.setdefault(f"own/{name}", _laid(map_truth, float(found.t_s[0]), found.poses[0]))
    return placed


def growth(drive: ExportedDrive, name: str) -> Iterator[MapState]:
    """The states of a map during a drive.

    The drive that it was made on sees it grow, one state every ``GROWTH_S``, and the finished map at the time of its last vertex.
    A later drive has the finished map from its beginning on.
    """
    cognitive_map = drive.maps[name]
    t_s, edges = cognitive_map.t_s, cognitive_map.edges
    if not len(t_s):
        return
    closing = edges.kind == EdgeKind.CLOSURE
    ends = np.stack([edges.source[closing], edges.target[closing]], axis=1)
    if drive.maps_finished:
        yield MapState(0.0, cognitive_map.poses[:, :2], cognitive_map.poses[ends][:, :, :2])
        return
    for until_s in (*np.arange(t_s[0] + GROWTH_S, t_s[-1], GROWTH_S), t_s[-1]):
        count = int(np.searchsorted(t_s, until_s, side="right"))
        known = ends[(ends < count).all(axis=1)]
        yield MapState(float(until_s), cognitive_map.poses[:count, :2], cognitive_map.poses[known][:, :, :2])


def lanes(drive: ExportedDrive) -> list[FloatArray]:
    """The centreline (n, 2) of each lane of the road network; none if it is not known."""
    network = drive.network
    return [] if network is None else [network.lane_points_m(lane) for lane in range(network.lane_count)]


def colour_of(name: str) -> tuple[int, int, int]:
    """Red, green and blue, up to 255, of a method's trajectory or map, by the stem of its file: those of the figures."""
    stem = name.removesuffix("-localization")
    method = next((one for one in METHODS if (one.map_file or "").rpartition(".")[0] == stem or one.stem == stem), None)
    if method is None:
        method = next((one for one in METHODS if one.label == method_of(stem).system), METHODS[0])
    colour = SERIES[METHODS.index(method) % len(SERIES)]
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _laid(truth: Trajectory | None, t_s: float, pose: FloatArray) -> FloatArray:
    """The pose in the network of the origin of a frame in which ``pose`` is where the vehicle truly was at ``t_s``."""
    if truth is None:
        return np.zeros(3)
    true = se2.interpolate(truth.t_s, truth.poses, np.array([t_s]))[0]
    return se2.compose(true, se2.inverse(pose))
