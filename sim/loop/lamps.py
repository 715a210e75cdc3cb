"""Signal heads whose lamps show what SUMO's traffic lights show, drawn with what moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import Final

import numpy as np

from hippodrome.core.navigation.types import Indicator
from hippodrome.core.types import FloatArray, IntArray, UInt8Array
from hippodrome.sim.loop.ground import Ground
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.ways import Way, Ways
from hippodrome.sim.scene.light import shade
from hippodrome.sim.scene.mesh import Mesh, boxes, instances, merge, polygons
from hippodrome.sim.scene.types import Light, Tile

SETBACK_M: Final = 0.8  # of the pole from the outermost lane's border, as of the scene's own poles
CLEAR_M: Final = 0.5  # a pole is moved outward in such steps until it stands beside the paving
MOST_SHIFTS: Final = 24  # where there is no room within 12 m the head is left out, as the scene does
BESIDE_M: Final = 0.5  # between the heads of one pole, which differ in when they are green
FAR_SIDE_M: Final = 1.0  # the second head stands this far beyond the junction: who waits at the line cannot see the first
DRAWN_M: Final = 250.0  # from the ego; a lamp of 0.3 m is a tenth of a pixel there
MOVED_M: Final = 25.0  # the heads that are drawn are chosen anew after this much way
LAMP_M: Final = 0.28
STEEL, DARK = np.array([0.62, 0.64, 0.66]), np.array([0.14, 0.15, 0.16])
DIM: Final = np.array([[0.30, 0.06, 0.05], [0.30, 0.24, 0.05], [0.05, 0.22, 0.10]])  # red, yellow, green, not lit
LIT: Final = np.array([[255, 42, 28], [255, 196, 40], [52, 255, 128]], dtype=np.uint8)  # shine by themselves, also at dusk
LIT_BY: Final[Mapping[str, tuple[bool, bool, bool]]] = {
    "r": (True, False, False), "R": (True, False, False), "u": (True, True, False), "y": (False, True, False),
    "Y": (False, True, False), "o": (False, True, False), "g": (False, False, True), "G": (False, False, True),
}  # fmt: skip
NONE_LIT: Final = (False, False, False)


@dataclass(frozen=True, slots=True, eq=False)
class Heads:
    """K signal heads of a town."""

    place_m: FloatArray  # (K, 3) foot, and the road's height there
    yaw_rad: FloatArray  # (K,) turns a head's own +y to the traffic that it is for
    signal: tuple[str, ...]  # (K,) SUMO's traffic light
    lamp: tuple[int, ...]  # (K,) number of the lamp in its state


def signal_heads(ground: Ground, ways: Ways, rights: Rights) -> Heads:
    """Heads at the stop line and beyond the junction of each signalled approach; one for each group of lamps that differ."""
    places, yaws, signals, lamps = [], [], [], []
    for lanes in _approaches(ground, ways, rights):
        outer = lanes[0] if _right_is_outer(ground) else lanes[-1]
        for number, (way, signal, lamp) in enumerate(_groups(lanes, ways, rights)):
            x, y, heading = ground.pose_at(outer, ground.lane_length_m(outer))
            ahead = ways.meant(outer, Indicator.STRAIGHT) or way
            far_x, far_y, _ = ground.pose_at(ahead.target, FAR_SIDE_M)
            z, far_z = ground.height_m(outer, ground.lane_length_m(outer)), ground.height_m(ahead.target, FAR_SIDE_M)
            for at_m, lane, height_m in (((x, y), outer, z), ((far_x, far_y), ahead.target, far_z)):
                foot = _beside(ground, at_m, heading, lane, number)
                if foot is not None:
                    places.append((*foot, height_m))
                    yaws.append(heading + 0.5 * np.pi)
                    signals.append(signal)
                    lamps.append(lamp)
    return Heads(np.array(places, dtype=np.float64).reshape(-1, 3), np.array(yaws), tuple(signals), tuple(lamps))


def _right_is_outer(ground: Ground) -> bool:
    return not ground.town.left_hand


def _approaches(ground: Ground, ways: Ways, rights: Rights) -> list[list[int]]:
    """Lanes that end at a traffic light, edge by edge, from right to left."""
    network = ground.network
    ending = [
        lane
        for lane in range(network.lane_count)
        if not network.is_internal[lane] and any(w.inside and w.inside[0] in rights.signal_of for w in ways.out_of(lane))
    ]
    found = []
    for _, group in groupby(
        sorted(ending, key=lambda lane: (network.lane_edge[lane], lane)), lambda lane: network.lane_edge[lane]
    ):
        lanes = list(group)
        found.append(sorted(lanes, key=lambda lane: len(_to_the_right(ground, lane))))
    return found


def _to_the_right(ground: Ground, lane: int) -> list[int]:
    """The lanes to the right of a lane."""
    found: list[int] = []
    while (lane := int(ground.network.right_lane[lane])) >= 0 and lane not in found:
        found.append(lane)
    return found


def _groups(lanes: Sequence[int], ways: Ways, rights: Rights) -> list[tuple[Way, str, int]]:
    """One way for each set of lamps that show the same in all phases, from right to left, with light and lamp."""
    found: dict[tuple[str, ...], tuple[Way, str, int]] = {}
    links = [way for lane in lanes for way in ways.out_of(lane) if way.inside and way.inside[0] in rights.signal_of]
    for way in sorted(links, key=lambda way: way.turn_rad):
        signal, lamp = rights.signal_of[way.inside[0]]
        shown = (signal, *(state[lamp : lamp + 1].lower() for state in rights.phases.get(signal, ())))
        found.setdefault(shown, (way, signal, lamp))
    return list(found.values())


def _beside(ground: Ground, at_m: tuple[float, float], heading_rad: float, lane: int, number: int) -> tuple[float, float] | None:
    """Where a head stands beside the paving; None where there is no room."""
    side = 1.0 if ground.town.left_hand else -1.0
    outward = side * np.array([-np.sin(heading_rad), np.cos(heading_rad)])
    first = 0.5 * float(ground.network.width_m[lane]) + SETBACK_M
    for shift in range(MOST_SHIFTS):
        place = np.array(at_m) + (first + shift * CLEAR_M) * outward
        if not ground.is_paved(place):
            x, y = place + number * BESIDE_M * outward
            return float(x), float(y)
    return None


class Lamps:
    """The tile of the heads near the ego, made anew when a lamp changes or the ego has gone on."""

    def __init__(self, heads: Heads, origin_m: FloatArray, light: Light) -> None:
        self._heads, self._origin_m, self._light = heads, origin_m, light
        self._chosen: IntArray = np.zeros(0, dtype=np.int32)
        self._chosen_at_m = np.array([np.inf, np.inf])
        self._shown: list[str] | None = None

    def tile(self, x_m: float, y_m: float, states: Mapping[str, str]) -> Tile | None:
        """What is to be drawn from a place on, by SUMO's states of the traffic lights; None: nothing has changed."""
        at = np.array([x_m, y_m])
        if not np.hypot(*(at - self._chosen_at_m)) < MOVED_M:
            distance = np.hypot(*(self._heads.place_m[:, :2] - at).T)
            chosen = np.flatnonzero(distance < DRAWN_M).astype(np.int32)
            if not np.array_equal(chosen, self._chosen):
                self._shown = None
            self._chosen, self._chosen_at_m = chosen, at
        letters = [self._letter(head, states) for head in self._chosen.tolist()]
        if letters == self._shown:
            return None
        self._shown = letters
        return head_tile(self._heads, self._chosen, letters, self._origin_m, self._light)

    def signals(self) -> set[str]:
        """The traffic lights whose states are needed."""
        return set(self._heads.signal)

    def _letter(self, head: int, states: Mapping[str, str]) -> str:
        state, lamp = states.get(self._heads.signal[head], ""), self._heads.lamp[head]
        return state[lamp] if lamp < len(state) else ""


