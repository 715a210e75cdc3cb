"""Parameters of the route search."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class SearchCosts:
    """Costs of one step on the network, negative log likelihoods. The defaults belong to bins of 1 m and steps of 5 m."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    heading_sigma_rad: float = 0.12  # sigma of the odometry's heading against the lane's polyline, corners included
    heading_limit_nats: float = 6.0  # most that one heading error costs, so that a lane change or a kinked lane kills no route
    offset_gain: float = 0.1  # share of each heading error that the heading offset takes over: follows a poor gyro's drift
    length_sigma_m: float = 0.4  # sigma of a step's length beyond half a bin: corners are cut or swung out
    scale_step_nats: float = 3.0  # cost of a change of scale by one scale bin: it happens in about 1 of 20 steps
    scale_jump_nats: float = 10.0  # cost of a jump in scale, as when a visual odometry starts afresh: once in 100 km for each bin
    lane_change_nats: float = 5.0  # cost of a lane change: about 1 in 150 steps, once in 750 m


@dataclass(frozen=True, slots=True)
class OffNetworkCosts:
    """Costs of driving by dead reckoning where the network has no road, negative log likelihoods."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    leave_nats: float = 8.0  # cost of leaving the network: it happens once in 15 km
    step_nats: float = 1.5  # cost of a step off it; one of a right route costs 0.1-0.4, in bends up to 1.3, of a wrong one over 2
    return_nats: float = 4.0  # cost of taking up a lane again
    drift: float = 0.05  # growth of the place's sigma for each metre off the network, by drift of scale and heading
    turn_limit_rad: float = 0.5  # a lane whose direction differs by more than this is not taken up again
    spread_nats: float = 8.0  # only hypotheses at most this far behind the best one may leave the network


@dataclass(frozen=True, slots=True)
class RouteSearchConfig:
    """States, bounds and costs of the route search."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    metres_per_unit: float | None = None  # length of a map unit where the odometry is metric; None: unknown, it is searched for
    bin_m: float = 1.0  # length of the bins that lanes are cut into
    step_m: float = 5.0  # length of a step of the drive, if its brisk speed is the network's usual speed limit
    scale_bin: float = 0.04  # width of a scale bin, in ln(metres per map unit)
    beam_nats: float = 20.0  # beam width; a right route falls at most 10 behind the best on the way, the rest is for close rivals
    most_survivors: int = 20_000  # hypotheses kept at each step: bounds time and memory in towns too self-similar for the beam
    costs: SearchCosts = field(default_factory=SearchCosts)
    off_network: OffNetworkCosts = field(default_factory=OffNetworkCosts)
    coarse: int = 4  # size of the bins and scale bins of the coarse search for an unknown start, in fine ones
    coarse_beam_nats: float = 12.0  # beam width of the coarse search
    coarse_enough: int = 1_000  # the coarse search stops once no more hypotheses than these are left
    seed_margin_nats: float = 10.0  # starts at most this far behind the best one are searched finely; a right one is up to 7
    good_start_nats: float = 0.6  # most mean cost of a step after the anchor for a start to be followed; a right one has 0.1-0.4
    anchors: int = 4  # most samples of the drive at which an unknown start is sought, while parts of the drive stay unexplained
    margin_nats: float = 15.0  # alternatives at most this far behind the best route are looked for
