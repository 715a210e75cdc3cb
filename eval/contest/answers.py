"""Answers of methods of others, looked at before anything is computed of them: what is no answer is the cause in the row."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from hippodrome.core.types import CognitiveMap, FloatArray, LocalizationEstimate, Trajectory
from hippodrome.eval.methods.protocol import Cost, Mapped, MethodError
from hippodrome.eval.metrics.association import MAX_COORDINATE, check_trajectory
from hippodrome.eval.results.model import Row
from hippodrome.sim.key_words import faults_of, place_of

# Figures of its map that a method may state itself; all other names of a row are ours to measure.
STATED: Final = ("camera_frames", "keyframes", "vertices", "edges")
MEASURED: Final = frozenset({*Row.model_fields, "closures", "lanes", "breaks"}) - set(STATED)
ASYMMETRY: Final = 1e-6  # of a covariance, as a share of its largest element: what rounding leaves


def sound_map(mapped: Mapped, label: str) -> Mapped:
    """What ``map`` gave, with its arrays as arrays of floats. Raises HippodromeError if it is not what the protocol has."""
    trajectory = _trajectory(mapped.trajectory, label)
    live = None if mapped.live is None else _trajectory(mapped.live, f"{label}: live")
    if not isinstance(mapped.cognitive_map, CognitiveMap | None):
        raise MethodError(f"{label}: its cognitive_map is {_kind(mapped.cognitive_map)}, not a CognitiveMap")
    return replace(
        mapped, trajectory=trajectory, live=live, figures=_figures(mapped.figures, label), cost=sound_cost(mapped.cost, label)
    )


def sound_cost(cost: Any, label: str) -> Cost | None:
    """What it says that it took. Raises MethodError if that is no cost."""
    if cost is None:
        return None
    if not isinstance(cost, Cost):
        raise MethodError(f"{label}: its cost is {_kind(cost)}, not a Cost")
    steps = [None if one is None else numbers(one, f"{label}: its cost") for one in (cost.step_s, cost.step_cpu_s)]
    held = () if cost.peak_rss_bytes is None else (cost.peak_rss_bytes,)
    for one in (*numbers((cost.cpu_s, cost.loading_cpu_s, *held), f"{label}: its cost"), *(s for s in steps if s is not None)):
        if not (np.isfinite(one).all() and np.all(one >= 0.0)):
            raise MethodError(f"{label}: its cost has numbers below zero, or that are not finite")
    return replace(cost, step_s=steps[0], step_cpu_s=steps[1])


def sound_estimates(estimates: Sequence[LocalizationEstimate], label: str) -> list[LocalizationEstimate]:
    """Answers of ``localize`` with plain numbers; where it is not localized, a pose that is none counts as zero.

    Raises:
        MethodError: An answer has no time, or it stands by a pose or a covariance that is none.
    """
    return [_sound(one, label) for one in estimates]


def _sound(one: LocalizationEstimate, label: str) -> LocalizationEstimate:
    if not isinstance(one.localized, bool | np.bool_ | int):
        raise MethodError(f"{label}: localize() gave {_kind(one.localized)} as 'localized'; True or False is expected")
    localized = bool(one.localized)
    t_s = float(_array(one.t_s, (), f"{label}: localize() gave a time"))
    where = f"{label}: localize() at t_s={t_s:g} gave"
    pose, covariance = _array(one.pose, (3,), f"{where} a pose"), _array(one.covariance, (3, 3), f"{where} a covariance")
    if not localized:
        pose, covariance = (_zero_unless_finite(part) for part in (pose, covariance))
    if not (np.abs(pose) <= MAX_COORDINATE).all():
        raise MethodError(f"{where} a pose that is not finite, or beyond {MAX_COORDINATE:g}, and stands by it")
    if not _is_covariance(covariance):
        raise MethodError(f"{where} a covariance that is none: finite, symmetric, no eigenvalue below zero; or None")
    return replace(one, t_s=t_s, pose=pose, covariance=covariance, localized=localized)


def _zero_unless_finite(values: FloatArray) -> FloatArray:
    return values if (np.abs(values) <= MAX_COORDINATE).all() else np.zeros_like(values)


def _is_covariance(matrix: FloatArray) -> bool:
    largest = np.abs(matrix).max()
    if not np.isfinite(largest) or (np.abs(matrix - matrix.T) > ASYMMETRY * largest).any():
        return False
    return bool(np.linalg.eigvalsh(matrix).min() >= -ASYMMETRY * largest)


def _trajectory(given: Any, label: str) -> Trajectory:
    if not isinstance(given, Trajectory):
        raise MethodError(f"{label}: its trajectory is {_kind(given)}, not a Trajectory")
    trajectory = Trajectory(*(numbers(part, f"{label}: its trajectory") for part in (given.t_s, given.poses)))
    check_trajectory(trajectory, label)
    return trajectory


def _figures(given: Any, label: str) -> dict[str, Any]:
    """Further fields of its row: numbers, texts, lists and dictionaries of them, under names that are not ours."""
    if not isinstance(given, dict) or not all(isinstance(name, str) and name.isidentifier() for name in given):
        raise MethodError(f"{label}: its figures are no dictionary from names to values")
    if ours := sorted(MEASURED & set(given)):
        raise MethodError(f"{label}: its figures have '{ours[0]}', which is measured here; give it another name")
    figures = {name: value.item() if isinstance(value, np.generic) else value for name, value in given.items()}
    for name, value in figures.items():
        try:
            json.dumps(value, allow_nan=False).encode()
        except (TypeError, ValueError, RecursionError):
            raise MethodError(f"{label}: its figure '{name}' is no finite number, text, list or dictionary of such") from None
    try:
        Row(method=label, **figures)
    except ValidationError as error:
        fault = faults_of(error, figures)[0]
        raise MethodError(f"{label}: its figure '{place_of(fault.location)}': {fault.words}") from None
    return figures


def _array(value: Any, shape: tuple[int, ...], what: str) -> FloatArray:
    found = numbers(value, what)
    if found.shape != shape:
        raise MethodError(f"{what} of shape {found.shape}; {shape} is expected")
    return found


def numbers(value: Any, what: str) -> FloatArray:
    """A value as an array of floats. Raises MethodError if it holds anything but real numbers."""
    try:
        found = np.asarray(value)
        if found.dtype == object:
            found = np.array([float(one) for one in found.ravel().tolist()]).reshape(found.shape)
        if found.dtype.kind in "fiu":
            return found.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError, RecursionError):
        pass
    raise MethodError(f"{what}: no real numbers, but {_kind(value)}")


def _kind(value: Any) -> str:
    """What a value is, in a word."""
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}"
    return "None" if value is None else f"a {type(value).__name__}"
