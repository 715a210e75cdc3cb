"""Streets that the map has no views of, learnt as they are driven: the second time they are known ground.

On such a street the place along it is dead reckoning, and only its end tells what that was wrong by. That tells backwards, too:
the metres between any place of the street and its end are known as well as those from its beginning. So views are kept with the
places at which the vehicle took itself to be, and moved to where it was once the end has told (a fixed-interval smoother: Rauch,
Tung and Striebel 1965, for the one axis along the street). Views are the localizer's (``core/views``), a metre apart; of those
a few metres about where the vehicle takes itself to be, the likeliest one tells the place to a quarter of a metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from hippodrome.core.navigation.placing import LanePlace
from hippodrome.core.navigation.track import Track, along_variance_m2, farther_on
from hippodrome.core.navigation.witnesses import WHITE_PER_M
from hippodrome.core.types import Float32Array, FloatArray, Frame
from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import describe

SPACING_M: Final = 0.8  # between the views that are kept
SURE_M: Final = 0.7  # a place along the way that is known so well needs no views, and tells where the ones before it were
JUMP_M: Final = 6.0  # a pose that is corrected by more is another one: what led there tells nothing
MOST_WAY_M: Final = 400.0  # of dead reckoning, through which views are told where they were
MOST_VIEWS: Final = 1000  # of those that are not told yet, and of each lane
REACH_SIGMAS, REACH_M, MOST_REACH_M = 3.0, 2.0, 12.0  # of the views that are compared, about where the vehicle takes itself to be
LEAST_COMPARED, ALIKE, RIVAL_M, CLEARER = 5, 0.4, 4.0, 0.1  # and by how much the likeliest beats those farther from it
BLUR: Final = 0.25  # views that are less alike than the likeliest by this count nothing in the mean that tells the place
MATCH_M: Final = 0.3  # deviation of the place by a view, beside that of the view's own place


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A view of a street.

    Args:
        lane: that it was seen from.
        position_m: along the lane.
        variance_m2: of it.
        view: (D,) descriptor.
        along: (2,) direction of the lane there.
        sums_m: (3, 2) way, its drift and what it was corrected by until then, in the network frame.
    """

    lane: int
    position_m: float
    variance_m2: float
    view: Float32Array
    along: FloatArray
    sums_m: FloatArray


