"""Grid-cell network: several tori (modules) of different periods, each with integrator and calibration cells.

One torus repeats every period and locks to a wrong sheet once drift passes half of it; together, modules of unequal periods
tell the sheets apart over kilometres. Lengths are in the caller's unit (map units while mapping, metres while localizing).
Small immutable state, pure step functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.attractors import attractor
from hippodrome.core.attractors.attractor import AttractorConfig
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

PERIOD_RATIOS = (97.0, 131.0, 173.0)  # pairwise coprime: the joint code repeats only after 97 * 131 * 173 units
TURN = 2.0 * math.pi
GRID_INFORMATION = (PERIOD_RATIOS[0] / TURN) ** 2  # E of the first module, 1/rad^2: 1 m at a period of 97 m, "1 per axis"


@dataclass(frozen=True, slots=True, eq=False)
class GridState:
    """Beliefs of M modules. ``period`` (M,); means and reliabilities (M, 2 populations, 2 axes) in rad and 1/rad^2."""

    period: FloatArray
    mean_rad: FloatArray
    reliability: FloatArray


def module_periods(smallest: float) -> FloatArray:
    """Periods (M,) in the fixed ratios, the smallest given in the caller's unit of length."""
    return smallest * np.array(PERIOD_RATIOS) / PERIOD_RATIOS[0]


def information(period: FloatArray, config: AttractorConfig) -> FloatArray:
    """E (M,) of each module: the first one's, for the same length on larger tori (1/rad^2 grows with the squared period)."""
    scaled: FloatArray = config.information * (period / period[0]) ** 2
    return scaled


def uniform(period: FloatArray, config: AttractorConfig) -> GridState:
    """No prior knowledge: all populations flat."""
    flat = np.broadcast_to(config.floor * information(period, config)[:, None, None], (len(period), 2, 2)).copy()
    return GridState(period, np.zeros((len(period), 2, 2)), flat)


def known(position: FloatArray, period: FloatArray, config: AttractorConfig) -> GridState:
    """A known position (2,): the integrators hold E, the calibration cells their share of it."""
    mean = np.repeat(phase(position, period)[:, None, :], 2, axis=1)
    shares = np.array([1.0, config.calibration_share])
    total = information(period, config)[:, None, None] * shares[None, :, None] * np.ones(2)
    return GridState(period, mean, total)


def phase(position: FloatArray, period: FloatArray) -> FloatArray:
    """Phases (M, 2) on the tori of a position (2,)."""
    phases: FloatArray = wrap_compiled(TURN * position[None, :] / period[:, None])
    return phases


def phase_reliability(reliability: FloatArray, period: FloatArray) -> FloatArray:
    """Reliability per axis (2,), 1/length^2, as (M, 2) in 1/rad^2."""
    scaled: FloatArray = reliability[None, :] * ((period / TURN) ** 2)[:, None]
    return scaled


