"""The floor of a search: what a route must score at least, over a whole drive and on the way to there."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from hippodrome.core.matching.search.track import Track
from hippodrome.core.types import FloatArray

_SLACK_NATS = 12.0  # how far a route may fall behind its share of the floor on the way; one that does so hardly makes up for it
_MOST_TURN_RAD = 0.5  # most that the turn of one step counts, as where starts are sought


class Floor(NamedTuple):
    """The least log likelihood of a route over a whole drive, and how much of it each sample may have used up.

    A route that is to end with ``total_nats`` has spent about ``share`` of them at each sample. One that has spent much more is
    given up early. That makes it possible to search for routes that need not be found unless they are good.
    """

    total_nats: float
    share: FloatArray  # (T,) from 0 to 1

    @classmethod
    def over(cls, track: Track, total_nats: float) -> Self:
        """A floor that is used up half by driving and half by turning."""
        turned = np.minimum(np.abs(np.diff(track.heading_rad, prepend=track.heading_rad[0])), _MOST_TURN_RAD)
        turning, driving = np.cumsum(turned), np.arange(len(turned), dtype=np.float64)
        return cls(total_nats, 0.5 * turning / max(turning[-1], 1e-9) + 0.5 * driving / max(driving[-1], 1.0))

    def from_sample(self, first: int, step: int = 1) -> FloatArray:
        """Least score of a route that begins with 0 at sample ``first``, at this sample and every ``step``-th one after it."""
        return self._least_nats(self.share[first::step] - self.share[first])

    def back_from_sample(self, last: int) -> FloatArray:
        """Least score of a route back in time that begins with 0 at sample ``last``, at this sample and every one before it."""
        return self._least_nats(self.share[last] - self.share[last::-1])

    def _least_nats(self, used: FloatArray) -> FloatArray:
        least: FloatArray = np.maximum(self.total_nats * used - _SLACK_NATS, self.total_nats)
        return least
