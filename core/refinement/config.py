"""Constants of the refinement, in both modes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from hippodrome.core.matching.config import ConfidenceConfig
from hippodrome.core.matching.hmm.config import PaperMatchConfig
from hippodrome.core.matching.search.config import RouteSearchConfig


@dataclass(frozen=True, slots=True)
class SolverConfig:
    """Rounds of the refinement along a route."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    along_sigma_m: tuple[float, ...] = (3.0, 6.0, 12.0, *[np.inf] * 8)  # sigma along the lane, per round; .inf: not held along it
    inner_iterations: int = 2
    reprojection_m: float = 4.0  # arc length by which a keyframe's place on the route may move in one round
    unvouched_weight: float = 1e-6  # weight of the road where nothing vouches for it: it determines a pose without pulling it
    paint_round: int = 6  # round from which on paint is compared, as keyframes are near their places by then; -1: never
    survey_sigma_m: float | None = None  # sigma per axis of the error of the road network; None: what the network says of itself
    survey_freedom: float | None = 5.0  # errors that count as seen before the drive: how well sigma is known; None: exactly
    survey_length_m: float = 60.0  # correlation length of that error: neighbouring roads are drawn wrong alike
    reading_loose_m: tuple[float, ...] = (
        1.0,
        1.0,
        1.0,
        1.0,
        0.7,
        0.5,
        0.3,
        0.2,
        0.1,
        0.0,
        0.0,
    )  # added sigma, per round

    @property
    def survey_slope(self) -> float:
        """Standard deviation (rad) of the error of the drawn lanes' directions."""
        return (self.survey_sigma_m or 0.0) / self.survey_length_m

    def loose_m(self, number: int) -> float:
        """Sigma that is added to what was read in a round."""
        return self.reading_loose_m[number] if number < len(self.reading_loose_m) else 0.0


@dataclass(frozen=True, slots=True)
class AlignmentConfig:
    """How the similarity between map and network is searched for."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    min_scale_m: float = 0.2  # metres per map unit, lower end: monocular maps are off by a factor, not by orders of magnitude
    max_scale_m: float = 5.0
    scale_step: float = 0.04  # relative step between the scales tried: 2 % are 6 m at 300 m from the start, within reach of ICP
    max_turn_rad: float = 0.6  # largest rotation tried against the start heading: heading drift, and a wrong start heading
    turn_step_rad: float = 0.06
    first_prefix: int = 200  # vertices that hypotheses are first scored on: about 1 km, with some turns in every town
    kept: tuple[int, ...] = (160, 60, 24, 12)  # hypotheses kept in each round; the last number holds for all later rounds
    truncation_m: float = 30.0  # a vertex farther than this from any fitting road counts as if it were at this distance
    heading_lever_m: float = 25.0  # metres that a heading error of 1 rad counts as in the distance from a road
    max_misfit: float = 0.75  # largest mean distance, as a share of truncation_m; maps laid out at random reach 0.6-0.7
    trimmed_share: float = 0.85  # share of the vertices that an ICP step uses: the rest may lie on roads that the network lacks
    icp_steps: int = 6
    road_sigma_m: float = 5.0  # sigma of a well aligned vertex's distance from its road
    bend_sigma_m: float = 10.0  # sigma of the first vertex's distance from the start pose: the best similarity of a bent map
    scored_vertices: int = 150  # evenly spaced vertices of the prefix that are used: enough to rank hypotheses


@dataclass(frozen=True, slots=True)
class RouteRefineConfig:
    """Constants of refinement mode ``route``."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    search: RouteSearchConfig = field(default_factory=RouteSearchConfig)
    confidence: ConfidenceConfig = field(default_factory=ConfidenceConfig)
    solver: SolverConfig = field(default_factory=SolverConfig)
    road_reading: bool = True  # use what the mapper read of the road, if it did: place in the lane, and the lane's end


@dataclass(frozen=True, slots=True)
class PaperRefineConfig:
    """Constants of refinement mode ``paper``."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    matching: PaperMatchConfig = field(default_factory=PaperMatchConfig)
    rounds: int = 4  # times that match and optimise alternate; each undoes some of the along-track error of the last projection
    local_weight: float = 1.0  # w_l of Eq. (12), the weight of the map's edges
    global_weight: float = (
        0.16  # w_g of Eq. (12), the weight of the roads, 1/m^2: a vertex 2.5 m from its matched position costs 1
    )
    closure_gate_sigma: float = 4.0  # closures that the map's own poses contradict by more sigmas than this are left out
    min_sigma: tuple[float, float, float] = (0.05, 0.05, 0.005)  # least sigma of an edge: map units, map units, rad
    max_iterations: int = 20
    bent_cost: float = 2.0  # J per vertex above which a map counts as too bent for one similarity and is grown from its beginning
    growth_prefix: int = 300  # vertices laid on the roads as one piece when growing: they tell the scale and have hardly drifted
    growth_step: int = 10  # vertices by which the map grows: over 50 m it runs off by less than the distance between roads
    growth_window: int = 80  # last vertices, which are still bent and tell the local scale; those farther back have settled
    growth_rounds: int = 2


@dataclass(frozen=True, slots=True)
class RefineConfig:
    """``route``: unknown start and scale, right to decimetres. ``paper``: as published, needs a start pose."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    mode: Literal["route", "paper"] = "route"
    route: RouteRefineConfig = field(default_factory=RouteRefineConfig)
    paper: PaperRefineConfig = field(default_factory=PaperRefineConfig)
