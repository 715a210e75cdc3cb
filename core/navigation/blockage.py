"""What bars the way: how long the vehicle has stood before it, and what follows from that.

A road counts as closed where the vehicle has stood long before something, though no lamp is red. That holds with a fix, and also
for the likeliest place whose way to the goal is driven without one: if that place turns out to be another one, all is open again.
"""

from __future__ import annotations

import math
from typing import Final

from hippodrome.core.navigation.belief import Belief
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.escape import Escape
from hippodrome.core.navigation.guidance import Guide
from hippodrome.core.navigation.pilot import Plan, RoutePlanner
from hippodrome.core.navigation.senses import Senses
from hippodrome.core.navigation.types import Lamp, Radar
from hippodrome.core.types import FloatArray

AGAIN_S: Final = 5.0  # later it is tried again to turn round where there was no room
STANDING_MPS: Final = 0.1
OBSTACLE_M: Final = 10.0  # who stands nearer than this before something waits for it
QUEUE_M, QUEUE_SHARE = 40.0, 0.5  # what stands farther before a junction is hardly the end of a queue, and not waited for so long


class Blockage:
    """Watches for something that bars the way, closes the road in the plans, and turns round where that is the way out.

    Args:
        config: all parameters.
        senses: the own motion.
        belief: where the vehicle takes itself to be.
        planner: knows the roads, and which are closed.
        escape: turns round.
        guide: the likeliest place where there is no fix; None: there is none.
    """

    def __init__(
        self, config: NavigatorConfig, senses: Senses, belief: Belief, planner: RoutePlanner, escape: Escape, guide: Guide | None
    ) -> None:
        self._config, self._senses, self._belief, self._planner = config, senses, belief, planner
        self._escape, self._guide = escape, guide
        self._guess = -1  # the place without a fix for which a road was closed
        self.standing_s = 0.0
        self._patience = 1.0  # share of the times that the vehicle waits

    @property
    def blocks(self) -> bool:
        """Whether the vehicle has stood before something for so long that it is taken to bar the way."""
        return self.standing_s >= self._patience * self._config.drive.blocked_s

    def step(self, radar: Radar, barred: bool, dt_s: float) -> None:
        """Take a step in. ``barred`` says that somebody stands beyond the junction."""
        self._open_what_was_guessed()
        waits = (barred or radar.gap_m < OBSTACLE_M) and radar.lamp not in (Lamp.RED, Lamp.YELLOW) and not radar.blind
        standing = self._senses.motion.speed_mps < STANDING_MPS
        self.standing_s = self.standing_s + dt_s if standing and waits else 0.0
        self._patience = self._patient(radar)
        if not self.blocks:
            return
        plan, pose = self._way()
        gate = None if plan is None else plan.gate()
        if plan is None or pose is None:
            self.standing_s = 0.0 if self._escape.barred(radar.gap_m) else self.standing_s - AGAIN_S
        elif gate is not None and gate.edge >= 0 and gate.entry_u_m - plan.u_m < OBSTACLE_M + self._config.vehicle.front_m:
            self.standing_s = 0.0
            self._planner.close(gate.edge)
            self._take_other_way(pose)
        elif self.standing_s >= self._patience * self._config.drive.turns_round_s and self._planner.close_own(pose):
            begins = self._escape.barred(radar.gap_m)
            self.standing_s = 0.0 if begins else self._patience * self._config.drive.blocked_s
            if begins:
                self._remember_guess()
            else:
                self._planner.open_all()

    def _patient(self, radar: Radar) -> float:
        """Less than 1 where the place is known, and what bars the way stands too far before the next junction to be a queue."""
        track, plan = self._belief.track, self._belief.plan
        gate = None if track is None or plan is None else plan.gate()
        if gate is None or plan is None or not math.isfinite(radar.gap_m):
            return 1.0
        beyond_m = gate.entry_u_m - plan.u_m - self._config.vehicle.front_m - radar.gap_m
        return QUEUE_SHARE if beyond_m > QUEUE_M else 1.0

    def _way(self) -> tuple[Plan | None, FloatArray | None]:
        """The way to the goal that is driven, and from where: with a fix, or from the likeliest place."""
        if self._belief.track is not None:
            return self._belief.plan, self._belief.track.pose
        return (None, None) if self._guide is None else self._guide.way_to_goal

    def _take_other_way(self, pose: FloatArray) -> None:
        """Plan anew, with the road closed; where nothing is left, all roads are open again."""
        plan = self._planner.plan(pose, 0.0)
        if plan is None:
            self._planner.open_all()
        else:
            self._remember_guess()
        if self._belief.track is not None:
            self._belief.plan = plan
        elif self._guide is not None:
            self._guide.plan_anew()

    def _remember_guess(self) -> None:
        if self._belief.track is None and self._guide is not None:
            self._guess = self._guide.places_given_up

    def _open_what_was_guessed(self) -> None:
        """Open the roads that were closed for a place which was given up since."""
        if self._guess >= 0 and self._guide is not None and self._guide.places_given_up != self._guess:
            self._guess = -1
            self._planner.open_all()
