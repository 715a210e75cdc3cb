"""Wrappers of the environment: commands in SI units, and a policy that must not see the truth."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from hippodrome.core.navigation.spaces import Action, Observed
from hippodrome.core.types import HippodromeError
from hippodrome.sim.ego import MAX_ACCEL_MPS2, MAX_BRAKE_MPS2, MAX_STEERING_RAD
from hippodrome.sim.loop.env import TownEnv


class SiUnits(gymnasium.ActionWrapper[Observed, Action, Action]):
    """Actions as acceleration [m/s^2] and steering [rad, left positive], within the car's own limits."""

    def __init__(self, env: gymnasium.Env[Observed, Action]) -> None:
        super().__init__(env)
        if not isinstance(env.unwrapped, TownEnv):
            raise HippodromeError(f"SiUnits: {type(env.unwrapped).__name__} is not hippodrome/Town-v0, the only one it wraps")
        self._options = env.unwrapped.options
        low, high = [-MAX_BRAKE_MPS2, -MAX_STEERING_RAD], [MAX_ACCEL_MPS2, MAX_STEERING_RAD]
        ranges = self._options.acceleration_range_mps2, self._options.steering_range_rad
        low = [max(a, b[0]) for a, b in zip(low, ranges, strict=True)]
        high = [min(a, b[1]) for a, b in zip(high, ranges, strict=True)]
        more = [1.0] * (env.action_space.shape[0] - 2) if env.action_space.shape else []
        self.action_space = spaces.Box(
            np.array([*low, *(-one for one in more)], dtype=np.float32), np.array([*high, *more], dtype=np.float32)
        )

    def action(self, action: Action) -> Action:
        """The same in [-1, 1]."""
        numbers = np.asarray(action, dtype=np.float64)
        ranges = self._options.acceleration_range_mps2, self._options.steering_range_rad
        mapped = [2.0 * (n - low) / (high - low) - 1.0 for n, (low, high) in zip(numbers[:2], ranges, strict=True)]
        return np.array([*mapped, *numbers[2:]])


class WithoutTruth(gymnasium.Wrapper[Observed, Action, Observed, Action]):
    """Nothing in ``info``: what a policy under test may see."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observed, dict[str, Any]]:
        """The environment's reset, without its info."""
        return self.env.reset(seed=seed, options=options)[0], {}

    def step(self, action: Action) -> tuple[Observed, Any, bool, bool, dict[str, Any]]:
        """The environment's step, without its info."""
        observed, reward, terminated, truncated, _ = self.env.step(action)
        return observed, reward, terminated, truncated, {}


without_truth = WithoutTruth
