"""Constants of the paper's matching."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class PaperMatchConfig:
    """Which lanes are candidates, and the noise of Eqs. (8) and (9) that the estimation starts from."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    radius_m: float = 45.0  # candidates are lanes within this radius of a vertex: several times the error of an aligned map
    route_slack_m: float = 120.0  # a drive this much longer than the measured motion is ruled out (beta is a few metres)
    first_sigma_z_m: float = 15.0  # sigma_z of the first match: wide, so that one that is off by a road's width can recover
    first_beta_m: float = 5.0  # beta of the first match
    min_sigma_z_m: float = 1.0  # lower bound of sigma_z: below a lane's half width, the driver's wander would decide the lane
    min_beta_m: float = 0.5  # lower bound of beta, which is nearly 0 on clean maps and would outweigh every emission
    estimations: int = 4  # rounds of matching and estimating sigma_z and beta anew; they settle within 2 or 3
    min_part_vertices: int = 3  # fewer matched vertices between two breaks are given up: no route confirms them
