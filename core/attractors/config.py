"""Constants of the attractor networks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

PERIOD_RATIOS = (97.0, 131.0, 173.0)  # pairwise coprime: the joint code repeats only after 97 * 131 * 173 units
TURN = 2.0 * math.pi
GRID_INFORMATION = (PERIOD_RATIOS[0] / TURN) ** 2  # E of the first module, 1/rad^2: a sigma of 1 m at a period of 97 m


@dataclass(frozen=True)
class AttractorConfig:
    """Constants of one network."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    mode: Literal["paper", "bounded"] = "bounded"
    information: float = 100.0  # E, the most information a network holds, 1/rad^2; the published family has 100 for the heading
    calibration_share: float = 0.1  # share of the information that the calibration cells get at the start and by a hand-back
    inhibition_integrator: float = 0.02  # Delta_inte, Eq. (6), on the integrator; per update (mode paper) or second (bounded)
    inhibition_calibration: float = 0.02  # Delta_cali, Eq. (7), likewise; at 0.02 an unconfirmed rival fades in some ten seconds
    floor: float = 1e-6  # least reliability as a share of E; Eqs. (6)-(7) alone would let reliabilities become negative


def paper_config(information: float = 100.0, inhibition_calibration: float = 0.2) -> AttractorConfig:
    """The network as printed; the paper gives no strengths of inhibition, these are of a public successor of its network."""
    return AttractorConfig(
        mode="paper", information=information, inhibition_integrator=0.0, inhibition_calibration=inhibition_calibration
    )
