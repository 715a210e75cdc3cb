"""What the parts of the compiled search share: the rows that hold its hypotheses, and tuples in place of dataclasses.

A hypothesis on the network is (bin, scale bin) with two carried values: the heading offset between odometry and network, and
the part of the driven length that the bins could not express. One off the network keeps its index into the rows ``OFF`` as a
negative bin.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

# What the callers of a compiled function must keep in order; numba takes tuples, not dataclasses.
Tables: TypeAlias = tuple[Any, ...]  # reach_start, reach_bin, reach_m, reach_changes, bin heading, bin lane, bin points
Costs: TypeAlias = tuple[float, ...]  # heading sigma, its limit, gain, half a bin, length sigma, scale step and jump, lane change
OffNetwork: TypeAlias = tuple[Any, ...]  # see ``expand_off``; then leave (nats), per step (nats), spread (nats)
Moment: TypeAlias = tuple[float, ...]  # of a step: heading at its end, on its way, length; x, y, 1/sigma^2 of the known place
Rows: TypeAlias = NDArray[Any]  # of ROW
OffRows: TypeAlias = NDArray[Any]  # of OFF

NOWHERE = -math.inf  # nats of what leads nowhere

ROW = np.dtype(
    [
        ("bin", np.int32),  # -1 - index into the rows off the network: off the network
        ("k", np.int32),  # scale bin
        ("parent", np.int32),  # row of the step before
        ("score", np.float32),  # log likelihood so far, nats
        ("offset", np.float32),  # network heading minus odometry heading, rad
        ("rest", np.float32),  # driven length beyond the bin's centre, m
    ],
    align=True,
)
OFF = np.dtype([("x", np.float32), ("y", np.float32), ("away", np.float32)], align=True)  # place and metres driven since leaving


@njit(cache=True, error_model="numpy", inline="always")
def put(rows: Rows, at: int, bin_: int, k: int, parent: int, score: float, offset: float, rest: float) -> None:
    row = rows[at]
    row.bin, row.k, row.parent, row.score, row.offset, row.rest = bin_, k, parent, score, offset, rest


@njit(cache=True, error_model="numpy")
def with_room(rows: NDArray[Any], size: int) -> NDArray[Any]:
    """``rows`` itself if it holds ``size``, else a copy at least twice as long."""
    if size <= rows.shape[0]:
        return rows
    bigger = np.empty(max(size, 2 * rows.shape[0]), rows.dtype)
    bigger[: rows.shape[0]] = rows
    return bigger
