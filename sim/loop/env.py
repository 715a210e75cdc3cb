"""The world as an environment of Gymnasium."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np
from gymnasium import spaces

from hippodrome._folders import folder_of_this_process
from hippodrome.core.navigation.spaces import (
    ACCELERATION_RANGE_MPS2,
    FASTEST_TURN_RADPS,
    FASTEST_UNITS,
    RADAR_REACH_M,
    STEERING_RANGE_RAD,
    Action,
    Observed,
    indicator_of,
    mapped,
    observed,
)
from hippodrome.core.navigation.types import Goal, Indicator, Lamp
from hippodrome.core.types import Frame, HippodromeError
from hippodrome.sim.loop.reward import Reward
from hippodrome.sim.loop.top_view import TopView, beside
from hippodrome.sim.loop.types import EventKind, LanePlace, Sensed
from hippodrome.sim.loop.world import STEP_S, World
from hippodrome.sim.scenario import Scenario

ARRIVED_M, ARRIVED_RAD, ARRIVED_MPS = 3.0, 0.25 * math.pi, 0.1
View: TypeAlias = Literal["camera", "top", "both"]
Place: TypeAlias = LanePlace | tuple[str, float]


@dataclass(frozen=True, slots=True)
class EnvOptions:
    """What can be chosen of the environment.

    Args:
        view: what ``render`` shows.
        duration_s: after which a drive is truncated.
        radar: whether the radar is observed too.
        indicators: whether the action has a third number: below -1/3 the right indicator, above 1/3 the left one.
        reverse: whether the action has one number more, its last: below 0 the reverse gear; with ``radar`` also ``gap_behind_m``
            and ``moving_m`` are observed.
        acceleration_range_mps2, steering_range_rad: what the actions -1 and 1 mean.
    """

    view: View = "both"
    duration_s: float = 300.0
    radar: bool = False
    indicators: bool = False
    reverse: bool = False
    acceleration_range_mps2: tuple[float, float] = ACCELERATION_RANGE_MPS2
    steering_range_rad: tuple[float, float] = STEERING_RANGE_RAD


class TownEnv(gymnasium.Env[Observed, Action]):
    """A drive through a scenario's town, 10 steps per second.

    *Observation*, a dictionary: ``frame`` (H, W, 3) of the camera, the last one where it is slower than the steps; ``speed`` (1,)
    in map units per second, whose length in metres is unknown, and ``yaw_rate`` (1,) in rad/s, both as noisy as the scenario
    says; with ``radar`` also ``gap_m`` (1,), ``closing_mps`` (1,), ``way_is_free`` and ``lamp``.

    *Action*: acceleration and steering in [-1, 1], mapped to ``acceleration_range_mps2`` and ``steering_range_rad``, as
    highway-env's ``ContinuousAction`` does.

    *Reward*: metres of progress less fines, as ``Reward`` says. *Terminated*: at a collision, and where the ego stands at the
    goal; *truncated*: after ``duration_s``. *Info* holds the truth, the events of the step and the fines; ``without_truth``
    empties it.

    ``reset`` takes ``options={"start": (lane_id, position_m), "goal": (x_m, y_m, heading_rad)}``, each of which may be left out.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1.0 / STEP_S)}  # noqa: RUF012  # Gymnasium's

    def __init__(
        self, scenario: Scenario, root: Path | None = None, render_mode: str | None = None, options: EnvOptions | None = None
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise HippodromeError(f"render_mode: {render_mode!r} is not known; there are 'rgb_array' and None")
        self.render_mode = render_mode
        self.options = EnvOptions() if options is None else options
        if self.options.view not in ("camera", "top", "both"):
            raise HippodromeError(f"view: {self.options.view!r} is not known; there are 'camera', 'top' and 'both'")
        self.world = World(scenario, folder_of_this_process() if root is None else root)
        self._top: TopView | None = None
        self._goal: Goal | None = None
        self._sensed: Sensed | None = None
        camera = scenario.camera
        self._frame: Frame = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
        self.action_space = spaces.Box(-1.0, 1.0, (2 + self.options.indicators + self.options.reverse,), np.float32)
        radar = {
            "gap_m": spaces.Box(0.0, RADAR_REACH_M, (1,), np.float32),
            "closing_mps": spaces.Box(-FASTEST_UNITS, FASTEST_UNITS, (1,), np.float32),
            "way_is_free": spaces.Discrete(2),
            "lamp": spaces.Discrete(len(Lamp)),
        }
        if self.options.reverse:
            radar |= {name: spaces.Box(0.0, RADAR_REACH_M, (1,), np.float32) for name in ("gap_behind_m", "moving_m")}
        self.observation_space = spaces.Dict(
            {
                "frame": spaces.Box(0, 255, self._frame.shape, np.uint8),
                "speed": spaces.Box(-FASTEST_UNITS, FASTEST_UNITS, (1,), np.float32),
                "yaw_rate": spaces.Box(-FASTEST_TURN_RADPS, FASTEST_TURN_RADPS, (1,), np.float32),
                **(radar if self.options.radar else {}),
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observed, dict[str, Any]]:
        """Begins a drive; without a seed the next one of the environment's own random numbers is driven."""
        super().reset(seed=seed)
        options = options or {}
        if unknown := sorted(set(options) - {"start", "goal"}):
            raise HippodromeError(f"reset: options has {unknown[0]!r}; there are 'start' and 'goal'")
        start: Place | None = options.get("start")
        goal: Goal | tuple[float, float, float] | None = options.get("goal")
        self._goal = goal if goal is None or isinstance(goal, Goal) else Goal(*goal)
        place = start if start is None or isinstance(start, LanePlace) else LanePlace(*start)
        self._sensed = self.world.reset(int(self.np_random.integers(2**31)), place)
        self._reward = Reward()
        return self._observed(self._sensed), self._info(self._sensed, {})

    def step(self, action: Action) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Drives on for a tenth of a second."""
        numbers = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        accel = mapped(float(numbers[0]), self.options.acceleration_range_mps2)
        steering = mapped(float(numbers[1]), self.options.steering_range_rad)
        indicator = indicator_of(float(numbers[2])) if self.options.indicators else Indicator.STRAIGHT
        return self.drive(accel, steering, indicator, self.options.reverse and float(numbers[-1]) < 0.0)

    def drive(
        self, acceleration_mps2: float, steering_rad: float, indicator: Indicator, reverse: bool = False
    ) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """``step`` in SI units."""
        sensed = self.world.step(acceleration_mps2, steering_rad, indicator, reverse)
        self._sensed = sensed
        gain, fines = self._reward.of(sensed)
        crashed = any(event.kind in (EventKind.COLLISION, EventKind.BUILDING) for event in sensed.events)
        late = sensed.truth.t_s >= self.options.duration_s - 0.5 * STEP_S
        return self._observed(sensed), gain, crashed or self._is_there(sensed), late, self._info(sensed, fines)

    def render(self) -> Frame | None:
        """The picture of ``view``; None without a render mode."""
        if self.render_mode is None or self._sensed is None:
            return None
        if self.options.view == "camera":
            return self._frame.copy()
        self._top = self._top or TopView(self.world.town)
        top = self.world.picture(self._top)
        return top if self.options.view == "top" else beside(self._frame, top)

    def close(self) -> None:
        """Ends SUMO and frees the renderer."""
        self.world.close()

    def _observed(self, sensed: Sensed) -> Observed:
        observation = sensed.observation
        if observation.frame is not None:
            self._frame = observation.frame
        frame = self._frame if observation.frame is not None else self._frame.copy()
        return observed(observation, sensed.radar if self.options.radar else None, frame, self.options.reverse)

    def _info(self, sensed: Sensed, fines: dict[str, float]) -> dict[str, Any]:
        return {"truth": asdict(sensed.truth), "events": [asdict(event) for event in sensed.events], "fines": fines}

    def _is_there(self, sensed: Sensed) -> bool:
        if self._goal is None:
            return False
        truth, goal = sensed.truth, self._goal
        near = math.hypot(truth.x_m - goal.x_m, truth.y_m - goal.y_m) <= ARRIVED_M
        turn = abs((truth.heading_rad - goal.heading_rad + math.pi) % (2.0 * math.pi) - math.pi)
        return near and turn <= ARRIVED_RAD and abs(truth.speed_mps) <= ARRIVED_MPS
