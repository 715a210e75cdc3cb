"""Bayesian attractor: two populations per network, integrator and calibration, each a Gaussian belief on a circle.

A belief is (mean, reliability); reliability is Fisher information, 1/sigma^2 in 1/rad^2. Every equation is one function on
floats or arrays. ``core.head_direction`` (ring) and ``core.grid_cells`` (tori) are built from them.

Where the printed equations fail, mode "bounded" departs from them, and says so at the function; mode "paper" keeps them as
printed, with a floor under the reliabilities, in the order path integration, mutual inhibition, global inhibition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numba import njit

from hippodrome.core.se2 import Real, wrap_compiled
from hippodrome.core.types import FloatArray

INTEGRATOR, CALIBRATION = 0, 1

UNINFORMED = 1e-2  # share of the total information below which a network counts as uniform: nothing to inhibit


@dataclass(frozen=True)
class AttractorConfig:
    """One network's constants. Inhibition strengths act per update in mode "paper", per second in mode "bounded"."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    mode: Literal["paper", "bounded"] = "bounded"
    information: float = 100.0  # E, 1/rad^2: the published family uses 100 for head direction
    calibration_share: float = 0.1  # of the information that the calibration cells hold at the start and after a hand-back
    inhibition_integrator: float = 0.02  # Delta_inte of Eq. (6); an unconfirmed challenger fades within some ten seconds
    inhibition_calibration: float = 0.02  # Delta_cali of Eq. (7)
    floor: float = 1e-6  # of the information: keeps reliabilities positive, Eqs. (6)-(7) alone do not


def paper_config(information: float = 100.0, inhibition_calibration: float = 0.2) -> AttractorConfig:
    """The printed network; strengths of a public descendant, where only the calibration cells are inhibited mutually."""
    return AttractorConfig(
        mode="paper", information=information, inhibition_integrator=0.0, inhibition_calibration=inhibition_calibration
    )


@njit(cache=True)
def belief(theta_rad: Real, mu: Real, reliability: Real) -> Real:
    """Eq. (1), Li et al. 2025: density of a population at the cells ``theta_rad``; |.| is the distance on the circle."""
    return np.sqrt(reliability / (2.0 * math.pi)) * np.exp(-0.5 * reliability * wrap_compiled(theta_rad - mu) ** 2)


@njit(cache=True)
def belief_2d(x_rad: Real, y_rad: Real, mu_x: Real, mu_y: Real, reliability_x: Real, reliability_y: Real) -> Real:
    """Eq. (2), Li et al. 2025, the two terms of the exponent both negative (the print has a plus before the second)."""
    return belief(x_rad, mu_x, reliability_x) * belief(y_rad, mu_y, reliability_y)


@njit(cache=True)
def total_information(r_inte: Real, r_cali: Real) -> Real:
    """Eq. (5), Li et al. 2025: W. Also Eq. (15), the reliability of the read-out."""
    return r_inte + r_cali


@njit(cache=True)
def global_inhibition(r_inte: Real, r_cali: Real, information: float) -> tuple[Real, Real]:
    """Eqs. (3)-(4), Li et al. 2025: both reliabilities scaled by E/W, so that they sum to E."""
    gain = information / total_information(r_inte, r_cali)
    return gain * r_inte, gain * r_cali


@njit(cache=True)
def limited_inhibition(r_inte: Real, r_cali: Real, information: float) -> tuple[Real, Real]:
    """Eqs. (3)-(4) with min(1, E/W): information is limited, never invented, and so the read-out keeps a true variance."""
    gain = np.minimum(1.0, information / total_information(r_inte, r_cali))
    return gain * r_inte, gain * r_cali


@njit(cache=True)
def mutual_inhibition(r_inte: Real, r_cali: Real, delta_inte: Real, delta_cali: Real, floor: float) -> tuple[Real, Real]:
    """Eqs. (6)-(7), Li et al. 2025, kept above ``floor``: as printed they become negative."""
    return np.maximum(floor, r_inte - delta_inte * r_cali), np.maximum(floor, r_cali - delta_cali * r_inte)


