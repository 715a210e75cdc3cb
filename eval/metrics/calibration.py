"""Whether stated covariances are true: normalised estimation error squared."""

from __future__ import annotations

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray
from hippodrome.eval.metrics.trajectory import MetricError


def pose_errors(estimate: FloatArray, reference: FloatArray) -> FloatArray:
    """Estimate minus reference (N, 3) in the network frame: m, m, rad in (-pi, pi]."""
    difference = np.asarray(estimate - reference, dtype=np.float64)
    return np.column_stack([difference[:, :2], se2.wrap(difference[:, 2])])


def nees(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """``e^T P^-1 e`` (N,) of errors (N, K) under covariances (N, K, K): chi-squared with K degrees of freedom if P is true."""
    try:
        np.linalg.cholesky(covariances)
        weighted = np.linalg.solve(covariances, errors[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError as error:
        raise MetricError(f"NEES needs positive definite covariances, one of {len(covariances)} is not") from error
    values: FloatArray = np.einsum("nk,nk->n", errors, weighted)
    return values


def mean_nees(errors: FloatArray, covariances: FloatArray) -> float:
    """Mean NEES per dimension: 1 if calibrated, above 1 if overconfident."""
    if len(errors) == 0:
        raise MetricError("NEES of no errors")
    return float(nees(errors, covariances).mean() / errors.shape[1])
