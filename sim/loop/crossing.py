"""Red signals and rights of way at the junctions that the ego enters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from hippodrome.sim.loop.junction import Comer
from hippodrome.sim.loop.moment import Moment, event
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.types import Event, EventKind, Truth
from hippodrome.sim.loop.ways import Ways

TAKEN_S: Final = 2.0  # whoever has the right of way and would be at the junction within this time was cut off
HARD_MPS: Final = 0.4  # lost in one step of 0.1 s: beyond what SUMO's drivers brake with of their own accord (3.5 m/s^2)
LONGEST_S: Final = 20.0  # who is still inside is judged by where he is
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

    Which way through the junction the ego takes shows only when it is some metres inside: once its rear axle is, and the front is
    on the way that the indicator means. Who swings wide into a sharp bend is for some metres where the way straight on lies, so
    that with another front it shows when the front leaves the junction, or after ``LONGEST_S``. Then it is judged by what was the
    case when it came in, and the events have that time and place; those who braked hard meanwhile are judged then, too.
    """

    def __init__(self, rights: Rights, ways: Ways) -> None:
        self._rights, self._ways = rights, ways
        self._front_lane = -1
        self._entry: _Entry | None = None
        self._from = -1  # the lane that it came from
        self._judged, self._way = False, -1
        self._braked: list[tuple[Truth, str, int]] = []  # those who braked hard meanwhile: when, who, on which lane
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
            self._entry, self._judged, self._from, self._braked = _Entry(m.truth, m.signals, m.coming), False, before, []
            self._coming = {comer.name: (comer.lane, comer.speed_mps) for comer in m.coming if not comer.held}
        if self._entry is None:
            return found
        if inside or m.truth.in_junction:
            self._note_braking(m)
        if not self._judged and (not inside or self._shows(m, self._entry) or _all_red(self._entry)):
            self._judged, self._way = True, m.front_lane if inside else self._way_taken(m.front_lane, before)
            found.extend(self._judge(self._entry, self._way))
        if self._judged:
            found.extend(self._judge_braking(self._way))
        if not inside and not m.truth.in_junction:
            self._entry = None
        return found

    def _shows(self, m: Moment, entry: _Entry) -> bool:
        """Whether an ego in the junction is on the way that it takes."""
        if m.truth.t_s - entry.truth.t_s > LONGEST_S:
            return True
        meant = self._ways.meant(self._from, m.truth.indicator) if self._from >= 0 else None
        if meant is None or not meant.inside:
            return m.truth.in_junction
        return m.truth.in_junction and (m.front_lane in meant.inside or self._rights.same_link(m.front_lane, meant.inside[0]))

    def _way_taken(self, front_lane: int, inner: int) -> int:
        """The lane inside the junction that led from where the ego came from to where its front is; else the last one inside."""
        edge_of = self._ways.network.lane_edge
        for way in self._ways.out_of(self._from) if min(self._from, front_lane) >= 0 else ():
            if way.inside and edge_of[way.target] == edge_of[front_lane]:
                return way.inside[0]
        return inner

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

    def _note_braking(self, m: Moment) -> None:
        """Remember who brakes hard while the ego is in the junction."""
        for row, name in enumerate(m.users.names):
            if name not in self._coming:
                continue
            lane, speed_before = self._coming[name]
            speed = float(m.users.speed_mps[row])
            self._coming[name] = lane, speed
            if speed_before - speed > HARD_MPS:
                self._braked.append((m.truth, name, lane))

    def _judge_braking(self, way: int) -> Iterator[Event]:
        """Of those who braked hard, the ones who had the right of way."""
        braked, self._braked = self._braked, []
        for truth, name, lane in braked:
            if name in self._coming and self._rights.must_yield(way, lane) and not self.on_red(way):
                del self._coming[name]
                yield event(EventKind.RIGHT_OF_WAY, truth, "made somebody brake who had the right of way", name)


def _is_red(letters: tuple[str, str] | None) -> bool:
    return letters is not None and letters[0] in RED and letters[1] in RED


def _all_red(entry: _Entry) -> bool:
    return len(entry.signals) > 0 and all(_is_red(letters) for letters in entry.signals.values())
