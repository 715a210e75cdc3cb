"""Red signals and rights of way at the junctions that the ego enters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from hippodrome.sim.loop.junction import Comer
from hippodrome.sim.loop.moment import Moment, event
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.types import Event, EventKind, Truth

TAKEN_S: Final = 2.0  # whoever has the right of way and would be at the junction within this time was cut off
HARD_MPS: Final = 0.4  # lost in one step of 0.1 s: beyond what SUMO's drivers brake with of their own accord (3.5 m/s^2)
MOVING_MPS: Final = 0.3
RED: Final = "rRu"


@dataclass(frozen=True, slots=True)
class _Entry:
    """The step in which the front bumper came into the junction, and the first lanes of all ways on from where it came."""

    truth: Truth
    signals: dict[int, tuple[str, str]]
    coming: Sequence[Comer]
    ways: Sequence[int]


class Crossing:
    """Watches one junction after the other.

    Which way through the junction the ego takes shows only when it leaves it: whoever goes straight on for some metres may yet
    turn round a sharp corner. Then it is judged by what was the case when it came in, and by what others did meanwhile; the
    events have that time and place. Where it would be the same on all ways on, it is judged as soon as the ego is in the
    junction, and where all signals are red, at once.
    """

    def __init__(self, rights: Rights) -> None:
        self._rights = rights
        self._junction: str | None = None  # that the front is in
        self._before = self._way = -1  # the last lane that the front was on, outside of junctions and inside of them
        self._entry: _Entry | None = None
        self._judged = False
        self._coming: dict[str, tuple[int, float]] = {}  # lane and last speed of those who were coming when the ego entered
        self._braked: dict[str, tuple[int, Truth]] = {}  # of these, lane of those who braked hard, and when they did

    def on_red(self, lane: int) -> bool:
        """Whether the ego came into the present junction on red, if ``lane`` is its way through."""
        return self._entry is not None and _is_red(self._letters(self._entry, lane))

    def look(self, m: Moment) -> list[Event]:
        """The events that show themselves in this step."""
        before, self._junction = self._junction, self._rights.junction_of.get(m.front_lane)
        found: list[Event] = []
        if self._junction != before:
            found.extend(self._decide([self._way]))
            if self._junction is not None:
                ways = self._rights.ways_from.get(self._before, [])
                self._entry, self._judged, self._braked = _Entry(m.truth, m.signals, m.coming, ways), False, {}
                self._coming = {comer.name: (comer.lane, comer.speed_mps) for comer in m.coming if not comer.held}
        self._before = m.front_lane if self._junction is None else self._before
        if self._entry is None:
            return found
        self._way = m.front_lane if self._junction is not None else self._way
        self._see_braking(m)
        if self._junction is None:
            found.extend(self._decide([self._way]))
        elif m.truth.in_junction or _all_red(self._entry):
            found.extend(self._decide(self._entry.ways))
        if self._junction is None and not m.truth.in_junction:
            self._entry = None
        return found

    def _decide(self, ways: Sequence[int]) -> Iterator[Event]:
        """The events that there are whichever of some ways the ego takes, where that makes no difference; each once."""
        entry = self._entry
        if entry is None or not ways:
            return
        verdicts = [self._judge(entry, way) for way in ways]
        if not self._judged and all(verdict == verdicts[0] for verdict in verdicts):
            self._judged = True
            for one in verdicts[0]:
                self._coming.pop(one.other, None)
                yield one
        for name, (lane, truth) in list(self._braked.items()):
            guilty = {self._has_to_let_pass(entry, way, lane) for way in ways}
            if self._judged and len(guilty) == 1:
                del self._braked[name]
                if name in self._coming and guilty.pop():
                    del self._coming[name]
                    yield event(EventKind.RIGHT_OF_WAY, truth, "made somebody brake who had the right of way", name)

    def _judge(self, entry: _Entry, lane: int) -> list[Event]:
        """Was the signal red, and was somebody there who had the right of way, if ``lane`` is the ego's way."""
        if _is_red(self._letters(entry, lane)):
            return [event(EventKind.RED_LIGHT, entry.truth, "passed a red signal", self._rights.junction_of.get(lane, ""))]
        found = []
        for comer in entry.coming:
            soon = comer.distance_m < comer.speed_mps * TAKEN_S and comer.speed_mps > MOVING_MPS
            is_near = comer.rest_m > -comer.distance_m if comer.is_inside else soon
            if is_near and not comer.held and self._has_to_let_pass(entry, lane, comer.lane):
                found.append(event(EventKind.RIGHT_OF_WAY, entry.truth, "took the right of way", comer.name))
        return found

    def _has_to_let_pass(self, entry: _Entry, lane: int, other: int) -> bool:
        """Whether on one way the ego has to let those pass that are on another; on a red signal that is its lesser fault."""
        letters = self._letters(entry, lane)
        if letters is not None and (_is_red(letters) or letters[1] == "G"):
            return False
        return self._rights.must_yield(lane, other)

    def _letters(self, entry: _Entry, lane: int) -> tuple[str, str] | None:
        """The letters of the signal for the way that ``lane`` inside the junction is a part of; None without a signal."""
        same = (letters for first, letters in entry.signals.items() if self._rights.same_link(first, lane))
        return entry.signals.get(lane) or next(same, None)

    def _see_braking(self, m: Moment) -> None:
        """Notes who brakes hard while the ego is in the junction."""
        for row, name in enumerate(m.users.names):
            if name not in self._coming:
                continue
            lane, speed_before = self._coming[name]
            speed = float(m.users.speed_mps[row])
            self._coming[name] = lane, speed
            if speed_before - speed > HARD_MPS and name not in self._braked:
                self._braked[name] = lane, m.truth


def _is_red(letters: tuple[str, str] | None) -> bool:
    return letters is not None and letters[0] in RED and letters[1] in RED


def _all_red(entry: _Entry) -> bool:
    return len(entry.signals) > 0 and all(_is_red(letters) for letters in entry.signals.values())