@njit(cache=True)
def circular_mean(mu_a: Real, mu_b: Real, weight_b: Real) -> Real:
    """Weighted mean on the circle, along the shorter arc from ``mu_a`` to ``mu_b``; weight_b in [0, 1]."""
    return wrap_compiled(mu_a + weight_b * wrap_compiled(mu_b - mu_a))


@njit(cache=True)
def inject(mu_cali: Real, r_cali: Real, mu_inject: Real, r_inject: Real) -> tuple[Real, Real]:
    """Eqs. (13)-(14), Li et al. 2025: visual energy into the calibration cells; the means combine on the circle."""
    r_new = r_cali + r_inject
    return circular_mean(mu_cali, mu_inject, r_inject / r_new), r_new


@njit(cache=True)
def read_out(mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real) -> tuple[Real, Real]:
    """Eqs. (15)-(16), Li et al. 2025: the fused belief (mean, reliability)."""
    r_f = total_information(r_inte, r_cali)
    return circular_mean(mu_inte, mu_cali, r_cali / r_f), r_f


@njit(cache=True)
def overlap(mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real) -> Real:
    """How far two beliefs agree, 1 (same mean) to 0: exp(-d^2 / 2(sigma_inte^2 + sigma_cali^2))."""
    sq_sigma = 1.0 / r_inte + 1.0 / r_cali
    return np.exp(-0.5 * wrap_compiled(mu_cali - mu_inte) ** 2 / sq_sigma)


@njit(cache=True)
def forget(
    mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real, sq_sigma_inte: Real, sq_sigma_cali: Real
) -> tuple[Real, Real]:
    """Reliabilities after motion noise of variances ``sq_sigma_*``, as path integration adds it (mode "bounded" only).

    Populations that agree share one belief and fade together, their sum as 1/(1/W + sq_sigma); in conflict each fades alone.
    """
    shared = overlap(mu_inte, r_inte, mu_cali, r_cali)
    inte = r_inte / (1.0 + sq_sigma_inte * (r_inte + shared * r_cali))
    return inte, r_cali / (1.0 + sq_sigma_cali * (r_cali + shared * r_inte))


@njit(cache=True)
def _inhibit(
    mean: FloatArray, reliability: FloatArray, information: FloatArray, deltas: tuple[float, float], floor: float, paper: bool
) -> FloatArray:
    """Mutual, then global inhibition of all (M, 2, A) populations; ``information`` (M,) per module."""
    result = reliability.copy()
    for m in range(mean.shape[0]):
        total = information[m]
        for a in range(mean.shape[2]):
            r_inte, r_cali = reliability[m, 0, a], reliability[m, 1, a]
            if paper:
                r_inte, r_cali = mutual_inhibition(r_inte, r_cali, deltas[0], deltas[1], floor * total)
                r_inte, r_cali = global_inhibition(r_inte, r_cali, total)
            elif r_inte + r_cali > UNINFORMED * total:
                conflict = 1.0 - overlap(mean[m, 0, a], r_inte, mean[m, 1, a], r_cali)
                r_inte, r_cali = mutual_inhibition(r_inte, r_cali, conflict * deltas[0], conflict * deltas[1], floor * total)
                r_inte, r_cali = limited_inhibition(r_inte, r_cali, total)
            result[m, 0, a], result[m, 1, a] = r_inte, r_cali
    return result


def inhibit(
    mean_rad: FloatArray, reliability: FloatArray, dt_s: float, config: AttractorConfig, information: FloatArray
) -> FloatArray:
    """One update of the competition; arrays (M modules, 2 populations, A axes), returns the new reliabilities.

    Mode "bounded": strengths per second instead of per update, so that the outcome does not depend on the tick rate; weighted
    by the conflict (1 - overlap), as peaks that coincide have nothing to settle; skipped while the network is uninformed.
    """
    scale = 1.0 if config.mode == "paper" else dt_s
    deltas = (min(1.0, scale * config.inhibition_integrator), min(1.0, scale * config.inhibition_calibration))
    result: FloatArray = _inhibit(mean_rad, reliability, information, deltas, config.floor, config.mode == "paper")
    return result
