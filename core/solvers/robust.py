"""Robust weights for iteratively reweighted least squares: an outlier keeps its residual but loses its say.

A robust loss rho(r) of a whitened residual r (sigma 1) is minimised by repeated weighted least squares with w(r) = rho'(r) / r.
"""

from __future__ import annotations

from hippodrome.core.types import FloatArray


def geman_mcclure_weight(sq_residual: FloatArray, sq_scale: float) -> FloatArray:
    """Weights of the Geman-McClure loss: w = (c^2 / (r^2 + c^2))^2, with c^2 = ``sq_scale`` and r^2 = ``sq_residual``.

    1 for a residual of 0, a quarter at r = c, and towards 0 beyond, so that a gross outlier is as good as removed.
    Source: Geman and McClure 1987; in this form Yang et al. 2020, "Graduated Non-Convexity for Robust Spatial Perception".
    """
    weight: FloatArray = (sq_scale / (sq_residual + sq_scale)) ** 2
    return weight


def student_weight(sq_residual: FloatArray, inverse_freedom: float) -> FloatArray:
    """Weights of a Student-t likelihood: w = (nu + 1) / (nu + r^2), written with 1 / nu so that 0 means the normal distribution.

    Args:
        sq_residual: squares of whitened residuals, any shape.
        inverse_freedom: 1 / nu, nu being the degrees of freedom: 0 gives weights of 1, 1 is the Cauchy distribution.

    Returns:
        Weights of the same shape. Unlike Geman-McClure's they exceed 1 for residuals below one sigma.
        Source: Lange, Little, Taylor 1989, "Robust statistical modeling using the t distribution".
    """
    weight: FloatArray = (1.0 + inverse_freedom) / (1.0 + inverse_freedom * sq_residual)
    return weight
