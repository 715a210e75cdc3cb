"""The ego's path: from the lanes that SUMO drove to one smooth curve. The geometry is that of ``core/roads/paths.py``."""

from hippodrome.core.roads.paths import (
    MAX_CURVATURE_1PM,
    STEP_M,
    Path,
    Piece,
    centreline,
    piece_of_samples,
    piece_starts,
    sample_count,
    smooth_path,
)

__all__ = [
    "MAX_CURVATURE_1PM",
    "STEP_M",
    "Path",
    "Piece",
    "centreline",
    "piece_of_samples",
    "piece_starts",
    "sample_count",
    "smooth_path",
]
