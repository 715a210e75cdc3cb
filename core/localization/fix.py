"""Whether the localizer knows where it is: evidence for and against the believed place, and the status that follows from it.

Everything here is pure: a ``Fix`` and what one query frame showed give the next ``Fix``. Evidence is counted per query frame, so
that standing still neither adds any nor takes any away. A frame passes through three functions, in this order:

    ``faded``       old evidence counts less
    ``recognised``  a view stood out and measured a pose, which agrees with the incumbent, with the challenger, or with neither
    ``checked``     once a pose is adopted: the map shows the believed place, and the frame is like it or not

The status is read off the fix and the standard deviation of the position (``status``). The first line that holds is taken:

    UNKNOWN     no pose was adopted yet
    LOST        the position is known to ``lost_sigma_m`` or worse
    DOUBTED     dead reckoning has led off all roads; or the believed place is not like what is seen (z-score below ``seen_z``);
                or the challenger's evidence has reached both ``doubt_evidence`` and the incumbent's
    OFF_MAP     no view cell of the map lies around the believed place
    LOCALIZED   none of the above

What leads from one status to another; nothing leads back to UNKNOWN:

    from                 to                   when
    UNKNOWN              LOCALIZED            a challenger's evidence reaches ``fix_evidence``: it is adopted
    LOCALIZED            OFF_MAP              the vehicle leaves the mapped roads, on roads of the network
    OFF_MAP              LOCALIZED            it comes back to a mapped road
    LOCALIZED, OFF_MAP   DOUBTED              views vouch for another place, or are not like the believed one; or no road is there
    DOUBTED              LOCALIZED, OFF_MAP   the doubt ends (below)
    all but UNKNOWN      LOST                 too much was driven since a view agreed
    LOST                 any of the others    a view agrees with the incumbent, or a challenger is adopted

What ends a doubt: of another place, that a view agrees with the incumbent or that the challenger's evidence fades; of an unlike
place, that views are like it again; of dead reckoning, that a view agrees with the incumbent. The adoption of the challenger ends
all three. It takes evidence of ``fix_evidence`` on top of the incumbent's.

A belief that weighs all hypotheses itself has no challenger. Its margins are summed, and once they reach ``fix_evidence`` there
is a fix for good.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.types import FloatArray, LocalizationStatus

LATERAL_SHARE = 0.1  # weight of a new view in the running mean of lateral disagreement: a memory of some 30 m


class Relation(Enum):
    """What a measured pose agrees with."""

    ALL_HYPOTHESES = 0  # the belief weighs all hypotheses itself
    INCUMBENT = 1
    CHALLENGER = 2
    NEITHER = 3


NO_COVARIANCE: FloatArray = np.zeros((3, 3))
NO_COVARIANCE.setflags(write=False)  # one array for every new fix


class Fix(NamedTuple):
    """What is known about the believed place. Evidence is a sum of margins.

    A named tuple, since three new ones are made for every query frame, and those are made faster than dataclasses.
    """

    adopted: bool = False  # whether a pose was adopted: from then on there is an incumbent
    total: float = 0.0  # evidence of all views so far; only for beliefs without a challenger
    support: float = 0.0  # evidence of the incumbent, as far as remembered
    challenge: float = 0.0  # evidence of the challenger, as far as remembered
    map_covariance: FloatArray = NO_COVARIANCE  # (3, 3) of the map where a view was recognised last
    sq_lateral_m2: float = 0.0  # squared disagreement of views with the belief across the road, a running mean
    place_z: float | None = None  # z-score of the believed place in the frames, a running mean; None: not seen since adopted
    on_map: bool = True  # whether cells of the map lie around the believed place
    off_roads: bool = False  # dead reckoning has left all roads: it began at the wrong place, or went wrong


@dataclass(frozen=True, slots=True, eq=False)
class RecognisedView:
    """A view that stood out from the others, and what the pose that it measures agrees with."""

    relation: Relation
    margin: float
    weight: float  # 0 to 1: less than 1 for a frame close to the one before, as the two show nearly the same
    map_covariance: FloatArray  # (3, 3) error of the map there
    sq_lateral_m2: float  # squared distance of the measured pose from the believed line of travel

    @property
    def evidence(self) -> float:
        """The margin, discounted by how little new the frame shows."""
        return self.weight * self.margin


@dataclass(frozen=True, slots=True)
class PlaceCheck:
    """What the map and a query frame say about the believed place."""

    on_map: bool  # whether cells of the map lie around the believed pose
    may_be_on_road: bool  # whether a road of the network may lie there
    z_score: float | None  # z-score of the most similar of those cells in this frame; None: none was scored


def faded(fix: Fix, config: LocalizerConfig) -> Fix:
    """Discount the evidence for incumbent and challenger, once for each query frame."""
    return fix._replace(support=config.evidence_memory * fix.support, challenge=config.evidence_memory * fix.challenge)


def recognised(fix: Fix, view: RecognisedView, config: LocalizerConfig) -> Fix:
    """The fix after a recognised view: its evidence counts for the hypothesis that it agrees with.

    A view that agrees with no hypothesis begins a new challenge.
    """
    if view.relation is Relation.ALL_HYPOTHESES:
        total = fix.total + view.margin
        return fix._replace(adopted=total >= config.fix_evidence, total=total, map_covariance=view.map_covariance)
    if view.relation is Relation.INCUMBENT:
        return _supported(fix, view, config)
    if challenger_wins(fix, view, config):
        return _adopted(fix, view, config)
    if view.relation is Relation.CHALLENGER:
        return fix._replace(challenge=fix.challenge + view.evidence)
    return fix._replace(challenge=view.evidence)


def challenger_wins(fix: Fix, view: RecognisedView, config: LocalizerConfig) -> bool:
    """Whether a view gives the challenger enough evidence to be adopted."""
    return view.relation is Relation.CHALLENGER and fix.challenge + view.evidence >= config.fix_evidence + fix.support


def _supported(fix: Fix, view: RecognisedView, config: LocalizerConfig) -> Fix:
    """The fix after a view that agrees with the incumbent: the incumbent gains evidence, and any challenge is over.

    The incumbent's evidence is bounded by ``fix_evidence``, as otherwise no challenger could ever gather more. The squared
    lateral disagreement of the view goes into a running mean, which later becomes part of the reported covariance.
    """
    return fix._replace(
        support=min(fix.support + view.evidence, config.fix_evidence),
        challenge=0.0,
        map_covariance=view.map_covariance,
        sq_lateral_m2=fix.sq_lateral_m2 + LATERAL_SHARE * (view.sq_lateral_m2 - fix.sq_lateral_m2),
        off_roads=False,
    )


def _adopted(fix: Fix, view: RecognisedView, config: LocalizerConfig) -> Fix:
    """The fix after the challenger was adopted: it becomes the incumbent and keeps the evidence that it has gathered.

    The z-score of the believed place is forgotten, as no frame has been compared with the new place yet.
    """
    return fix._replace(
        adopted=True,
        support=min(fix.challenge + view.evidence, config.fix_evidence),
        challenge=0.0,
        map_covariance=view.map_covariance,
        place_z=None,
        off_roads=False,
    )


def checked(fix: Fix, check: PlaceCheck, config: LocalizerConfig) -> Fix:
    """Enter the check of the believed place into the fix: is it on the map, can it be on a road, does the frame look like it?

    A place that was just adopted counts as on the map, since one of the map's view cells has measured it. Having left all roads
    is remembered until a view agrees again. The z-score is averaged over frames, as a single frame may be hidden by a lorry.
    """
    on_map = check.on_map or fix.place_z is None
    return fix._replace(
        on_map=on_map,
        off_roads=fix.off_roads or (not on_map and not check.may_be_on_road),
        place_z=_running_mean(fix.place_z, check.z_score, config.seen_memory),
    )


def _running_mean(mean: float | None, new: float | None, memory: float) -> float | None:
    """The mean after a new value, if there is one; the first value is taken as it is."""
    if mean is None or new is None:
        return mean if new is None else new
    return memory * mean + (1.0 - memory) * new


def status(fix: Fix, sigma_m: float, config: LocalizerConfig) -> LocalizationStatus:
    """The status of a fix whose position has this standard deviation; see the table above. Mode "paper" checks no places."""
    if not fix.adopted:
        return LocalizationStatus.UNKNOWN
    if sigma_m >= config.lost_sigma_m:
        return LocalizationStatus.LOST
    unlike = fix.place_z is not None and fix.place_z < config.seen_z and config.mode != "paper"
    if fix.off_roads or unlike or fix.challenge >= max(config.doubt_evidence, fix.support):
        return LocalizationStatus.DOUBTED
    return LocalizationStatus.LOCALIZED if fix.on_map else LocalizationStatus.OFF_MAP
