"""Self-motion that cannot be one: refused before a map is made of it."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import Motion
from hippodrome.sim.recording_checks import LEAST_SPEED

HIGHEST_SPEED: Final = 1e6  # units of length a second; wheel ticks stay far below it
HIGHEST_YAW_RATE_RADPS: Final = 35.0  # 2,000 degrees a second, the range of a phone's gyroscope
USUAL_YAW_RATE_RADPS: Final = 3.0  # nine tenths of all rows turn slower than this, or their unit is not radians
LONGEST_HOLE_S: Final = 5.0  # at a speed, a longer step would be a straight or an arc that nobody measured
LONGEST_EVER_S: Final = 60.0  # however sparse the rows are: in a minute a vehicle turns at several junctions
SHORTEST_INTERVAL_S: Final = 1e-5  # the fastest inertial sensors measure some ten thousand times a second
HOLE_INTERVALS: Final = 20.0  # a hole is also longer than so many median intervals


def require_plausible(motion: Motion, name: str) -> None:
    """Raise ExchangeError, naming the row at fault and the cure, if no vehicle moves so; ``name`` names the file."""
    for values, limit, what in (
        (motion.speed, HIGHEST_SPEED, "speed"),
        (motion.yaw_rate_radps, HIGHEST_YAW_RATE_RADPS, "yaw rate"),
    ):
        wrong = ~(np.abs(values) <= limit)
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise ExchangeError(
                f"{name}: row {row + 1}, {motion.t_s[row]:.3f} s: {what} {values[row]:g}, at most {limit:g} is plausible; "
                "check the column and its unit, or remove the row"
            )
    if 0.0 < (fastest := float(np.max(np.abs(motion.speed)))) < LEAST_SPEED:
        raise ExchangeError(f"{name}: its speed is {fastest:g} at most, which no sensor tells from zero; check the column")
    usual = float(np.quantile(np.abs(motion.yaw_rate_radps), 0.9))
    if usual > USUAL_YAW_RATE_RADPS:
        raise ExchangeError(
            f"{name}: a tenth of the rows turn faster than {usual:.1f} rad/s, which no car does; "
            "if the yaw rate is in degrees a second, name its column yaw_rate_deg_s"
        )
    dt_s = np.diff(motion.t_s)
    if (usual_s := float(np.median(dt_s))) < SHORTEST_INTERVAL_S:
        raise ExchangeError(
            f"{name}: its rows lie {usual_s:.1g} s apart, closer than any sensor measures; say the unit of time with --time-unit"
        )
    longest_s = min(max(LONGEST_HOLE_S, HOLE_INTERVALS * usual_s), LONGEST_EVER_S)
    holes = np.flatnonzero((dt_s > longest_s) & (motion.speed[1:] != 0.0))
    if len(holes):
        row = int(holes[0]) + 1
        raise ExchangeError(
            f"{name}: row {row + 1}, {motion.t_s[row]:.3f} s, comes {dt_s[row - 1]:.1f} s after the row before it, and the "
            "vehicle moved: nobody measured how; cut the drive there, fill the hole, or check the unit of time (--time-unit)"
        )
