"""What the class of a method declares, found out in a process with limits: importing a module of others may do anything."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from hippodrome.eval.contest.loading import load_class, require_config
from hippodrome.eval.methods.protocol import MethodError, Needs

FUNCTIONS: Final = ("map", "localize", "describe", "warm_up")  # of the protocol


@dataclass(frozen=True, slots=True)
class Declared:
    """What a class says of itself."""

    label: str  # its name in the tables, unless it is given another
    frame: str
    needs: Needs
    builds_on: str | None
    functions: tuple[str, ...]  # those of ``FUNCTIONS`` that it has


def declared_by(cls: type[Any], label: str) -> Declared:
    """What a class declares. Raises MethodError, with the method's label, if that is not what the protocol has."""
    needs, builds_on = getattr(cls, "needs", Needs()), getattr(cls, "builds_on", None)
    if not isinstance(needs, Needs):
        raise MethodError(f"method {label}: its needs are a {type(needs).__name__}, not a hippodrome Needs")
    if not (builds_on is None or isinstance(builds_on, str)):
        raise MethodError(f"method {label}: builds_on is a {type(builds_on).__name__}; the key of a method is expected")
    own = str(getattr(cls, "label", cls.__name__))
    functions = tuple(name for name in FUNCTIONS if hasattr(cls, name))
    return Declared(own, str(getattr(cls, "frame", "own")), needs, builds_on, functions)


def looked_at(reference: str, config: dict[str, Any], label: str) -> Declared:
    """The same of a class that is imported for it, once its configuration is found to fit. Raises MethodError."""
    cls = load_class(reference)
    require_config(cls, config, label)
    return declared_by(cls, label)
