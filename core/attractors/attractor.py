"""The equations of a Bayesian attractor network: two populations, integrator and calibration, each a Gaussian on a circle.

A belief is a mean and a reliability; reliability is Fisher information, 1/sigma^2 in 1/rad^2. Every equation is one function, on
floats or on arrays (``Real``): ``mu_*`` are means in rad, ``r_*`` reliabilities in 1/rad^2. ``head_direction`` (a ring) and
``grid_cells`` (tori) are built from these functions.

Mode "paper" keeps the equations as printed, in the order path integration, mutual inhibition, global inhibition, with a floor
under the reliabilities. Mode "bounded" departs from them where they fail:

- global inhibition only ever takes information away (``limited_inhibition``), so that a network may be unsure;
- mutual inhibition acts per second and only as far as the populations disagree (``inhibit``);
- path integration adds its variance (``forget``);
- an injection reaches the integrator too (``hand_back`` of ``head_direction`` and ``grid_cells``).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hippodrome.core.attractors.config import AttractorConfig
from hippodrome.core.se2 import Real, wrap_compiled
from hippodrome.core.types import FloatArray

INTEGRATOR, CALIBRATION = 0, 1  # rows of the arrays that hold both populations

UNINFORMED = 1e-2  # share of the information E below which a network counts as uniform: there is nothing to inhibit


@njit(cache=True)
def belief(theta_rad: Real, mu: Real, reliability: Real) -> Real:
    """Eq. (1), Li et al. 2025: activity of a population's cells at ``theta_rad``, a normal density with mean ``mu``.

    The distance |theta - mu| is taken on the circle. No network evaluates it: Gaussian activity stays Gaussian under Eqs.
    (3)-(16), so that the networks carry its two parameters instead of cells. It is the density those parameters stand for, for
    figures and tests.
    """
    return np.sqrt(reliability / (2.0 * math.pi)) * np.exp(-0.5 * reliability * wrap_compiled(theta_rad - mu) ** 2)


@njit(cache=True)
def belief_2d(x_rad: Real, y_rad: Real, mu_x: Real, mu_y: Real, reliability_x: Real, reliability_y: Real) -> Real:
    """Eq. (2), Li et al. 2025: activity of grid cells at (``x_rad``, ``y_rad``) on the torus, the product of two of Eq. (1).

    Departure: the print has a plus between the two terms of the exponent, which would grow without bound; both are negative here.
    As with ``belief``, the networks carry the four parameters in closed form, and the density itself is for figures and tests.
    """
    return belief(x_rad, mu_x, reliability_x) * belief(y_rad, mu_y, reliability_y)


@njit(cache=True)
def total_information(r_inte: Real, r_cali: Real) -> Real:
    """Eq. (5), Li et al. 2025: W = r_inte + r_cali. It is also Eq. (15), the reliability of the read-out."""
    return r_inte + r_cali


@njit(cache=True)
def global_inhibition(r_inte: Real, r_cali: Real, information: float) -> tuple[Real, Real]:
    """Eqs. (3)-(4), Li et al. 2025, as printed: both reliabilities times E / W, so that they sum to E = ``information``."""
    gain = information / total_information(r_inte, r_cali)
    return gain * r_inte, gain * r_cali


@njit(cache=True)
def limited_inhibition(r_inte: Real, r_cali: Real, information: float) -> tuple[Real, Real]:
    """Eqs. (3)-(4), Li et al. 2025, with min(1, E / W) in place of E / W.

    As printed the total is E at every tick, even for a network that knows nothing, and the reliability of Eq. (15) says nothing.
    Here information is limited but never invented, so that the read-out keeps a true variance.
    """
    gain = np.minimum(1.0, information / total_information(r_inte, r_cali))
    return gain * r_inte, gain * r_cali


@njit(cache=True)
def mutual_inhibition(r_inte: Real, r_cali: Real, delta_inte: Real, delta_cali: Real, floor: float) -> tuple[Real, Real]:
    """Eqs. (6)-(7), Li et al. 2025: each population takes ``delta`` times its own reliability from the other's.

    As printed a reliability can become negative; here it is kept above ``floor``.
    """
    return np.maximum(floor, r_inte - delta_inte * r_cali), np.maximum(floor, r_cali - delta_cali * r_inte)


@njit(cache=True)
def circular_mean(mu_a: Real, mu_b: Real, weight_b: Real) -> Real:
    """Mean of two angles with the weights 1 - ``weight_b`` and ``weight_b``, along the shorter arc between them."""
    return wrap_compiled(mu_a + weight_b * wrap_compiled(mu_b - mu_a))


@njit(cache=True)
def inject(mu_cali: Real, r_cali: Real, mu_inject: Real, r_inject: Real) -> tuple[Real, Real]:
    """Eqs. (13)-(14), Li et al. 2025: inject the mean ``mu_inject`` of a recognised view, with reliability ``r_inject``.

    The belief of the calibration cells is multiplied by the view's, both Gaussians; returns the new mean and reliability.
    """
    r_new = r_cali + r_inject
    return circular_mean(mu_cali, mu_inject, r_inject / r_new), r_new


@njit(cache=True)
def read_out(mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real) -> tuple[Real, Real]:
    """Eqs. (15)-(16), Li et al. 2025: mean and reliability of the fused belief, the product of both populations' Gaussians."""
    r_f = total_information(r_inte, r_cali)
    return circular_mean(mu_inte, mu_cali, r_cali / r_f), r_f


