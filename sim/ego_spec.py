"""What a scenario says about the ego. It stands alone: who only reads a scenario need not wait for highway-env."""

from __future__ import annotations

from pydantic import Field

from hippodrome.sim.spec import Spec


class EgoSpec(Spec):
    """How the ego drives."""

    lateral_accel_mps2: float = Field(2.5, gt=0.2, le=3.0)
    accel_mps2: float = Field(1.8, gt=0.2, le=4.0)
    decel_mps2: float = Field(2.0, gt=0.2, le=4.0)
    lateral_wander_m: float = Field(0.0, ge=0.0, le=1.0)  # standard deviation of the drift about the lane's centre
