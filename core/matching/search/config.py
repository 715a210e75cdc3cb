"""Parameters of the route search."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class SearchCosts:
    """Log likelihoods of one step. Defaults: 1 m bins and 5 m steps."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    heading_sigma_rad: float = 0.12  # odometry against a lane's polyline, corners included
    heading_limit_nats: float = 6.0  # truncation: a few steps astray (lane change, kinked lanes) must not kill a route
    offset_gain: float = 0.1  # share of each heading error that the carried offset takes over: follows a poor gyro's drift
    length_sigma_m: float = 0.4  # of a step, beyond what the carried rest absorbs: corners cut or swung out
    scale_step_nats: float = 3.0  # one bin of scale change in a step: about 1 in 20
    scale_jump_nats: float = 10.0  # any number of bins at once, as when a visual odometry starts afresh: once in 100 km a bin
    lane_change_nats: float = 5.0  # about 1 in 150 steps, once in 750 m


@dataclass(frozen=True, slots=True)
class OffNetworkCosts:
    """Driving where the network has no road, by dead reckoning."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    leave_nats: float = 8.0  # rare: once in 15 km
    step_nats: float = 1.5  # a right route costs 0.1-0.4 a step, in bends of a poor gyro up to 1.3; a wrong one 2 and more
    return_nats: float = 4.0
    drift: float = 0.05  # growth of the place's sigma per metre off the network: scale and heading drift
    turn_limit_rad: float = 0.5  # largest difference of heading at which a lane is taken up again
    spread_nats: float = 8.0  # hypotheses this far behind the best may leave the network


@dataclass(frozen=True, slots=True)
class RouteSearchConfig:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    bin_m: float = 1.0
    step_m: float = 5.0  # if the drive's brisk speed is the network's usual limit
    scale_bin: float = 0.04  # of log scale
    beam_nats: float = 20.0  # right routes fall at most 10 behind the best on the way; the rest is for close rivals
    most_survivors: int = 30_000  # bounds time and memory where a town is too self-similar for the beam to prune
    costs: SearchCosts = field(default_factory=SearchCosts)
    off_network: OffNetworkCosts = field(default_factory=OffNetworkCosts)
    coarse: int = 4  # coarse bins, of length and of scale, are this many fine bins
    coarse_beam_nats: float = 25.0
    coarse_enough: int = 1_000  # survivors at which stage 1 may stop
    seed_margin_nats: float = 20.0  # starts that score less than this below the best coarse route are searched finely
    anchors: int = 4  # beginnings tried at most, while stretches of the drive stay unexplained
    margin_nats: float = 15.0  # alternatives up to this far behind the best route are looked for
