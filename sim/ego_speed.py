"""How fast the ego dares to go along its path."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.ego_spec import MAX_YAW_RATE_RADPS, MIN_CREEP_MPS, EgoSpec
from hippodrome.sim.path import STEP_M, Path


def comfortable_speed_mps(path: Path, limit_mps: FloatArray, spec: EgoSpec) -> FloatArray:
    """Highest du/dt (n,) along a path: the limit, v^2 kappa <= a_lat, v kappa <= yaw limit, braking in time for the rest."""
    curvature = np.maximum(np.abs(path.curvature_1pm), 1e-6)
    bends = np.minimum(np.sqrt(spec.lateral_accel_mps2 / curvature), MAX_YAW_RATE_RADPS / curvature)
    allowed = np.minimum(limit_mps, np.maximum(bends, MIN_CREEP_MPS) / path.stretch)
    braking = 2.0 * spec.decel_mps2 * STEP_M * np.arange(len(allowed))
    # v(i)^2 <= v(j)^2 + 2 b (u_j - u_i) for all j >= i
    latest = np.minimum.accumulate((allowed**2 + braking)[::-1])[::-1]
    speed: FloatArray = np.sqrt(latest - braking)
    return speed
