"""Who speaks for the place at which an arrival is to be said: is it that place, and how well is it known along the way?

Two questions, since two things go wrong. *Another place* that looks alike: recognised views, ends of lanes that are seen where
they should be, the share of the hypotheses that are there, and the ground are witnesses that err independently. Each
adds the logarithm of how much likelier it is to say what it says at this place than at another (log odds, as in the occupancy
grids of Moravec and Elfes, ICRA 1985); what was heard long ago fades, as the place may have been lost since. *The right street,
but metres off*: a filter that hears the same error again and again becomes too sure. So the deviation along the way is never
taken to be less than what the best single source tells: hypotheses as they are spread, or dead reckoning since a view or an end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from hippodrome.core.navigation.track import Track
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

AGREES_M, AGREES_ASIDE_M, AGREES_RAD = 3.0, 2.0, 0.5  # a recognised view so near says the same place; beside it is another lane
VIEW_PER_M, AGAINST_PER_M, MOST_VIEWS = 0.15, 0.3, 4.0  # ten metres of views that agree are one of independent views: 1 : 4.5
END_AGREES_M, END, MOST_ENDS = 1.5, 1.0, 2.0  # an end of a lane within so much: every street has one, and 1 : 2.7 is enough
END_PER_M: Final = 0.1  # it is seen over some ten metres
FADES_M: Final = 200.0
MOST_SHARE: Final = 2.0  # the hypotheses all come from one model, which may be wrong as a whole
FITS, PER_FIT, GROUND_RANGE = 0.85, 25.0, (-3.0, 2.0)  # ground that fits so well speaks neither for nor against the place
ENOUGH: Final = 1.5  # in all: 1 : 4.5 against another place, beside what the plan that led here says
VIEW_M, END_M = 0.6, 0.4  # deviations along the way of a recognised view, and of an end of a lane
WHITE_PER_M: Final = 0.004  # variance along the way that each metre of dead reckoning adds, beside the scale's share
UNKNOWN_M2: Final = 1e4


@dataclass(frozen=True, slots=True, eq=False)
class Witnesses:
    """What was said of the place so far.

    Args:
        views: log odds by recognised views.
        ends: log odds by ends of lanes.
        measured_m2: variance along the way when it was last measured by a single source.
        way_m: (2,) driven since, in the network frame.
        drift_m: (2,) standard deviation of it by the scale.
    """

    views: float = 0.0
    ends: float = 0.0
    measured_m2: float = UNKNOWN_M2
    way_m: FloatArray = field(default_factory=lambda: np.zeros(2))
    drift_m: FloatArray = field(default_factory=lambda: np.zeros(2))

    def reckoned_sigma_m(self, heading_rad: float) -> float:
        """Standard deviation along a heading by dead reckoning since the last measurement: what was driven across is read."""
        along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
        return math.sqrt(self.measured_m2 + float(along @ self.drift_m) ** 2 + WHITE_PER_M * abs(float(along @ self.way_m)))

    def along_sigma_m(self, track: Track, spread_m: float) -> float:
        """The deviation along the way that an arrival may rely on; ``spread_m`` is that of the hypotheses."""
        return max(track.along_sigma_m, min(spread_m, self.reckoned_sigma_m(float(track.pose[2]))))

    def know_better(self, covariance: FloatArray, heading_rad: float) -> bool:
        """Whether the place along the way is known better than by hypotheses with a covariance (3, 3).

        Between ends of lanes they are moved by the same metres, each with a scale of its own, which one wrong view can choose.
        """
        along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
        return float(along @ covariance[:2, :2] @ along) > self.reckoned_sigma_m(heading_rad) ** 2

    def log_odds(self, share: float, fits: float) -> float:
        """Of this place against another one; with the share of the hypotheses that are here, and of the ground that fits."""
        inside = min(max(share, 1e-6), 1.0 - 1e-6)
        ground = min(max(PER_FIT * (fits - FITS), GROUND_RANGE[0]), GROUND_RANGE[1])
        return min(math.log(inside / (1.0 - inside)), MOST_SHARE) + self.views + self.ends + ground

    def vouch(self, share: float, fits: float) -> bool:
        """Whether the place may be relied on to be the one that it is taken for."""
        return self.log_odds(share, fits) > ENOUGH


def heard(
    before: Witnesses,
    track: Track | None,
    distance_m: float,
    drift_sigma: float,
    told: FloatArray | None,
    end_off_m: float = math.nan,
) -> Witnesses:
    """The witnesses after a step.

    Args:
        before: them before it.
        track: the pose that is steered by; None without a fix, of which nobody says anything.
        distance_m: driven in the step.
        drift_sigma: standard deviation of the share by which it is wrong.
        told: (3,) the pose by the localizer, where it recognised a view.
        end_off_m: how far an end of the lane is seen from where it should be; nan where none is seen.
    """
    if track is None:
        return before
    far_m = abs(distance_m)
    kept = math.exp(-far_m / FADES_M)
    step = distance_m * np.array([math.cos(track.pose[2]), math.sin(track.pose[2])])
    now = replace(
        before,
        views=kept * before.views,
        ends=kept * before.ends,
        way_m=before.way_m + step,
        drift_m=before.drift_m + drift_sigma * step,
    )
    if told is not None:
        agrees = _agrees(track.pose, told)
        new_m = max(distance_m, 0.0)  # whoever backs has seen the same before
        views = now.views + new_m * (VIEW_PER_M if agrees else -AGAINST_PER_M)
        now = replace(now, views=min(max(views, -MOST_VIEWS), MOST_VIEWS))
        now = measured(now, VIEW_M, float(track.pose[2])) if agrees else now
    if not math.isnan(end_off_m):
        agrees = abs(end_off_m) < END_AGREES_M
        ends = now.ends + END_PER_M * far_m * (END if agrees else -END)
        now = replace(now, ends=min(max(ends, -MOST_ENDS), MOST_ENDS))
        now = measured(now, END_M, float(track.pose[2])) if agrees else now
    return now


def measured(before: Witnesses, sigma_m: float, heading_rad: float) -> Witnesses:
    """The witnesses after the place along the way was measured by a source of its own, if that knows it better."""
    if before.reckoned_sigma_m(heading_rad) < sigma_m:
        return before
    return replace(before, measured_m2=sigma_m**2, way_m=np.zeros(2), drift_m=np.zeros(2))


def _agrees(pose: FloatArray, told: FloatArray) -> bool:
    """Whether a pose that was told is that of the same place."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    east_m, north_m = (float(told[k] - pose[k]) for k in (0, 1))
    ahead_m, left_m = cos * east_m + sin * north_m, cos * north_m - sin * east_m
    turned = abs(float(wrap_compiled(told[2] - pose[2])))
    return abs(ahead_m) < AGREES_M and abs(left_m) < AGREES_ASIDE_M and turned < AGREES_RAD
