"""Grid cells: attractor networks on several tori (modules) of different periods, for the position.

The phases on a torus tell a position only up to whole periods. With a single torus, the read-out is wrong by a period once the
drift exceeds half a period. Modules of unequal periods together tell the position over kilometres (a departure: the paper has a
single torus).

Lengths are in the caller's unit: map units while mapping, metres while localizing. An immutable state, and pure functions on it,
as in ``head_direction``; ``grid_decoding`` tells a position from the phases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.attractors import attractor
from hippodrome.core.attractors.attractor import CALIBRATION, INTEGRATOR
from hippodrome.core.attractors.config import PERIOD_RATIOS, TURN, AttractorConfig
from hippodrome.core.attractors.grid_decoding import decode, decode_compiled
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class GridState:
    """Beliefs of M modules, as phases on their tori."""

    period: FloatArray  # (M,) in the caller's unit of length
    mean_rad: FloatArray  # (M, 2 populations, 2 axes)
    reliability: FloatArray  # (M, 2 populations, 2 axes) 1/rad^2


def module_periods(smallest: float) -> FloatArray:
    """Periods (M,) of the modules in the ratios ``PERIOD_RATIOS``; ``smallest`` is the first of them, in any unit of length."""
    return smallest * np.array(PERIOD_RATIOS) / PERIOD_RATIOS[0]


def information(period: FloatArray, config: AttractorConfig) -> FloatArray:
    """E of each module, (M,) in 1/rad^2, scaled so that all modules know a position to the same sigma in length at best.

    The same length is a smaller phase on a larger torus, so that E in 1/rad^2 grows with the squared period.
    """
    scaled: FloatArray = config.information * (period / period[0]) ** 2
    return scaled


def uniform(period: FloatArray, config: AttractorConfig) -> GridState:
    """A state without prior knowledge: the beliefs of all populations are as good as flat. ``period`` is (M,)."""
    flat = np.broadcast_to(config.floor * information(period, config)[:, None, None], (len(period), 2, 2)).copy()
    return GridState(period, np.zeros((len(period), 2, 2)), flat)


def known(position: FloatArray, period: FloatArray, config: AttractorConfig) -> GridState:
    """The state of networks that know their position (2,): the integrators hold E, the calibration cells a share of it."""
    mean = np.repeat(phase(position, period)[:, None, :], 2, axis=1)
    shares = np.array([1.0, config.calibration_share])
    total = information(period, config)[:, None, None] * shares[None, :, None] * np.ones(2)
    return GridState(period, mean, total)


def phase(position: FloatArray, period: FloatArray) -> FloatArray:
    """Phases (M, 2) of a position (2,) on tori of the given periods (M,)."""
    phases: FloatArray = wrap_compiled(TURN * position[None, :] / period[:, None])
    return phases


def phase_reliability(reliability: FloatArray, period: FloatArray) -> FloatArray:
    """A position's reliability per axis, (2,) in 1/length^2, on each torus: (M, 2) in 1/rad^2."""
    scaled: FloatArray = reliability[None, :] * ((period / TURN) ** 2)[:, None]
    return scaled


