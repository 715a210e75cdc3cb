"""What factors are made of: the unknowns of refinement mode ``route``, and whitened residuals with their Jacobians.

A unary factor depends on one keyframe, a binary factor on two of them and perhaps on the gyro.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Values of the unknowns."""

    poses: FloatArray  # (S, 3) network frame, m, m, rad
    log_scale: FloatArray  # (S,) ln(metres per map unit)
    gyro: FloatArray  # (2,) gain error g and bias b (rad/s): true turn = (1 + g) measured turn + b dt; (3,) with the slip (m)
    map_error_m: FloatArray | None = None  # (S, 2) drawn place of the road less its true one; None: the map is taken as exact

    @property
    def width(self) -> int:
        """Unknowns of each keyframe: 4, or 6 with the error of the map."""
        return 4 if self.map_error_m is None else 6

    @property
    def drawn_points_m(self) -> FloatArray:
        """The keyframes' points (S, 2) on the map as it is drawn: where they are, moved as the map is there."""
        points = self.poses[:, :2]
        return points if self.map_error_m is None else points + self.map_error_m


@dataclass(frozen=True, slots=True, eq=False)
class UnaryFactors:
    """N factors of M components, each on one keyframe: keyframe n for factor n."""

    residual: FloatArray  # (N, M) whitened, times the root of the weight
    jacobian: FloatArray  # (N, M, 4 or 6) by the keyframe's unknowns, likewise
    weight: FloatArray  # (N, M) robust weights


@dataclass(frozen=True, slots=True, eq=False)
class BinaryFactors:
    """N factors of M components between two keyframes, source and target."""

    residual: FloatArray  # (N, M) whitened, times the root of the weight
    source: FloatArray  # (N, M, 4 or 6) Jacobian by the source's unknowns, likewise
    target: FloatArray  # (N, M, 4 or 6) Jacobian by the target's unknowns
    gyro: FloatArray  # (N, M, 2 or 3) Jacobian by the gyro's gain error and bias, and the slip
    weight: FloatArray  # (N, M) robust weights


def normal_blocks(jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Contribution of each factor to the normal equations: J^T J (N, B, B) and -J^T r (N, B)."""
    return np.einsum("nmi,nmj->nij", jacobian, jacobian), -np.einsum("nmi,nm->ni", jacobian, residual)
