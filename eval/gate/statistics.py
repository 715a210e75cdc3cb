"""The arithmetic of the gate's test: is the mean of a few log-ratios above zero, and how many more would tell?

The same code gives the same bytes, so a difference is a difference; there is no noise of measurement to allow for. What is
uncertain is whether a change that moves every pair a little is worse on towns and seeds in general, or only shuffles its luck
among the pairs. Two observations speak for harm, and either suffices:

* the pairs agree: their mean is large beside their own spread (Student's t-test, powerful when harm is even);
* the mean is large beside what a harmless change does to a pair (the same test with a spread that is assumed beforehand and gives
  way to the pairs' own as these become many or spread more; powerful when harm is large but uneven, and pairs are few).

The smaller of both probabilities is doubled, which is Bonferroni's price for asking twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtr, stdtrit

from hippodrome.core.types import FloatArray

ALPHA: Final = 0.025  # chance to fail a build for a change that only shuffles, over all its figures together: one in forty
REPEATABILITY: Final = 0.005  # least standard deviation of a pair's log-ratio: other processors and drivers round differently
# What a change that is neither good nor bad does to a pair, as a standard deviation of its log-ratio, and how many pairs' worth
# of weight that assumption has. ``hippodrome gate --study`` shows what follows: with these, changes by up to a quarter a pair, up
# or down by the toss of a coin, fail at most one build in twenty.
HARMLESS_SPREAD: Final = 0.12
HARMLESS_PAIRS: Final = 10
MIN_PAIRS: Final = 3  # fewer have no spread worth the name
MOST_PAIRS: Final = 1000  # nobody runs more; a mean that these would not prove is not worth proving
INTERVAL: Final = 0.95


@dataclass(frozen=True, slots=True)
class Effect:
    """The mean change of one figure over its pairs, as natural logarithms of the ratio after to before."""

    mean: float
    low: float  # the interval that holds the true mean in 95 cases of 100; minus and plus infinity below three pairs
    high: float
    p_worse: float  # probability of a mean at least this high if the change only shuffles; 1 below three pairs


def effect_of(log_ratios: FloatArray) -> Effect:
    """Estimate the mean of the log-ratios (N,) and the probability that it is chance."""
    pairs, mean = len(log_ratios), float(np.mean(log_ratios))
    if pairs < MIN_PAIRS:
        return Effect(mean, -np.inf, np.inf, 1.0)
    spreads, freedoms = _spreads(float(np.std(log_ratios, ddof=1)), np.array([float(pairs)]))
    errors = spreads[:, 0] / np.sqrt(pairs)
    p_worse = stdtr(freedoms[:, 0], -mean / errors)
    telling = int(np.argmin(p_worse))
    half = float(stdtrit(freedoms[telling, 0], 0.5 + 0.5 * INTERVAL) * errors[telling])
    return Effect(mean, mean - half, mean + half, min(1.0, 2.0 * float(p_worse[telling])))


def pairs_needed(log_ratios: FloatArray, figures: int) -> int | None:
    """How many pairs would prove the mean of the log-ratios (N,) worse, if it and the spread stay as they are.

    Args:
        log_ratios: The pairs that there are; their mean is above zero.
        figures: Number of figures that the probability is corrected for.

    Returns:
        The least number above N, at least three; None if more than ``MOST_PAIRS``.
    """
    mean = float(np.mean(log_ratios))
    spread = float(np.std(log_ratios, ddof=1)) if len(log_ratios) > 1 else HARMLESS_SPREAD
    counts = np.arange(max(MIN_PAIRS, len(log_ratios) + 1.0), MOST_PAIRS + 1.0)
    spreads, freedoms = _spreads(spread, counts)
    p_worse = 2.0 * stdtr(freedoms, -mean / (spreads / np.sqrt(counts))).min(axis=0)
    enough = np.flatnonzero(p_worse * figures < ALPHA)
    return int(counts[enough[0]]) if len(enough) else None


def corrected(p_values: Sequence[float]) -> list[float]:
    """The probabilities, in the order given, corrected by Hochberg for their number.

    Like Holm's correction it bounds the chance that any of them errs; unlike it, figures that all say the same support one
    another. It asks that they depend on one another positively, as errors of one map do, or not at all.
    """
    order = sorted(range(len(p_values)), key=lambda i: p_values[i], reverse=True)
    found, running = [1.0] * len(p_values), 1.0
    for rank, i in enumerate(order, start=1):
        running = min(running, rank * p_values[i])
        found[i] = running
    return found


def _spreads(own: float, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The spread of a pair and its degrees of freedom, each (2, C): from the pairs alone, and with the assumption."""
    alone = np.full(len(counts), max(own, REPEATABILITY))
    freedom = HARMLESS_PAIRS + counts - 1.0
    pooled = np.sqrt((HARMLESS_PAIRS * HARMLESS_SPREAD**2 + (counts - 1.0) * own**2) / freedom)
    return np.stack([alone, np.maximum(pooled, own)]), np.stack([counts - 1.0, freedom])