class StreetMemory:
    """Views of streets, kept where the place is not known well, and recognised where the vehicle comes by again.

    Args:
        views: how frames are described.
    """

    def __init__(self, views: ViewCellConfig) -> None:
        self._views = views
        self._sums_m = np.zeros((3, 2))
        self._last: FloatArray | None = None
        self._since_m = 0.0
        self._pending: list[Sight] = []
        self._known: dict[int, list[Sight]] = {}

    @property
    def count(self) -> int:
        """How many views have been told where they were seen."""
        return sum(map(len, self._known.values()))

    def step(
        self,
        track: Track | None,
        place: LanePlace | None,
        frame: Frame | None,
        distance_m: float,
        turned_rad: float,
        drift_sigma: float,
    ) -> tuple[Track | None, float]:
        """Take a step in: the track, corrected by a view that is recognised, and that one's deviation (m), nan without one.

        Args:
            track: the pose that is steered by; None without a fix.
            place: on a lane outside of junctions; None elsewhere.
            frame: of this step.
            distance_m: driven.
            turned_rad: meanwhile.
            drift_sigma: standard deviation of the share by which the distance is wrong.
        """
        if track is None:
            self._last, self._pending = None, []
            return None, math.nan
        self._move(track, distance_m, turned_rad, drift_sigma)
        self._settle(track)
        self._since_m += distance_m
        sigma_m = math.nan
        if place is not None and frame is not None and self._since_m > SPACING_M:
            self._since_m = 0.0
            seen = describe(frame, self._views).astype(np.float32)
            track, sigma_m = self._recognise(track, place, seen)
            if track.along_sigma_m > SURE_M and len(self._pending) < MOST_VIEWS:
                along = np.array([math.cos(place.heading_rad), math.sin(place.heading_rad)])
                variance = along_variance_m2(track, along)
                self._pending.append(Sight(place.lane, place.position_m, variance, seen, along, self._sums_m.copy()))
        self._last = track.pose
        return track, sigma_m

    def _move(self, track: Track, distance_m: float, turned_rad: float, drift_sigma: float) -> None:
        """Sum up the way, its drift, and what the pose was corrected by."""
        if self._last is None:
            return
        chord = self._last[2] + 0.5 * turned_rad
        step = distance_m * np.array([math.cos(chord), math.sin(chord)])
        corrected = track.pose[:2] - self._last[:2] - step
        self._sums_m = self._sums_m + np.stack([step, drift_sigma * step, corrected])
        if float(np.hypot(*corrected)) > JUMP_M:
            self._pending = []

    def _settle(self, track: Track) -> None:
        """Move the views to where they were seen, once the place along their street is known again."""
        if not self._pending or along_variance_m2(track, self._pending[-1].along) > SURE_M**2:
            return
        for sight in self._pending:
            settled = smoothed(sight, self._sums_m, along_variance_m2(track, sight.along))
            if settled is not None:
                self._keep(settled)
        self._pending = []

    def _keep(self, sight: Sight) -> None:
        """Keep a view in the place of those beside it that are known worse."""
        known = self._known.setdefault(sight.lane, [])
        beside = [one for one in known if abs(one.position_m - sight.position_m) < 0.5 * SPACING_M]
        if any(one.variance_m2 < sight.variance_m2 for one in beside) or len(known) >= MOST_VIEWS:
            return
        self._known[sight.lane] = [one for one in known if one not in beside] + [sight]

    def _recognise(self, track: Track, place: LanePlace, seen: Float32Array) -> tuple[Track, float]:
        """The track after the likeliest view about the place, and the deviation of what that tells; nan where none is clear."""
        reach_m = min(REACH_SIGMAS * track.along_sigma_m + REACH_M, MOST_REACH_M)
        near = [one for one in self._known.get(place.lane, ()) if abs(one.position_m - place.position_m) < reach_m]
        if len(near) < LEAST_COMPARED:
            return track, math.nan
        off_m = np.array([one.position_m for one in near]) - place.position_m
        best, ahead_m = likeliest(np.stack([one.view for one in near]), off_m, seen)
        if best < 0:
            return track, math.nan
        variance, mine = near[best].variance_m2 + MATCH_M**2, track.along_sigma_m**2
        if mine > variance:  # just so much that the track becomes as good as the view: the same error is told again and again
            noise_m = math.sqrt(mine * variance / (mine - variance))
            track, fits = farther_on(track, ahead_m, noise_m)
        else:
            fits = ahead_m**2 < REACH_SIGMAS**2 * (mine + variance)
        return track, math.sqrt(variance) if fits else math.nan


def smoothed(sight: Sight, sums_m: FloatArray, variance_m2: float) -> Sight | None:
    """A view moved to where it was seen, by what the pose was corrected by since; None after too long a way.

    Args:
        sight: as it was taken down.
        sums_m: (3, 2) way, drift and corrections until now.
        variance_m2: of the place along the view's street now.
    """
    way_m, drift_m, corrected_m = ((sums_m - sight.sums_m) @ sight.along).tolist()
    if float(np.hypot(*(sums_m - sight.sums_m)[0])) > MOST_WAY_M:
        return None
    backwards = drift_m**2 + WHITE_PER_M * abs(way_m) + variance_m2
    total = sight.variance_m2 + backwards
    position_m = sight.position_m + sight.variance_m2 / total * corrected_m
    return replace(sight, position_m=position_m, variance_m2=sight.variance_m2 * backwards / total)


def likeliest(views: Float32Array, off_m: FloatArray, seen: Float32Array) -> tuple[int, float]:
    """Which of views (n, D) a frame is like, -1 if none is clearly, and how far ahead that is; views are ``off_m`` (n,) ahead."""
    common = views.mean(axis=0)
    rest, mine = views - common, seen - common
    lengths = np.linalg.norm(rest, axis=1) * np.linalg.norm(mine)
    alike = (rest @ mine) / np.maximum(lengths, 1e-6)
    best = int(np.argmax(alike))
    others = alike[np.abs(off_m - off_m[best]) > RIVAL_M]
    inside = off_m.min() < off_m[best] < off_m.max()
    if not inside or alike[best] < ALIKE or (len(others) and others.max() > alike[best] - CLEARER):
        return -1, 0.0
    weight = np.maximum(alike - alike[best] + BLUR, 0.0) * (np.abs(off_m - off_m[best]) < RIVAL_M)
    return best, float(weight @ off_m / weight.sum())
