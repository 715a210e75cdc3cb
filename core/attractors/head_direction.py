"""Head-direction network: a ring of integrator and calibration cells. Small immutable state, pure step functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.attractors import attractor
from hippodrome.core.attractors.attractor import CALIBRATION, INTEGRATOR, AttractorConfig
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class HeadDirectionState:
    """Beliefs of the two populations: ``mean_rad`` (2,), ``reliability`` (2,) in 1/rad^2."""

    mean_rad: FloatArray
    reliability: FloatArray


def uniform(config: AttractorConfig) -> HeadDirectionState:
    """No prior knowledge: both populations flat."""
    return HeadDirectionState(np.zeros(2), np.full(2, config.floor * config.information))


def known(heading_rad: float, config: AttractorConfig) -> HeadDirectionState:
    """A known heading: the integrator holds E, the calibration cells their share of it."""
    reliability = config.information * np.array([1.0, config.calibration_share])
    return HeadDirectionState(np.full(2, wrap_compiled(heading_rad)), reliability)


def integrate(
    state: HeadDirectionState, omega_radps: float, dt_s: float, sq_sigma_rad: tuple[float, float] = (0.0, 0.0)
) -> HeadDirectionState:
    """Path integration: both peaks turn by omega dt; the motion adds ``sq_sigma_rad`` to each's variance (0: as printed)."""
    turned = omega_radps * dt_s
    (mu_inte, mu_cali), (r_inte, r_cali) = state.mean_rad.tolist(), state.reliability.tolist()
    mean = np.array([wrap_compiled(mu_inte + turned), wrap_compiled(mu_cali + turned)])
    if sq_sigma_rad == (0.0, 0.0):
        return HeadDirectionState(mean, state.reliability)
    return HeadDirectionState(mean, np.array(attractor.forget(mu_inte, r_inte, mu_cali, r_cali, *sq_sigma_rad)))


def inhibit(state: HeadDirectionState, dt_s: float, config: AttractorConfig) -> HeadDirectionState:
    """Mutual and global inhibition, Eqs. (3)-(7), Li et al. 2025."""
    mean, reliability = state.mean_rad.reshape(1, 2, 1), state.reliability.reshape(1, 2, 1)
    inhibited = attractor.inhibit(mean, reliability, dt_s, config, np.array([config.information]))
    return HeadDirectionState(state.mean_rad, inhibited.reshape(2))


def stimulate(state: HeadDirectionState, heading_rad: float, reliability: float) -> HeadDirectionState:
    """Eqs. (13)-(14), Li et al. 2025, on the calibration cells."""
    mu_cali, r_cali = attractor.inject(state.mean_rad[CALIBRATION], state.reliability[CALIBRATION], heading_rad, reliability)
    return HeadDirectionState(np.array([state.mean_rad[INTEGRATOR], mu_cali]), np.array([state.reliability[INTEGRATOR], r_cali]))


def inject(state: HeadDirectionState, heading_rad: float, reliability: float, config: AttractorConfig) -> HeadDirectionState:
    """One injection: Eqs. (13)-(14), Li et al. 2025; mode "bounded" then hands the fused belief back to both populations."""
    stimulated = stimulate(state, heading_rad, reliability)
    return stimulated if config.mode == "paper" else hand_back(stimulated, config)


def hand_back(state: HeadDirectionState, config: AttractorConfig) -> HeadDirectionState:
    """The fused belief of Eqs. (15)-(16) to both populations, total information kept. Without it an injection never
    reaches the integrator (nothing in the printed equations moves from one population to the other).
    """
    heading_rad, reliability = read_out(state)
    shares = np.array([1.0 - config.calibration_share, config.calibration_share])
    return HeadDirectionState(np.full(2, heading_rad), reliability * shares)


def challenge(state: HeadDirectionState, heading_rad: float, reliability: float) -> HeadDirectionState:
    """Calibration cells leave for a conflicting heading; the integrator keeps its own, and the two compete."""
    return HeadDirectionState(
        np.array([state.mean_rad[INTEGRATOR], wrap_compiled(heading_rad)]),
        np.array([state.reliability[INTEGRATOR], reliability]),
    )


def adopt(state: HeadDirectionState, population: int, config: AttractorConfig) -> HeadDirectionState:
    """The conflict is decided: both populations snap to the winning one's belief (blending would please neither)."""
    shares = np.array([1.0 - config.calibration_share, config.calibration_share])
    return HeadDirectionState(np.full(2, state.mean_rad[population]), state.reliability[population] * shares)


def read_out(state: HeadDirectionState) -> tuple[float, float]:
    """Eqs. (15)-(16), Li et al. 2025: heading_rad and its reliability in 1/rad^2."""
    (mu_inte, mu_cali), (r_inte, r_cali) = state.mean_rad.tolist(), state.reliability.tolist()
    heading_rad, reliability = attractor.read_out(mu_inte, r_inte, mu_cali, r_cali)
    return float(heading_rad), float(reliability)
