"""Missions as a scenario names them: how many, who drives, and within which limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hippodrome.sim.spec import Spec
from hippodrome.sim.value_words import METHOD_NAME, SOURCE

RowKey = Literal["ours", "truth", "dead-reckoning", "no-reading", "on-sight", "paper", "kalman"]
PolicyName = Annotated[str, Field(pattern=METHOD_NAME)]
Source = Annotated[str, Field(pattern=SOURCE)]
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
MOST_MISSIONS = 1000  # a night of driving; more is a slip of the keyboard


class MissionSpec(Spec):
    """Missions that belong to a scenario: where there are some, ``hippodrome gate`` and ``sweep`` drive instead of evaluating."""

    count: Annotated[int, Field(ge=1, le=MOST_MISSIONS)] | None = None  # how many, the first the same for every count; null: none
    rows: tuple[RowKey, ...] = ("ours", "truth")  # who drives
    policies: dict[PolicyName, Source] = Field(default_factory=dict)  # of others that drive, too: module:Object or stream:COMMAND
    answer_limit_s: Annotated[float, Field(gt=0, le=3600)] = 30.0  # for each step of such a policy

    @model_validator(mode="after")
    def _somebody_drives(self) -> MissionSpec:
        if not self.rows and not self.policies:
            raise ValueError("nobody drives: name rows or policies")
        return self


class MissionLimits(Spec):
    """Limits of a row of missions; one left out is not checked."""

    row: str = "ours"  # the row that the limits speak of: a key of missions.rows, or the name of a policy
    success_rate: Share | None = None  # at least: missions that reached their goal
    spl: Share | None = None  # at least: success weighted by path length
    driving_score: Annotated[float, Field(ge=0, le=100)] | None = None  # at least: as CARLA's leaderboard counts it
    collisions_at_fault: Count | None = None  # at most, as in all that follow: in all missions together
    wrong_way: Count | None = None  # times against the traffic
    false_arrivals: Count | None = None  # arrivals that were said elsewhere than at the goal
    red_lights: Count | None = None  # red lights run
    rights_of_way: Count | None = None  # rights of way taken
    outside_lane_share: Share | None = None  # share of the time with a wheel outside of the lane
    time_ratio: Annotated[float, Field(gt=0)] | None = None  # time over that of SUMO's own driver
