"""A mapper in fifteen lines: the self-motion integrated, one pose for each observation.

hippodrome eval scenarios/towns/grid.yaml --method examples.methods.integrate:Integrator
"""

import math


class Integrator:
    """Dead reckoning. It needs no frame, and answers in a frame and a scale of its own."""

    frame = "own"

    def map(self, observations, given):
        """Yield ``(t_s, x, y, heading_rad)`` for each observation."""
        x = y = heading = 0.0
        for one in observations:
            heading += one.yaw_rate_radps * one.dt_s
            x += one.speed * one.dt_s * math.cos(heading)
            y += one.speed * one.dt_s * math.sin(heading)
            yield one.t_s, x, y, heading
