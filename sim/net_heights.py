"""Heights of a SUMO network: of its lanes, and of a drive along them. Most networks have none: they are flat."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray
from hippodrome.sim.net_file import SumoNet

FLAT_M: Final = 0.05  # less than this between the lowest and the highest point is no height
ABOVE_M: Final = 2.0  # roads that cross with less than this between them would touch
STEEPEST: Final = 0.5  # metres up or down per metre; the steepest street of all has 0.35, and ramps of car parks less
AT_ENDS_M: Final = 12.0  # roads that meet this close to an end of one of them share a junction, or are meant to


def lane_heights_m(net: SumoNet, network: RoadNetwork) -> FloatArray | None:
    """Height (P,) of each point of the network's lanes as the file has them; None where the network is flat."""
    shapes = [net.getLane(lane).getShape3D() for lane in network.lane_ids]
    heights = [z for shape in shapes for _, _, z in shape]
    if max(heights) - min(heights) < FLAT_M:
        return None
    parts = [_heights_at(np.array(shape, dtype=np.float64), network.lane_points_m(lane)) for lane, shape in enumerate(shapes)]
    return np.concatenate(parts)


def _heights_at(shape_m: FloatArray, points_m: FloatArray) -> FloatArray:
    """Heights of points (n, 2) of a polyline (k, 3), which lie on it in this order."""
    return np.interp(_along_m(points_m), _along_m(shape_m[:, :2]), shape_m[:, 2])


def _along_m(points_m: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_m, axis=0), axis=1))])


def heights_along_m(
    network: RoadNetwork, heights_m: FloatArray, lane: NDArray[np.integer[Any]], position_m: FloatArray
) -> FloatArray:
    """Height (N,) at arc lengths on lanes (N,)."""
    found = np.empty(len(lane))
    for one in np.unique(lane):
        mine = lane == one
        part = slice(network.point_start[one], network.point_start[one + 1])
        found[mine] = np.interp(position_m[mine], _along_m(network.points_m[part]), heights_m[part])
    return found


def pitch_rad(along_m: FloatArray, heights_m: FloatArray, wheelbase_m: float) -> FloatArray:
    """Pitch (N,), nose up positive, of a car whose rear axle is at distances ``along_m`` (N,) seen from above."""
    moving = np.concatenate([[True], np.diff(along_m) > 0.0])
    front_m = np.interp(along_m + wheelbase_m, along_m[moving], heights_m[moving])
    front_m[along_m + wheelbase_m > along_m[-1]] = np.nan
    slope = (front_m - heights_m) / wheelbase_m
    last = np.flatnonzero(np.isfinite(slope))
    slope = np.where(np.isfinite(slope), slope, slope[last[-1]] if len(last) else 0.0)
    pitch: FloatArray = np.arctan(slope)
    return pitch


def too_steep(network: RoadNetwork, heights_m: FloatArray | None) -> Iterator[str]:
    """A note where roads are steeper than any: heights that are wrong, or a shape that lost its points when it was imported."""
    if heights_m is None:
        return
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.point_start))
    steps_m = np.linalg.norm(np.diff(network.points_m, axis=0), axis=1)
    rise = np.abs(np.diff(heights_m)) / np.maximum(steps_m, 1e-6)
    rise[(owner[1:] != owner[:-1]) | network.is_internal[owner[1:]]] = 0.0
    if np.any(rise > STEEPEST):
        edges = network.lane_edge[owner[1:]]
        count, worst = len(np.unique(edges[rise > STEEPEST])), int(np.argmax(rise))
        yield (
            f"{count} road(s) climb or fall by more than {STEEPEST:.0%}, for instance {network.edge_ids[edges[worst]]} by "
            f"{rise[worst]:.0%}; such heights are driven and drawn as they are"
        )


def crossings_without_height(net: SumoNet, network: RoadNetwork, heights_m: FloatArray | None) -> Iterator[str]:
    """A note where roads cross without a junction though neither passes above the other."""
    first = np.unique(network.lane_edge, return_index=True)[1]
    lanes = first[~network.is_internal[first]]
    lines = [shapely.LineString(network.lane_points_m(lane)) for lane in lanes]
    one, other = shapely.STRtree(lines).query(lines, predicate="crosses")
    pairs = sorted(_touching(net, network, heights_m, lanes, lines, zip(one.tolist(), other.tolist(), strict=True)))
    if pairs:
        a, b, x_m, y_m = pairs[0]
        without = "has no heights" if heights_m is None else "gives them the same height"
        yield (
            f"{len(pairs)} pair(s) of roads cross without a junction, for instance {a} and {b} at ({x_m:.0f}, {y_m:.0f}) m, and "
            f"the network {without}: they are drawn on the ground and vehicles pass through one another there"
        )


def _touching(
    net: SumoNet,
    network: RoadNetwork,
    heights_m: FloatArray | None,
    lanes: NDArray[np.integer[Any]],
    lines: list[shapely.LineString],
    pairs: Iterable[tuple[int, int]],
) -> Iterator[tuple[str, str, float, float]]:
    """Names of edges that cross away from their ends at about one height, and where."""
    for i, j in pairs:
        names = [network.edge_ids[network.lane_edge[lanes[k]]] for k in (i, j)]
        ends = [{net.getEdge(name).getFromNode(), net.getEdge(name).getToNode()} for name in names]
        if names[0] > names[1] or ends[0] & ends[1]:
            continue
        place = shapely.get_coordinates(shapely.intersection(lines[i], lines[j]))[0]
        along = [float(lines[k].project(shapely.Point(place))) for k in (i, j)]
        if any(not AT_ENDS_M < s < lines[k].length - AT_ENDS_M for s, k in zip(along, (i, j), strict=True)):
            continue
        gap_m = 0.0
        if heights_m is not None:
            z_m = [heights_along_m(network, heights_m, lanes[[k]], np.array([s]))[0] for s, k in zip(along, (i, j), strict=True)]
            gap_m = abs(z_m[0] - z_m[1])
        if gap_m < ABOVE_M:
            yield names[0], names[1], float(place[0]), float(place[1])
