"""Whether stated covariances are true: the normalised estimation error squared (NEES), Bar-Shalom et al. 2001, Sec. 5.4."""

from __future__ import annotations

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray
from hippodrome.eval.metrics.trajectory import MetricError


def pose_errors(estimate: FloatArray, reference: FloatArray) -> FloatArray:
    """Estimated minus reference poses (N, 3) in the network's frame: m, m, rad in (-pi, pi]."""
    difference = np.asarray(estimate - reference, dtype=np.float64)
    return np.column_stack([difference[:, :2], se2.wrap(difference[:, 2])])


def nees(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """The NEES ``e^T P^-1 e`` of each error; it is chi-squared with K degrees of freedom if the covariances are true.

    Args:
        errors: Errors (N, K).
        covariances: Their stated covariances (N, K, K).

    Returns:
        The NEES (N,).

    Raises:
        MetricError: A covariance is not positive definite.
    """
    try:
        np.linalg.cholesky(covariances)
        weighted = np.linalg.solve(covariances, errors[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError as error:
        raise MetricError(f"NEES needs positive definite covariances, one of {len(covariances)} is not") from error
    values: FloatArray = np.einsum("nk,nk->n", errors, weighted)
    return values


def mean_nees(errors: FloatArray, covariances: FloatArray) -> float:
    """Mean NEES per dimension of errors (N, K) under covariances (N, K, K): 1 if calibrated, above 1 if overconfident.

    Raises:
        MetricError: There are no errors, or a covariance is not positive definite.
    """
    if len(errors) == 0:
        raise MetricError("NEES of no errors")
    return float(nees(errors, covariances).mean() / errors.shape[1])
