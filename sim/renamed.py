"""Keys and values of scenarios that have been renamed or removed: files that use the old names go on working.

A removed key has no effect any more: it is left out, and a note says so and why.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, Final

NETWORKS: Final = ("mapper.attractor.head", "mapper.attractor.grid", "localizer.head", "localizer.grid")
KEYS: Final = {"refine.default": "refine.route"}  # old: new, dotted as in docs/scenarios.md
VALUES: Final[dict[str, dict[str, str]]] = {  # by the key's new name
    "refine.mode": {"default": "route"},
    "localizer.mode": {"default": "coupled"},
    **{f"{network}.mode": {"default": "bounded"} for network in NETWORKS},
}
ENDLESS: Final = ("refine.route.solver.along_sigma_m", "refine.paper.bent_cost")  # scenario.json has null for their infinity
REMOVED: Final = {  # by the key's present name, why it is gone
    f"refine.route.confidence.{name}": "a route is now held against the mirrored drive, see docs/algorithms.md"
    for name in ("turning_nats", "evidence_growth_nats")
}


def present_key(key: str) -> str:
    """A dotted key by its present name."""
    for old, new in KEYS.items():
        if key == old or key.startswith(f"{old}."):
            return new + key.removeprefix(old)
    return key


def present_value(key: str, value: Any) -> Any:
    """A value of ``key`` (its present name) by the value's present name."""
    return VALUES.get(key, {}).get(value, value) if isinstance(value, str) else value


def with_present_names(scenario: Any) -> Any:
    """A scenario as plain data, old names replaced and removed keys left out, which a note on stderr tells.

    Where the old and the new name of a key stand side by side, both stay.
    """
    for old, new in KEYS.items():
        (*parents, last), present = old.split("."), new.rpartition(".")[2]
        scenario = _changed(scenario, parents, partial(_renamed, last, present))
    for key in VALUES:
        scenario = _changed(scenario, key.split("."), partial(present_value, key))
    for key in ENDLESS:
        scenario = _changed(scenario, key.split("."), _endless)
    for key in REMOVED:
        *parents, last = key.split(".")
        scenario = _changed(scenario, parents, partial(_without, last, key))
    return scenario


def _changed(data: Any, path: Sequence[str], change: Callable[[Any], Any]) -> Any:
    """A copy of ``data`` in which ``change`` was made at ``path``; ``data`` itself where there is no such place."""
    if not path:
        return change(data)
    if not isinstance(data, dict) or path[0] not in data:
        return data
    return {**data, path[0]: _changed(data[path[0]], path[1:], change)}


def _renamed(old: str, new: str, data: Any) -> Any:
    if not isinstance(data, dict) or new in data:
        return data
    return {new if name == old else name: value for name, value in data.items()}


def _endless(value: Any) -> Any:
    """A number, or numbers, of which JSON had null where there was infinity."""
    if isinstance(value, list | tuple):
        return [_endless(one) for one in value]
    return math.inf if value is None else value


def _without(name: str, key: str, data: Any) -> Any:
    if not isinstance(data, dict) or name not in data:
        return data
    _tell_removed(key)
    return {other: value for other, value in data.items() if other != name}


@cache
def _tell_removed(key: str) -> None:
    """Say once that a key has no effect."""
    print(f"note: {key} has no effect any more and is ignored: {REMOVED[key]}", file=sys.stderr)