@njit(cache=True)
def overlap(mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real) -> Real:
    """How far two beliefs agree, from 1 (same mean) to 0: exp(-d^2 / (2 (sigma_inte^2 + sigma_cali^2))), d between the means."""
    sq_sigma = 1.0 / r_inte + 1.0 / r_cali
    return np.exp(-0.5 * wrap_compiled(mu_cali - mu_inte) ** 2 / sq_sigma)


@njit(cache=True)
def forget(
    mu_inte: Real, r_inte: Real, mu_cali: Real, r_cali: Real, sq_sigma_inte: Real, sq_sigma_cali: Real
) -> tuple[Real, Real]:
    """Reliabilities after path integration has added the variances ``sq_sigma_*`` in rad^2 (mode "bounded"; the paper adds none).

    Populations that agree (``overlap`` 1) share one belief, so that they lose reliability together: the variance 1 / W of the
    fused belief grows. Populations in conflict (``overlap`` 0) are two beliefs: the variance 1 / r of each one grows by itself.
    """
    shared = overlap(mu_inte, r_inte, mu_cali, r_cali)
    inte = r_inte / (1.0 + sq_sigma_inte * (r_inte + shared * r_cali))
    return inte, r_cali / (1.0 + sq_sigma_cali * (r_cali + shared * r_inte))


@njit(cache=True)
def _inhibit(
    mean: FloatArray, reliability: FloatArray, information: FloatArray, deltas: tuple[float, float], floor: float, paper: bool
) -> FloatArray:
    """Mutual, then global inhibition of every pair of populations: new reliabilities (M, 2, A).

    ``information`` (M,) is E of each module; mode "paper" or "bounded" is chosen by ``paper``, see ``inhibit``.
    """
    result = reliability.copy()
    for m in range(mean.shape[0]):
        total, least = information[m], floor * information[m]
        for a in range(mean.shape[2]):
            r_inte, r_cali = reliability[m, INTEGRATOR, a], reliability[m, CALIBRATION, a]
            if paper:
                r_inte, r_cali = mutual_inhibition(r_inte, r_cali, deltas[0], deltas[1], least)
                r_inte, r_cali = global_inhibition(r_inte, r_cali, total)
            elif r_inte + r_cali > UNINFORMED * total:
                conflict = 1.0 - overlap(mean[m, INTEGRATOR, a], r_inte, mean[m, CALIBRATION, a], r_cali)
                r_inte, r_cali = mutual_inhibition(r_inte, r_cali, conflict * deltas[0], conflict * deltas[1], least)
                r_inte, r_cali = limited_inhibition(r_inte, r_cali, total)
            result[m, INTEGRATOR, a], result[m, CALIBRATION, a] = r_inte, r_cali
    return result


def inhibit(
    mean_rad: FloatArray, reliability: FloatArray, dt_s: float, config: AttractorConfig, information: FloatArray
) -> FloatArray:
    """One update of the competition between the populations, Eqs. (3)-(7), Li et al. 2025: new reliabilities, means stay.

    Departures of mode "bounded": the strengths of Eqs. (6)-(7) count per second instead of per update, so that the outcome does
    not depend on the tick rate; they are weighted by the conflict (1 - ``overlap``), as beliefs that coincide have nothing to
    settle; and nothing is inhibited while the network is uninformed.

    Args:
        mean_rad: (M modules, 2 populations, A axes).
        reliability: the same shape, 1/rad^2.
        dt_s: time since the last update.
        config: strengths of the inhibition, and the mode.
        information: E of each module, (M,).
    """
    scale = 1.0 if config.mode == "paper" else dt_s
    deltas = (min(1.0, scale * config.inhibition_integrator), min(1.0, scale * config.inhibition_calibration))
    result: FloatArray = _inhibit(mean_rad, reliability, information, deltas, config.floor, config.mode == "paper")
    return result
