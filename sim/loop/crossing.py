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
    """The step in which the front bumper came into the junction."""

    truth: Truth
    signals: dict[int, tuple[str, str]]
    coming: Sequence[Comer]


class Crossing:
    """Watches one junction after the other.

    Which way through the junction the ego takes shows only when it is some metres inside. Then, or when it has left the
    junction, it is judged by what was the case when it came in, and the events have that time and place.
    """

    def __init__(self, rights: Rights) -> None:
        self._rights = rights
        self._front_lane = -1
        self._entry: _Entry | None = None
        self._judged = False
        self._coming: dict[str, tuple[int, float]] = {}  # lane and last speed of those who were coming when the ego entered

    def on_red(self, lane: int) -> bool:
        """Whether the ego came into the present junction on red, if ``lane`` is its way through."""
        return self._entry is not None and _is_red(self._letters(self._entry, lane))

    def look(self, m: Moment) -> list[Event]:
        """The events that show themselves in this step."""
        inside = m.front_lane in self._rights.junction_of
        was_inside, before = self._front_lane in self._rights.junction_of, self._front_lane
        self._front_lane = m.front_lane
        found: list[Event] = []
        if inside and not was_inside:
            self._entry, self._judged = _Entry(m.truth, m.signals, m.coming), False
            self._coming = {comer.name: (comer.lane, comer.speed_mps) for comer in m.coming if not comer.held}
        if self._entry is None:
            return found
        way = m.front_lane if inside else before
        if not self._judged and (m.truth.in_junction or not inside or _all_red(self._entry)):
            self._judged = True
            found.extend(self._judge(self._entry, way))
        if inside or m.truth.in_junction:
            found.extend(self._braking(m, way))
        else:
            self._entry = None
        return found

    def _judge(self, entry: _Entry, lane: int) -> Iterator[Event]:
        """Was the signal red, and was somebody there who had the right of way."""
        letters = self._letters(entry, lane)
        if _is_red(letters):
            yield event(EventKind.RED_LIGHT, entry.truth, "passed a red signal", self._rights.junction_of.get(lane, ""))
            return
        if letters is not None and letters[1] == "G":
            self._coming = {}
            return
        for comer in entry.coming:
            if comer.held or not self._rights.must_yield(lane, comer.lane):
                continue
            soon = comer.distance_m < comer.speed_mps * TAKEN_S and comer.speed_mps > MOVING_MPS
            if comer.rest_m > -comer.distance_m if comer.is_inside else soon:
                self._coming.pop(comer.name, None)
                yield event(EventKind.RIGHT_OF_WAY, entry.truth, "took the right of way", comer.name)

    def _letters(self, entry: _Entry, lane: int) -> tuple[str, str] | None:
        """The letters of the signal for the way that ``lane`` inside the junction is a part of; None without a signal."""
        same = (letters for first, letters in entry.signals.items() if self._rights.same_link(first, lane))
        return entry.signals.get(lane) or next(same, None)

    def _braking(self, m: Moment, way: int) -> Iterator[Event]:
        """Others that had the right of way, and brake hard while the ego is in the junction."""
        for row, name in enumerate(m.users.names):
            if name not in self._coming:
                continue
            lane, speed_before = self._coming[name]
            speed = float(m.users.speed_mps[row])
            self._coming[name] = lane, speed
            if speed_before - speed > HARD_MPS and self._rights.must_yield(way, lane) and not self.on_red(way):
                del self._coming[name]
                yield event(EventKind.RIGHT_OF_WAY, m.truth, "made somebody brake who had the right of way", name)


def _is_red(letters: tuple[str, str] | None) -> bool:
    return letters is not None and letters[0] in RED and letters[1] in RED


def _all_red(entry: _Entry) -> bool:
    return len(entry.signals) > 0 and all(_is_red(letters) for letters in entry.signals.values())