@njit(cache=True)
def _integrate(
    old_mean: FloatArray, old_reliability: FloatArray, period: FloatArray, step: FloatArray, sq_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    mean, reliability = np.empty_like(old_mean), old_reliability.copy()
    for m in range(mean.shape[0]):
        per_length = 2.0 * math.pi / period[m]
        for a in range(2):
            for p in range(2):
                mean[m, p, a] = wrap_compiled(old_mean[m, p, a] + step[p, a] * per_length)
            if sq_sigma[0, a] != 0.0 or sq_sigma[1, a] != 0.0:
                reliability[m, 0, a], reliability[m, 1, a] = attractor.forget(
                    old_mean[m, 0, a],
                    old_reliability[m, 0, a],
                    old_mean[m, 1, a],
                    old_reliability[m, 1, a],
                    sq_sigma[0, a] * per_length**2,
                    sq_sigma[1, a] * per_length**2,
                )
    return mean, reliability


def integrate(state: GridState, step: FloatArray, sq_sigma: FloatArray) -> GridState:
    """Path integration by displacements ``step`` (2 populations, 2 axes).

    ``sq_sigma`` (2 populations, 2 axes) is the variance that the motion adds (0: as printed). Each population moves along its
    own head direction, so that a challenger carries its own heading.
    """
    mean, reliability = _integrate(state.mean_rad, state.reliability, state.period, step, sq_sigma)
    return GridState(state.period, mean, reliability)


def displacement(heading_rad: FloatArray, speed: float, dt_s: float) -> FloatArray:
    """Displacements (2 populations, 2 axes) of motion along ``heading_rad`` (2,): x += cos(theta) v dt, y += sin(theta) v dt."""
    distance = speed * dt_s
    return np.array([[distance * math.cos(theta), distance * math.sin(theta)] for theta in heading_rad.tolist()])


def inhibit(state: GridState, dt_s: float, config: AttractorConfig) -> GridState:
    """Mutual and global inhibition, Eqs. (3)-(7), Li et al. 2025, on each axis of each torus."""
    inhibited = attractor.inhibit(state.mean_rad, state.reliability, dt_s, config, information(state.period, config))
    return GridState(state.period, state.mean_rad, inhibited)


def stimulate(state: GridState, position: FloatArray, reliability: FloatArray) -> GridState:
    """Eqs. (13)-(14), Li et al. 2025, on the calibration cells, at a position (2,); reliability (2,) in 1/length^2."""
    mean, total = state.mean_rad.copy(), state.reliability.copy()
    mean[:, 1], total[:, 1] = attractor.inject(
        mean[:, 1], total[:, 1], phase(position, state.period), phase_reliability(reliability, state.period)
    )
    return GridState(state.period, mean, total)


def inject(state: GridState, position: FloatArray, reliability: FloatArray, config: AttractorConfig) -> GridState:
    """One injection: Eqs. (13)-(14), Li et al. 2025; mode "bounded" then hands the fused belief back to both populations."""
    stimulated = stimulate(state, position, reliability)
    return stimulated if config.mode == "paper" else hand_back(stimulated, config)


def hand_back(state: GridState, config: AttractorConfig) -> GridState:
    """The fused belief of Eqs. (15)-(16) to both populations, total information kept (see ``head_direction.hand_back``)."""
    mean, total = fused(state)
    return _shared(state, mean, total, config)


def challenge(state: GridState, position: FloatArray, reliability: FloatArray) -> GridState:
    """Calibration cells leave for a conflicting position (2,); the integrators keep theirs, and the two compete."""
    mean, total = state.mean_rad.copy(), state.reliability.copy()
    mean[:, 1] = phase(position, state.period)
    total[:, 1] = phase_reliability(reliability, state.period)
    return GridState(state.period, mean, total)


def adopt(state: GridState, population: int, config: AttractorConfig) -> GridState:
    """The conflict is decided: both populations snap to the winning one's belief."""
    return _shared(state, state.mean_rad[:, population], state.reliability[:, population], config)


def _shared(state: GridState, mean: FloatArray, total: FloatArray, config: AttractorConfig) -> GridState:
    shares = np.array([1.0 - config.calibration_share, config.calibration_share])
    return GridState(state.period, np.repeat(mean[:, None, :], 2, axis=1), total[:, None, :] * shares[None, :, None])


def fused(state: GridState) -> tuple[FloatArray, FloatArray]:
    """Eqs. (15)-(16), Li et al. 2025: phases (M, 2) and their reliabilities (M, 2) in 1/rad^2."""
    mean, reliability = attractor.read_out(
        state.mean_rad[:, 0], state.reliability[:, 0], state.mean_rad[:, 1], state.reliability[:, 1]
    )
    return mean, reliability


def read_out(state: GridState, near: FloatArray, reach: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Fused position (2,) nearest to the prior ``near`` (2,) and its reliability (2,) in 1/length^2.

    The modules hold the same belief on different tori, not independent ones: their reliabilities average, they do not add.
    """
    position, reliability = _read_out(state.mean_rad, state.reliability, state.period, near, reach)
    return position, reliability


def population_belief(state: GridState, population: int, near: FloatArray, reach: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Position (2,) that one population encodes, nearest to ``near`` (2,), and its reliability (2,) in 1/length^2."""
    reliability = state.reliability[:, population]
    per_length = (TURN / state.period[:, None]) ** 2
    position = decode(state.mean_rad[:, population], reliability, state.period, near, reach)
    return position, np.mean(reliability * per_length, axis=0)


def decode(mean_rad: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float) -> FloatArray:
    """Position (2,) whose phases fit the modules' (M, 2) best, among the sheets within ``reach`` of ``near`` (2,).

    ``reach`` 0 unwraps each phase to the sheet nearest to ``near``, as path integration does at every step.
    """
    position: FloatArray = _decode(mean_rad, reliability, period, near, reach)
    return position


@njit(cache=True)
def _decode(mean: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float) -> FloatArray:
    best = np.empty(2)
    for a in range(2):
        sheets = math.ceil(reach / period[0])
        home = near[a] + wrap_compiled(mean[0, a] - 2.0 * math.pi * near[a] / period[0]) * period[0] / (2.0 * math.pi)
        best_cost = math.inf
        for k in range(-sheets, sheets + 1):
            candidate = home + k * period[0]
            shift, weight = 0.0, 0.0
            for m in range(mean.shape[0]):  # weighted least squares about the candidate
                per_length = 2.0 * math.pi / period[m]
                information = reliability[m, a] * per_length**2
                shift += information * wrap_compiled(mean[m, a] - candidate * per_length) / per_length
                weight += information
            candidate += shift / weight
            cost = 0.0
            for m in range(mean.shape[0]):
                cost += reliability[m, a] * wrap_compiled(mean[m, a] - 2.0 * math.pi * candidate / period[m]) ** 2
            if cost < best_cost or (cost == best_cost and abs(candidate - near[a]) < abs(best[a] - near[a])):
                best[a], best_cost = candidate, cost
    return best


@njit(cache=True)
def _read_out(
    mean_rad: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    modules = len(period)
    mean_f, total, per_axis = np.empty((modules, 2)), np.empty((modules, 2)), np.zeros(2)
    for m in range(modules):
        for a in range(2):
            mean_f[m, a], total[m, a] = attractor.read_out(
                mean_rad[m, 0, a], reliability[m, 0, a], mean_rad[m, 1, a], reliability[m, 1, a]
            )
            per_axis[a] += total[m, a] * (2.0 * math.pi / period[m]) ** 2 / modules
    return _decode(mean_f, total, period, near, reach), per_axis
