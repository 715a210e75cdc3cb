"""What Li et al. 2025 print in Tables I and II, cell by cell. Every derived figure is computed from these cells."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.eval.results.model import ErrorSummary, LocalizationSummary, Row

SOURCE: Final = "Li et al. 2025"
MEGABYTE: Final = 1_000_000  # bytes; the paper writes "M"

ORB_SLAM3: Final = "ORB-SLAM3 (Binocular)"
TOPOMETRIC: Final = "Topometric map (Mono, ours)"
SEMI_METRIC: Final = "Semi-metric map (Mono)"

# Table II, sequences 1 to 10, under the paper's names of the methods
SEQUENCE_LENGTH_M: Final = (372.7, 804.3, 170.0, 732.6, 812.7, 1485.3, 559.0, 294.2, 1423.9, 830.9)
INITIAL_TIME_MS: Final = {
    ORB_SLAM3: (794.0, 1058.0, 1077.0, 978.0, 1104.0, 1171.0, 1176.0, 894.0, 993.0, 1064.0),
    TOPOMETRIC: (1.54, 0.13, 0.65, 0.15, 2.02, 0.28, 0.12, 0.25, 0.21, 0.18),
}
LOCALIZATION_ERROR_M: Final = {
    ORB_SLAM3: (2.82, 4.77, 3.69, 4.03, 4.85, 5.22, 6.29, 4.86, 5.29, 4.5),
    TOPOMETRIC: (4.03, 3.74, 5.19, 3.59, 3.56, 6.33, 3.65, 4.8, 4.63, 3.89),
}


def quoted_rows() -> tuple[Row, ...]:
    """The rows of Table I as printed, with the means over the ten sequences of Table II."""
    return (
        _quoted(SEMI_METRIC, 1.3, 56.1, 121.2, 9.4, vertices=1417, edges=1567),
        _quoted(ORB_SLAM3, 40.57, 259.0, 3.86, 0.96, camera_frames=14717, keyframes=715),
        _quoted(TOPOMETRIC, 1.3, 56.1, 3.6, 1.4, vertices=1417, edges=1567),
    )


def _quoted(method: str, cpu_percent: float, map_mb: float, ape_m: float, rpe_m: float, **counts: int) -> Row:
    return Row(
        method=method,
        quoted=True,
        cpu_percent=cpu_percent,
        map_bytes=round(map_mb * MEGABYTE),
        ape=ErrorSummary(definition=f"quoted, {SOURCE}, Table I: APE, alignment not stated", mean_m=ape_m),
        rpe=ErrorSummary(definition=f"quoted, {SOURCE}, Table I: RPE, consecutive vertices, delta not stated", mean_m=rpe_m),
        localization=_quoted_localization(method) if method in INITIAL_TIME_MS else None,
        **counts,
    )


def _quoted_localization(method: str) -> LocalizationSummary:
    return LocalizationSummary(
        definition=f"quoted, {SOURCE}, Table II: mean of the ten sequences",
        error_mean_m=float(np.mean(LOCALIZATION_ERROR_M[method])),
        initial_time_ms=float(np.mean(INITIAL_TIME_MS[method])),
    )
