"""Limits for every number of a scenario, also of those that ``core`` declares, which knows nothing of scenarios.

A key that states its own limits keeps them. All others get limits here, from their name's last word and their default: no number
is nan or infinite, none is negative whose default is not, none is so large that its square overflows or its array fills the
memory. They are no advice: what lies within them may still be foolish.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final

from pydantic_core import CoreSchema, PydanticCustomError

# Names, or ends of names, of shares of a whole; and of what is divided by, or counts something that there must be.
SHARES: Final = ("share", "memory", "top", "bottom", "trimmed_share", "tolerance")
DIVISORS: Final = (
    "sigma", "sigma_m", "sigma_rad", "sigma_z_m", "beta_m", "sigma_floor", "period_m", "spacings", "bin_m", "bin",
    "step_m", "step_rad", "scale_step", "scale_m", "px", "bins", "coarse", "information", "radius_m", "robust_scale",
    "anneal", "horizon", "trust", "sketch_size", "candidates", "sample", "interval_s", "lever_m", "growth_step",
    "window", "truncation_m", "independent_m", "height_m", "scored_vertices", "neighbourhood", "kept", "prefix",
    "anchors", "survivors", "rounds", "iterations", "hypotheses",
)  # fmt: skip
LARGEST: Final = {  # by the last word of the name: a long motorway, a day, a turn and more
    "m": 1e6, "s": 1e5, "rad": 100.0, "deg": 360.0, "hz": 1e4, "mps": 400.0, "nats": 1e6, "px": 4096.0, "db": 200.0,
}  # fmt: skip
LARGEST_FACTOR: Final = 1e4  # a number without a unit may be so many times its default
SMALLEST_DIVISOR: Final = 1e4  # of what is divided by, the least is this part of the default: a finer grid fills the memory
LARGEST_COUNT_FACTOR: Final = 100  # and a whole one so many times: it is the size of something
ENDLESS: Final = ("bent_cost",)  # keys of which infinity switches something off, though their default is finite
CHECKED: Final = "refuses_truth_values"  # mark in the schema of a number that is done
ANGLES_OF_VIEW: Final = {"fov_deg": (20.0, 150.0)}  # as the scenario's camera


def limit_numbers(schema: CoreSchema, resolve: Callable[[Any], Any]) -> None:
    """Give each number in pydantic's schema of a model or dataclass its limits, in place.

    Args:
        schema: The schema, as pydantic made it.
        resolve: Answers a reference to another schema with that schema.
    """
    for name, default, number in _numbers(schema, resolve, "", None, set()):
        if number["type"] == "float":
            number["allow_inf_nan"] = endless = _unlimited(default) or name in ENDLESS
            default = math.inf if endless else default
        low, high = _limits(name, default, number["type"] == "int")
        if not {"ge", "gt"} & set(number):
            number["ge"] = low
        if not {"le", "lt"} & set(number):
            number["le"] = high
    refuse_truth_values(schema, resolve)


def refuse_truth_values(schema: CoreSchema, resolve: Callable[[Any], Any]) -> None:
    """Let no number in pydantic's schema be given as true or false, which pydantic would take for 1 and 0; in place.

    Args:
        schema: The schema, as pydantic made it.
        resolve: Answers a reference to another schema with that schema.
    """
    for _, _, number in list(_numbers(schema, resolve, "", None, set())):
        if number.get("metadata", {}).get(CHECKED):
            continue
        inner = {**number, "metadata": {CHECKED: True}}
        check = _no_truth_value if number["type"] == "float" else _no_truth_value_but_whole
        number.clear()
        number.update({"type": "function-before", "function": {"type": "no-info", "function": check}, "schema": inner})


def _no_truth_value(given: Any) -> Any:
    if isinstance(given, bool):
        raise PydanticCustomError("float_type", "must be a number")
    return given


def _no_truth_value_but_whole(given: Any) -> Any:
    if isinstance(given, bool):
        raise PydanticCustomError("int_type", "must be a whole number")
    return given


def _numbers(
    schema: Any, resolve: Callable[[Any], Any], name: str, default: Any, seen: set[int]
) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Each schema of a float or whole number, with the name of its key and its default."""
    if id(schema) in seen:
        return
    seen.add(id(schema))
    kind = schema["type"]
    if kind in ("float", "int"):
        yield name, default, schema
    elif kind == "definition-ref":
        yield from _numbers(resolve(schema), resolve, name, default, seen)
    elif kind == "model-fields":
        for key, field in schema["fields"].items():
            yield from _numbers(field["schema"], resolve, key, None, seen)
    elif kind == "dataclass-args":
        for field in schema["fields"]:
            yield from _numbers(field["schema"], resolve, field["name"], None, seen)
    elif kind == "union":
        for choice in schema["choices"]:
            yield from _numbers(choice[0] if isinstance(choice, tuple) else choice, resolve, name, default, seen)
    elif kind in ("tuple", "list"):
        items = schema.get("items_schema") or ()
        for place, item in enumerate(items if isinstance(items, list) else [items]):
            several = isinstance(default, tuple) and len(default) > place
            yield from _numbers(item, resolve, name, _hardest(default, place) if several else None, seen)
    elif kind == "dict":
        yield from _numbers(schema.get("values_schema", {"type": "any"}), resolve, name, None, seen)
    elif "schema" in schema:  # a default, None or a value, a check before or after, the model around its fields
        yield from _numbers(schema["schema"], resolve, name, schema.get("default", default), seen)


def _hardest(defaults: tuple[Any, ...], place: int) -> Any:
    """The default that the limits of one item are made from: infinity where any of them is infinite."""
    return math.inf if any(_unlimited(one) for one in defaults) else defaults[place]


def _unlimited(default: Any) -> bool:
    return isinstance(default, float) and math.isinf(default)


def _limits(name: str, default: Any, whole: bool) -> tuple[float, float]:
    """The least value of a key, and the largest."""
    if name in ANGLES_OF_VIEW:
        return ANGLES_OF_VIEW[name]
    usual = abs(float(default)) if isinstance(default, int | float) and not _unlimited(default) else 1.0
    high = LARGEST.get(name.rpartition("_")[2], LARGEST_FACTOR * max(usual, 1.0))
    if whole:
        high = min(high, LARGEST_COUNT_FACTOR * max(usual, 10.0))
    if _unlimited(default):
        high = math.inf
    if _ends(name, SHARES):
        high = 1.0
    if isinstance(default, int | float) and default < 0:
        return -high, high
    divides = _ends(name, DIVISORS) and default != 0
    if whole:
        return (1 if divides else 0), int(high)
    return (usual / SMALLEST_DIVISOR if divides else 0.0), high


def _ends(name: str, words: tuple[str, ...]) -> bool:
    return any(name == word or name.endswith(f"_{word}") for word in words)
