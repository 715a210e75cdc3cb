"""Whether the vehicle is at the goal; and where it cannot vouch for that, a look at the end of the street.

On a street without views the place along the way is known by dead reckoning alone, to two metres after a hundred. The end of
the lane tells it to half a metre, and is often near: then the vehicle drives on until it sees that, and backs to the goal, which
takes half a minute. Where that end is too far, or somebody stands behind, it drives round and comes back to the goal.
"""

from __future__ import annotations

import math
from typing import Final

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import Course
from hippodrome.core.navigation.escape import Escape
from hippodrome.core.navigation.guidance import Guide
from hippodrome.core.navigation.pilot import Plan, RoutePlanner
from hippodrome.core.navigation.speed import stopping_mps
from hippodrome.core.navigation.types import DrivingState, Radar

ROUND_AGAIN_S: Final = 1.0  # stood at a goal that cannot be vouched for, before going on
LOOK_MPS, LOOK_BRAKING_MPS2 = 3.0, 1.5  # driven to where the end of the lane is seen
SEES_END_M: Final = (12.0, 8.5)  # the end is read from so far before it on, and well known where the rear axle is so near
LOOK_M: Final = (2.0, 16.0)  # driven for a look: with less the end was seen before; who backs 20 m drives against the traffic
BEYOND_M: Final = 2.5  # backed beyond the goal, which is then driven to forwards
SURE: Final = 0.8  # of the deviation with which an arrival is said: the way back adds to it
THERE_M: Final = 0.4
STANDING_MPS: Final = 0.1
AGAIN_M: Final = 60.0  # driven before the same street's end is looked at again
VOUCHES_NOT, LOOKS = "cannot vouch for the goal's place", "looks where the goal's street ends"


class Arrival:
    """Says when the vehicle has arrived, and what to do at a goal that it cannot vouch for.

    Args:
        config: all parameters.
        belief: where the vehicle takes itself to be.
        planner: knows the roads, and makes plans.
        escape: backs.
        guide: the likeliest place by the hypotheses; None: there are none.
    """

    def __init__(
        self, config: NavigatorConfig, belief: Belief, planner: RoutePlanner, escape: Escape, guide: Guide | None
    ) -> None:
        self._config, self._belief, self._planner = config, belief, planner
        self._escape, self._guide = escape, guide
        self.arrived = False
        self._at_goal_s, self._looked_m = 0.0, math.inf
        self._course: Course | None = None  # on which a look is taken, with the places along it ..
        self._goal_u_m = self._until_u_m = 0.0  # .. of the goal, and of where to stop for that
        self._seen = False

    def at_goal(self, dt_s: float) -> tuple[DrivingState, str]:
        """What to say, standing at the goal: that this is it if the place is known well; else the vehicle goes on."""
        self._at_goal_s += dt_s
        if self._is_known(1.0):
            self.arrived = True
            return DrivingState.ARRIVED, "has arrived"
        if self._at_goal_s > ROUND_AGAIN_S:
            self._at_goal_s = 0.0
            self._go_on()
        return DrivingState.DOUBTING, VOUCHES_NOT

    def looks(self, plan: Plan) -> bool:
        """Whether the vehicle is on its way to look at the end of the street."""
        if self._course is not None and plan.course is not self._course:
            self._course = None  # another place, or another way: nothing to back to
        return self._course is not None

    def look_mps(self, plan: Plan, speed_mps: float, radar: Radar) -> float | None:
        """The highest speed on the way to look; None where it begins to back, as it has seen enough or is there."""
        left_m = self._until_u_m - plan.u_m
        self._seen = self._seen or left_m < THERE_M or self._is_known(SURE)
        if not self._seen:
            return min(LOOK_MPS, stopping_mps(left_m, LOOK_BRAKING_MPS2))
        if speed_mps > STANDING_MPS:
            return 0.0
        self._course = None
        if not self._is_known(1.0):
            return LOOK_MPS  # the end told nothing, and who backs sees nothing new: the way round
        if not self._escape.to_road(plan.u_m - self._goal_u_m + BEYOND_M, radar):
            return LOOK_MPS  # somebody is behind: the way round
        self._belief.plan = None
        return None

    def _is_known(self, share: float) -> bool:
        """Whether the place is known so well, and vouched for, that an arrival may be said; to a share of the deviation."""
        drive, belief = self._config.drive, self._belief
        track, sigma_m = belief.track, share * drive.goal_sigma_m
        if track is None or track.along_sigma_m >= sigma_m or belief.since_fix_m <= drive.settled_m:
            return False
        return self._guide is None or self._guide.vouches(track, belief.witnesses, sigma_m)

    def _go_on(self) -> None:
        """Take the way round, and on it a look at the end of the street if that is near."""
        belief, before = self._belief, self._belief.plan
        assert belief.track is not None and before is not None
        plan = belief.plan = self._planner.plan(belief.track.pose, 0.0, beyond_goal=True)
        gate = None if plan is None else plan.gate()
        has_looked = 0.0 <= belief.since_fix_m - self._looked_m < AGAIN_M
        if plan is None or gate is None or has_looked or belief.since_fix_m <= self._config.drive.settled_m:
            return
        least_m, wanted_m = (gate.entry_u_m - plan.u_m - sees_m for sees_m in SEES_END_M)
        if least_m < LOOK_M[1] and wanted_m > LOOK_M[0]:
            self._course, self._seen, self._looked_m = plan.course, False, belief.since_fix_m
            self._goal_u_m, self._until_u_m = plan.u_m + before.to_goal_m, plan.u_m + min(wanted_m, LOOK_M[1])
