"""What lies ahead of the ego: the way that it means to take, its signal, and who else comes to the junction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import libsumo

from hippodrome.core.navigation.types import Indicator, Lamp
from hippodrome.sim.loop.footing import Footing
from hippodrome.sim.loop.ground import Ground
from hippodrome.sim.loop.junction import Comer, Entry, comers, in_the_way
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.users import Users
from hippodrome.sim.loop.ways import Way, Ways

SIGHT_M: Final = 80.0  # so far ahead junctions count: braking from 50 km/h at 2 m/s^2 takes 50 m
LAMPS: Final = {"g": Lamp.GREEN, "G": Lamp.GREEN, "y": Lamp.YELLOW, "Y": Lamp.YELLOW, "r": Lamp.RED, "R": Lamp.RED, "u": Lamp.RED}


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
    """The junction ahead, in one step.

    Args:
        signals: SUMO's letter of the lamp for each first lane inside, of all ways out of the ego's last lane before it.
        coming: vehicles on their way into the junction.
        way_is_free: for the way that the indicator means.
        lamp: of that way's signal.
    """

    signals: dict[int, str]
    coming: Sequence[Comer]
    way_is_free: bool
    lamp: Lamp


class Lookout:
    """Looks ahead for one town."""

    def __init__(self, ground: Ground, ways: Ways, rights: Rights) -> None:
        self._ground, self._ways, self._rights = ground, ways, rights
        self._lane_of = {name: lane for lane, name in enumerate(ground.network.lane_ids)}
        self._lengths_m = [ground.lane_length_m(lane) for lane in range(ground.network.lane_count)]

    def look(
        self, footing: Footing, before: int, indicator: Indicator, speed_mps: float, users: Users, ego_m: tuple[float, float]
    ) -> Ahead:
        """Looks ahead.

        Args:
            footing: where the ego stands.
            before: the last lane outside of junctions that its front was on.
            indicator: what it means to do.
            speed_mps: its own.
            users: the vehicles near it.
            ego_m: its place.
        """
        signals = self._signals(before)
        front = footing.front_lane
        if front in self._rights.junction_of:  # inside: others are noted, in case that it came in just now
            return Ahead(signals, self._coming(front, users, ego_m), True, Lamp.NONE)
        found = self._junction_ahead(front, footing.front_rest_m, indicator) if front >= 0 else None
        if found is None:
            return Ahead(signals, (), True, Lamp.NONE)
        way, line_m = found
        lane = way.inside[0]
        letter = self._letter(lane)
        coming = self._coming(lane, users, ego_m)
        way_m = sum(self._lengths_m[one] for one in way.inside)
        entry = Entry(lane, line_m, way_m, way.turn_rad, max(speed_mps, 0.0), letter)
        return Ahead(signals, coming, not in_the_way(entry, coming, self._rights), LAMPS.get(letter, Lamp.NONE))

    def lamps_near(self, x_m: float, y_m: float, reach_m: float) -> dict[tuple[float, float, float], str]:
        """SUMO's letters of the signals near a place, by x, y and width of the lane's end; of several the green one."""
        found: dict[tuple[float, float, float], str] = {}
        for lane in self._rights.signal_of:
            x, y = self._ground.network.lane_points_m(lane)[0].tolist()
            letter, at = self._letter(lane), (round(x, 1), round(y, 1), float(self._ground.network.width_m[lane]))
            if abs(x - x_m) < reach_m and abs(y - y_m) < reach_m and (at not in found or letter in "gG"):
                found[at] = letter
        return found

    def lanes_of(self, users: Users) -> list[int]:
        """The lanes (k,) that vehicles are on, -1 where they are closed to cars."""
        return [self._lane_of.get(libsumo.vehicle.getLaneID(name), -1) for name in users.names]

    def _coming(self, lane: int, users: Users, ego_m: tuple[float, float]) -> list[Comer]:
        junction = self._rights.junction_of.get(lane)
        return [] if junction is None else comers(junction, users, ego_m, self._rights, self._lane_of, self._lengths_m)

    def _junction_ahead(self, lane: int, rest_m: float, indicator: Indicator) -> tuple[Way, float] | None:
        """The way through the first junction ahead where somebody else may come, and the distance of the front from it.

        Where one road merely goes on as another one, there is nobody to wait for, and the next junction is the one ahead.
        """
        while rest_m < SIGHT_M:
            way = self._ways.meant(lane, indicator)
            if way is None or not way.inside:
                return None
            first = way.inside[0]
            if len(self._ways.out_of(lane)) > 1 or first in self._rights.signal_of or self._rights.has_foes(first):
                return way, rest_m
            lane = way.target
            rest_m += sum(self._lengths_m[one] for one in (*way.inside, lane))
        return None

    def _signals(self, lane: int) -> dict[int, str]:
        firsts = [way.inside[0] for way in self._ways.out_of(lane) if way.inside] if lane >= 0 else []
        return {first: self._letter(first) for first in firsts if first in self._rights.signal_of}

    def _letter(self, lane: int) -> str:
        """SUMO's letter of the signal before a lane inside a junction; empty without one."""
        if lane not in self._rights.signal_of:
            return ""
        signal, number = self._rights.signal_of[lane]
        return str(libsumo.trafficlight.getRedYellowGreenState(signal)[number])
