"""Head-direction cells: one attractor network on a ring, for the heading. An immutable state, and pure functions on it.

The functions come in the order of a tick: ``integrate`` self-motion, ``inhibit``, and now and then ``inject`` what a view says.
``challenge`` and ``adopt`` are for views that contradict the belief: the populations then hold two beliefs that compete.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.attractors import attractor
from hippodrome.core.attractors.attractor import CALIBRATION, INTEGRATOR
from hippodrome.core.attractors.config import AttractorConfig
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class HeadDirectionState:
    """Beliefs of the two populations, integrator first."""

    mean_rad: FloatArray  # (2,)
    reliability: FloatArray  # (2,) 1/rad^2


def uniform(config: AttractorConfig) -> HeadDirectionState:
    """A state without prior knowledge: the beliefs of both populations are as good as flat."""
    return HeadDirectionState(np.zeros(2), np.full(2, config.floor * config.information))


def known(heading_rad: float, config: AttractorConfig) -> HeadDirectionState:
    """The state of a network that knows its heading: the integrator holds E, the calibration cells a share of it."""
    reliability = config.information * np.array([1.0, config.calibration_share])
    return HeadDirectionState(np.full(2, wrap_compiled(heading_rad)), reliability)


def integrate(
    state: HeadDirectionState, omega_radps: float, dt_s: float, sq_sigma_rad: tuple[float, float] = (0.0, 0.0)
) -> HeadDirectionState:
    """Path integration: both means turn by omega dt, and the motion's variance (integrator, calibration) is added to theirs.

    The paper adds no variance: ``sq_sigma_rad`` of zeros leaves the reliabilities alone, as printed.
    """
    turned = omega_radps * dt_s
    (mu_inte, mu_cali), (r_inte, r_cali) = state.mean_rad.tolist(), state.reliability.tolist()
    mean = np.array([wrap_compiled(mu_inte + turned), wrap_compiled(mu_cali + turned)])
    if sq_sigma_rad == (0.0, 0.0):
        return HeadDirectionState(mean, state.reliability)
    return HeadDirectionState(mean, np.array(attractor.forget(mu_inte, r_inte, mu_cali, r_cali, *sq_sigma_rad)))


def inhibit(state: HeadDirectionState, dt_s: float, config: AttractorConfig) -> HeadDirectionState:
    """Mutual and global inhibition over ``dt_s``, Eqs. (3)-(7), Li et al. 2025: reliabilities change, the means stay."""
    mean, reliability = state.mean_rad.reshape(1, 2, 1), state.reliability.reshape(1, 2, 1)
    inhibited = attractor.inhibit(mean, reliability, dt_s, config, np.array([config.information]))
    return HeadDirectionState(state.mean_rad, inhibited.reshape(2))


def stimulate(state: HeadDirectionState, heading_rad: float, reliability: float) -> HeadDirectionState:
    """Inject the heading that a recognised view shows: Eqs. (13)-(14), Li et al. 2025, on the calibration cells alone."""
    mu_cali, r_cali = attractor.inject(state.mean_rad[CALIBRATION], state.reliability[CALIBRATION], heading_rad, reliability)
    return HeadDirectionState(np.array([state.mean_rad[INTEGRATOR], mu_cali]), np.array([state.reliability[INTEGRATOR], r_cali]))


def inject(state: HeadDirectionState, heading_rad: float, reliability: float, config: AttractorConfig) -> HeadDirectionState:
    """Inject the heading that a recognised view measures, with its reliability in 1/rad^2.

    As printed, Eqs. (13)-(14), Li et al. 2025, change the calibration cells only (``stimulate``). In mode "bounded" the fused
    belief then goes to both populations (``hand_back``).
    """
    stimulated = stimulate(state, heading_rad, reliability)
    return stimulated if config.mode == "paper" else hand_back(stimulated, config)


def hand_back(state: HeadDirectionState, config: AttractorConfig) -> HeadDirectionState:
    """Let both populations take over the fused belief of Eqs. (15)-(16) and share its information: mode "bounded" only.

    This is a departure: as printed nothing moves from one population to the other, so that an injection never reaches the
    integrator and is forgotten as soon as the calibration cells are inhibited.
    """
    heading_rad, reliability = read_out(state)
    return _shared(heading_rad, reliability, config)


def challenge(state: HeadDirectionState, heading_rad: float, reliability: float) -> HeadDirectionState:
    """Let the calibration cells take over a heading that conflicts with the belief; the integrator keeps its own.

    From then on the two beliefs compete by inhibition.
    """
    return HeadDirectionState(
        np.array([state.mean_rad[INTEGRATOR], wrap_compiled(heading_rad)]),
        np.array([state.reliability[INTEGRATOR], reliability]),
    )


def adopt(state: HeadDirectionState, population: int, config: AttractorConfig) -> HeadDirectionState:
    """End the conflict: both populations take over the belief of the winning ``population``.

    The mean of two beliefs in conflict would fit neither.
    """
    return _shared(state.mean_rad[population], state.reliability[population], config)


def _shared(heading_rad: float, reliability: float, config: AttractorConfig) -> HeadDirectionState:
    """Give both populations the same belief, and divide its information between them."""
    shares = np.array([1.0 - config.calibration_share, config.calibration_share])
    return HeadDirectionState(np.full(2, heading_rad), reliability * shares)


def read_out(state: HeadDirectionState) -> tuple[float, float]:
    """The fused belief of both populations, Eqs. (15)-(16), Li et al. 2025: heading in rad and its reliability in 1/rad^2."""
    (mu_inte, mu_cali), (r_inte, r_cali) = state.mean_rad.tolist(), state.reliability.tolist()
    heading_rad, reliability = attractor.read_out(mu_inte, r_inte, mu_cali, r_cali)
    return float(heading_rad), float(reliability)
