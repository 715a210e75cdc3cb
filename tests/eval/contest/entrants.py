"""Methods as text, for the modules that the tests of the contest write."""

MAPPER = """\
import math

class Mapper:
    def map(self, observations, given):
        x = y = heading = 0.0
        for one in observations:
            heading += one.yaw_rate_radps * one.dt_s
            x += one.speed * one.dt_s * math.cos(heading)
            y += one.speed * one.dt_s * math.sin(heading)
            yield one.t_s, x, y, heading
"""