def head_tile(heads: Heads, chosen: IntArray, letters: Sequence[str], origin_m: FloatArray, light: Light) -> Tile:
    """Heads (k,) with their lamps lit as the letters say."""
    template, lamp_vertices = _head()
    k, n = len(chosen), len(template.vertices_m)
    place = heads.place_m[chosen] - np.append(origin_m, 0.0)
    ones = np.ones((k, 3))
    mesh = instances(template, place, heads.yaw_rad[chosen], ones, ones)
    rgb: UInt8Array = shade(mesh.albedo, mesh.normals, light).reshape(k, n, 3)
    for head, letter in enumerate(letters):
        for lamp, lit in enumerate(LIT_BY.get(letter, NONE_LIT)):
            if lit:
                rgb[head, lamp_vertices[lamp]] = LIT[lamp]
    grain = np.zeros(k * n, dtype=np.uint8)
    return Tile(mesh.vertices_m, mesh.faces, rgb.reshape(-1, 3), grain, len(mesh.faces))


@cache
def _head() -> tuple[Mesh, tuple[IntArray, ...]]:
    """A head on its pole, lamps facing its own +y, and the vertices of each lamp."""
    body = [
        _box([0.0, 0.0, 0.0], [0.14, 0.14, 3.45], STEEL),
        _box([0.0, 0.0, 2.30], [0.42, 0.36, 1.10], DARK),  # hides a head of the scene, whose lamps are dead
    ]
    first = sum(len(part.vertices_m) for part in body)
    half = 0.5 * LAMP_M
    lamps, vertices = [], []
    for number in range(3):
        z, y = 3.19 - 0.34 * number, 0.19
        corners = np.array([[[half, y, z - half], [-half, y, z - half], [-half, y, z + half], [half, y, z + half]]])
        lamps.append(polygons(corners, DIM[number]))
        vertices.append(np.arange(first + 4 * number, first + 4 * number + 4, dtype=np.int32))
    return merge([*body, *lamps]), tuple(vertices)


def _box(origin: list[float], size: list[float], albedo: FloatArray) -> Mesh:
    return boxes(np.array([origin]), np.zeros(1), np.array([size]), albedo)
