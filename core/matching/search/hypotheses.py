"""Rows of the compiled search: hypotheses, places off the network, and successors.

A hypothesis says that at one sample of the drive the vehicle is in one bin of the lane graph and that a map unit has so many
metres (scale bin). It carries two values besides: the heading offset between odometry and network, so that the map's rotation
does not matter, and the remainder of the driven length that whole bins could not express, so that lengths stay exact over any
number of bins.

A hypothesis off the network has no bin but a place, a row of ``PLACE``; its field ``bin`` holds -1 minus the index of that row.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

Hypothesis: TypeAlias = Any  # one row of HYPOTHESIS, as compiled functions take it
Hypotheses: TypeAlias = NDArray[Any]  # rows of HYPOTHESIS
Places: TypeAlias = NDArray[Any]  # rows of PLACE
Successors: TypeAlias = NDArray[Any]  # rows of SUCCESSOR

NOWHERE = -math.inf  # score in nats of a hypothesis that leads nowhere

HYPOTHESIS = np.dtype(
    [
        ("bin", np.int32),  # bin of the lane graph; -1 - index of its place if off the network
        ("scale_bin", np.int32),  # index of the scale, metres per map unit
        ("parent", np.int32),  # row of the hypothesis of the step before that it was reached from
        ("score_nats", np.float32),  # log likelihood of the best route to here
        ("heading_offset_rad", np.float32),  # network heading minus odometry heading
        ("remainder_m", np.float32),  # driven length beyond the bin's centre
    ],
    align=True,
)
PLACE = np.dtype(
    [
        ("x_m", np.float32),  # dead-reckoned place
        ("y_m", np.float32),
        ("driven_m", np.float32),  # metres driven since the network was left
    ],
    align=True,
)
SUCCESSOR = np.dtype(
    [
        ("bin", np.int32),
        ("scale_bin", np.int32),
        ("log_likelihood", np.float64),  # log likelihood in nats of the step that leads to this successor
        ("heading_offset_rad", np.float64),
        ("remainder_m", np.float64),
    ],
    align=True,
)


@njit(cache=True, error_model="numpy")
def index_of_best(hypotheses: Hypotheses) -> int:
    """The first of the hypotheses with the highest score; there must be one at least."""
    best = 0
    for i in range(hypotheses.shape[0]):
        best = i if hypotheses[i].score_nats > hypotheses[best].score_nats else best
    return best


@njit(cache=True, error_model="numpy")
def with_room(rows: NDArray[Any], size: int) -> NDArray[Any]:
    """``rows`` itself if it holds ``size`` rows, else a copy at least twice as long."""
    if size <= rows.shape[0]:
        return rows
    bigger = np.empty(max(size, 2 * rows.shape[0]), rows.dtype)
    bigger[: rows.shape[0]] = rows
    return bigger
