"""Choosing edges of a map."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import Edges

BoolArray: TypeAlias = NDArray[np.bool_]


def edges_where(edges: Edges, kept: BoolArray) -> Edges:
    """The edges whose mask ``kept`` (E,) is true."""
    return Edges(
        source=edges.source[kept],
        target=edges.target[kept],
        motion=edges.motion[kept],
        sigma=edges.sigma[kept],
        kind=edges.kind[kept],
        margin=edges.margin[kept],
    )
