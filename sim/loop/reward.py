"""What a policy in the loop is rewarded for, in metres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from hippodrome.sim.loop.types import EventKind, Sensed
from hippodrome.sim.loop.world import STEP_S

FINES_M: Final[Mapping[EventKind, float]] = {  # for events that are the ego's fault: metres of good driving they cost
    EventKind.COLLISION: 200.0,
    EventKind.BUILDING: 200.0,
    EventKind.RED_LIGHT: 100.0,
    EventKind.RIGHT_OF_WAY: 50.0,
    EventKind.WRONG_WAY: 50.0,
    EventKind.LEFT_ROAD: 50.0,
    EventKind.KERB: 20.0,
    EventKind.LEFT_LANE: 10.0,
}


class Reward:
    """Metres driven along the own lane, less the fines.

    A step's progress is the way driven times the cosine of the angle to the lane; it counts only with all wheels on the paving,
    and against the traffic it counts negative. Each event that is the ego's fault costs its ``FINES_M``.
    """

    def of(self, sensed: Sensed) -> tuple[float, dict[str, float]]:
        """The reward of a step, and the fines in it by kind."""
        truth = sensed.truth
        along = math.cos(truth.lane_heading_error_rad) if truth.lane >= 0 and truth.on_paving else 0.0
        fines: dict[str, float] = {}
        for event in sensed.events:
            if event.at_fault and event.kind in FINES_M:
                fines[event.kind] = fines.get(event.kind, 0.0) + FINES_M[event.kind]
        return truth.speed_mps * along * STEP_S - sum(fines.values()), fines