@njit(cache=True)
def _integrate(
    old_mean: FloatArray, old_reliability: FloatArray, period: FloatArray, step: FloatArray, sq_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The compiled part of ``integrate``: returns the new means and reliabilities, each (M modules, 2 populations, 2 axes).

    A displacement becomes a change of phase by the factor 2 pi / period, and a variance by the square of this factor. On an axis
    to which the motion adds no variance, as in the paper, the reliabilities stay as they are.
    """
    mean, reliability = np.empty_like(old_mean), old_reliability.copy()
    for m in range(mean.shape[0]):
        per_length = 2.0 * math.pi / period[m]
        for a in range(2):
            for p in range(2):
                mean[m, p, a] = wrap_compiled(old_mean[m, p, a] + step[p, a] * per_length)
            if sq_sigma[INTEGRATOR, a] != 0.0 or sq_sigma[CALIBRATION, a] != 0.0:
                reliability[m, INTEGRATOR, a], reliability[m, CALIBRATION, a] = attractor.forget(
                    old_mean[m, INTEGRATOR, a],
                    old_reliability[m, INTEGRATOR, a],
                    old_mean[m, CALIBRATION, a],
                    old_reliability[m, CALIBRATION, a],
                    sq_sigma[INTEGRATOR, a] * per_length**2,
                    sq_sigma[CALIBRATION, a] * per_length**2,
                )
    return mean, reliability


def integrate(state: GridState, step: FloatArray, sq_sigma: FloatArray) -> GridState:
    """Path integration: every mean moves by its population's displacement, and the motion's variance is added.

    Each population moves along its own head direction, so that two beliefs in conflict carry a heading each.

    Args:
        state: the networks before the motion.
        step: the displacement of each population on each axis, (2 populations, 2 axes).
        sq_sigma: the variance that the motion adds to each of these, in length^2, the same shape. The paper adds none: zeros.
    """
    mean, reliability = _integrate(state.mean_rad, state.reliability, state.period, step, sq_sigma)
    return GridState(state.period, mean, reliability)


def displacement(heading_rad: FloatArray, speed: float, dt_s: float) -> FloatArray:
    """Displacements (2 populations, 2 axes) along each population's heading (2,): cos(theta) v dt and sin(theta) v dt."""
    distance = speed * dt_s
    return np.array([[distance * math.cos(theta), distance * math.sin(theta)] for theta in heading_rad.tolist()])


def inhibit(state: GridState, dt_s: float, config: AttractorConfig) -> GridState:
    """Mutual and global inhibition over ``dt_s``, Eqs. (3)-(7), Li et al. 2025, on each axis of each torus."""
    inhibited = attractor.inhibit(state.mean_rad, state.reliability, dt_s, config, information(state.period, config))
    return GridState(state.period, state.mean_rad, inhibited)


def stimulate(state: GridState, position: FloatArray, reliability: FloatArray) -> GridState:
    """Inject the position (2,) that a recognised view shows: Eqs. (13)-(14), Li et al. 2025, on the calibration cells alone.

    ``reliability`` (2 axes,) is in 1/length^2.
    """
    mean, total = state.mean_rad.copy(), state.reliability.copy()
    mean[:, CALIBRATION], total[:, CALIBRATION] = attractor.inject(
        mean[:, CALIBRATION], total[:, CALIBRATION], phase(position, state.period), phase_reliability(reliability, state.period)
    )
    return GridState(state.period, mean, total)


def inject(state: GridState, position: FloatArray, reliability: FloatArray, config: AttractorConfig) -> GridState:
    """Inject the position (2,) that a recognised view measures, with its reliability (2,) in 1/length^2.

    As printed, Eqs. (13)-(14), Li et al. 2025, change the calibration cells only (``stimulate``). In mode "bounded" the fused
    belief then goes to both populations (``hand_back``).
    """
    stimulated = stimulate(state, position, reliability)
    return stimulated if config.mode == "paper" else hand_back(stimulated, config)


def hand_back(state: GridState, config: AttractorConfig) -> GridState:
    """Let both populations take over the fused belief of Eqs. (15)-(16) and share its information between them.

    This is a departure from the paper, for mode "bounded" only: without it an injection would never reach the integrators.
    """
    mean, total = fused(state)
    return _shared(state, mean, total, config)


def challenge(state: GridState, position: FloatArray, reliability: FloatArray) -> GridState:
    """Let the calibration cells take over a position (2,) that conflicts with the belief; the integrators keep theirs.

    ``reliability`` (2,) is in 1/length^2. From then on the two beliefs compete by inhibition.
    """
    mean, total = state.mean_rad.copy(), state.reliability.copy()
    mean[:, CALIBRATION] = phase(position, state.period)
    total[:, CALIBRATION] = phase_reliability(reliability, state.period)
    return GridState(state.period, mean, total)


def adopt(state: GridState, population: int, config: AttractorConfig) -> GridState:
    """End the conflict: both populations take over the belief of the winning ``population``."""
    return _shared(state, state.mean_rad[:, population], state.reliability[:, population], config)


def _shared(state: GridState, mean: FloatArray, total: FloatArray, config: AttractorConfig) -> GridState:
    """Give both populations the same belief, and divide its information between them.

    ``mean`` and ``total`` (M, 2) are its phases and reliabilities. The fused belief of the two populations is then this belief
    again.
    """
    shares = np.array([1.0 - config.calibration_share, config.calibration_share])
    return GridState(state.period, np.repeat(mean[:, None, :], 2, axis=1), total[:, None, :] * shares[None, :, None])


def fused(state: GridState) -> tuple[FloatArray, FloatArray]:
    """The fused belief of each module, Eqs. (15)-(16), Li et al. 2025: phases (M, 2) and reliabilities (M, 2) in 1/rad^2."""
    mean, reliability = attractor.read_out(
        state.mean_rad[:, INTEGRATOR],
        state.reliability[:, INTEGRATOR],
        state.mean_rad[:, CALIBRATION],
        state.reliability[:, CALIBRATION],
    )
    return mean, reliability


def read_out(state: GridState, near: FloatArray, reach: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """The position that both populations of all modules encode together, Eqs. (15)-(16), Li et al. 2025, and its reliability.

    The modules hold one and the same belief on different tori, not independent ones: their reliabilities are averaged, not added.

    Args:
        state: state of all modules.
        near: a prior position (2,). Phases repeat with the periods; the position is sought on the repetitions (sheets) near it.
        reach: sheets within this distance of ``near`` are tried; 0 takes the nearest one.

    Returns:
        Position (2,) and reliability (2,) in 1/length^2.
    """
    position, reliability = _read_out(state.mean_rad, state.reliability, state.period, near, reach)
    return position, reliability


def population_belief(state: GridState, population: int, near: FloatArray, reach: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Position (2,) that one population encodes, and its reliability (2,) in 1/length^2; arguments as of ``read_out``."""
    reliability = state.reliability[:, population]
    per_length = (TURN / state.period[:, None]) ** 2
    position = decode(state.mean_rad[:, population], reliability, state.period, near, reach)
    return position, np.mean(reliability * per_length, axis=0)


@njit(cache=True)
def _read_out(
    mean_rad: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """The compiled part of ``read_out``: position (2,) and reliability (2,) in 1/length^2.

    In each module the two populations are fused. The position is decoded from the fused phases of all modules, and its
    reliability is the mean of theirs.
    """
    modules = len(period)
    mean_f, total, per_axis = np.empty((modules, 2)), np.empty((modules, 2)), np.zeros(2)
    for m in range(modules):
        for a in range(2):
            mean_f[m, a], total[m, a] = attractor.read_out(
                mean_rad[m, INTEGRATOR, a],
                reliability[m, INTEGRATOR, a],
                mean_rad[m, CALIBRATION, a],
                reliability[m, CALIBRATION, a],
            )
            per_axis[a] += total[m, a] * (2.0 * math.pi / period[m]) ** 2 / modules
    return decode_compiled(mean_f, total, period, near, reach), per_axis
