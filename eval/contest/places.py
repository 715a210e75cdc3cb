"""Methods that only describe frames, run on both drives: frames in, vectors out; their poses stay with the harness."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, Final

import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.eval.contest.answers import numbers
from hippodrome.eval.methods.materials import Materials
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.metrics.places import PlaceScore, score_places
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.sim.recording import Recording

PLACE_M: Final = 2.0  # between two frames of the first drive: as dense as a map's views are at most
MAX_NUMBER: Final = 1e100  # in a vector: the squares of more overflow
QUERY_M: Final = 5.0  # between two frames of the second drive


def recognise(
    label: str, describe: Callable[[Frame], Any], materials: Materials, clock: Callable[[], float]
) -> tuple[PlaceScore, float, FloatArray]:
    """The score of a descriptor, the CPU seconds that it took by its ``clock``, and the seconds (N,) for each frame.

    Raises:
        MethodError: It gives no vectors of finite numbers, all of one length.
    """
    began_s = clock()
    places, place_poses_m, place_s = _described(label, describe, materials.mapping, PLACE_M)
    queries, query_poses_m, query_s = _described(label, describe, materials.drive, QUERY_M)
    if places.shape[1] != queries.shape[1]:
        raise MethodError(f"{label}: describe() gave {places.shape[1]} numbers, and later {queries.shape[1]}")
    score = score_places(places, place_poses_m, queries, query_poses_m)
    return score, clock() - began_s, np.concatenate([place_s, query_s])


def _described(
    label: str, describe: Callable[[Frame], Any], drive: Recording, spacing_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Descriptors (N, D), true poses (N, 3) and times (N,) of the first frame in each stretch of a drive."""
    steps = drive.samples.frame_steps
    stretch = np.floor(path_length_m(drive.samples.poses_m)[steps] / spacing_m)
    chosen = steps[np.concatenate([[True], np.diff(stretch) > 0])]
    vectors: list[FloatArray] = []
    took_s = []
    for step in chosen:
        frame = drive.frame(int(drive.samples.frame[step]))
        began = perf_counter()
        vector = describe(frame)
        took_s.append(perf_counter() - began)
        vectors.append(vector_of(vector, vectors[0] if vectors else None, label))
    return np.array(vectors), drive.samples.poses_m[chosen], np.array(took_s)


def vector_of(given: Any, first: FloatArray | None, label: str) -> FloatArray:
    """What ``describe`` gave, as a vector (D,) as long as the ``first`` one. Raises MethodError if it is none."""
    vector = numbers(given, f"{label}: describe()'s vector").ravel()
    if len(vector) == 0 or (first is not None and len(vector) != len(first)):
        sizes = f"{len(vector)} numbers" + ("" if first is None else f", {len(first)} at first")
        raise MethodError(f"{label}: describe() gave {sizes}; as many are expected for every frame, one at least")
    if not (np.abs(vector) <= MAX_NUMBER).all():
        raise MethodError(f"{label}: describe() gave a number that is not finite, or beyond {MAX_NUMBER:g}")
    return vector
