"""How the ego drives, in numbers, and how fast it dares to go. Its bicycle is in ``sim/ego.py``.

They are apart because highway-env takes more than two seconds to load: whoever reads a scenario or a recording has no need of it.
"""

from __future__ import annotations

from typing import Final

from pydantic import Field

from hippodrome.sim.spec import Spec

WHEELBASE_M: Final = 2.7  # a compact car
LENGTH_M: Final = 4.5
REAR_AXLE_TO_FRONT_M: Final = 3.6  # rear axle to front bumper, which is what SUMO calls a vehicle's position
MAX_YAW_RATE_RADPS: Final = 0.75  # what turns are driven at; leaves room below 0.9 for steering back to the path
MIN_CREEP_MPS: Final = 1.0  # in the tightest turns


class EgoSpec(Spec):
    """How the ego drives."""

    lateral_accel_mps2: float = Field(2.5, gt=0.2, le=3.0)
    accel_mps2: float = Field(1.8, gt=0.2, le=4.0)
    decel_mps2: float = Field(2.0, gt=0.2, le=4.0)
    lateral_wander_m: float = Field(0.0, ge=0.0, le=1.0)  # standard deviation of the drift about the lane's centre
