"""What the class of a method declares, found out in a process with limits: importing a module of others may do anything."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from hippodrome.eval.contest.loading import load_class, require_config
from hippodrome.eval.methods.method import ALIGNMENTS
from hippodrome.eval.methods.protocol import MethodError, Needs
from hippodrome.sim.method_spec import MethodSpec

# Functions of the protocol, and what each is called with.
FUNCTIONS: Final[dict[str, tuple[str, ...]]] = {
    "map": ("observations", "given"),
    "localize": ("observations", "given"),
    "describe": ("frame",),
    "warm_up": (),
}


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
        raise MethodError(
            f"method {label}: its needs are a {type(needs).__name__}; Needs(...) is expected, as Needs(camera=False)"
        )
    if not (builds_on is None or isinstance(builds_on, str)):
        raise MethodError(f"method {label}: builds_on is a {type(builds_on).__name__}; the key of a method is expected")
    own = str(getattr(cls, "label", cls.__name__))
    functions = tuple(name for name in FUNCTIONS if hasattr(cls, name))
    for name in functions:
        _require_function(cls, name, label)
    return Declared(own, str(getattr(cls, "frame", "own")), needs, builds_on, functions)


def _require_function(cls: type[Any], name: str, label: str) -> None:
    """Raise MethodError unless a class's function of the protocol can be called as the protocol calls it."""
    function, wanted = getattr(cls, name), FUNCTIONS[name]
    called = f"it is called as {name}({', '.join(wanted)})"
    if not callable(function):
        raise MethodError(f"method {label}: its {name} is a {type(function).__name__}, not a function; {called}")
    if inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function):
        raise MethodError(f"method {label}: its {name} is async, and nobody awaits it; write a plain function: {called}")
    if not inspect.isfunction(function) and not inspect.ismethod(function):
        return  # an object that can be called: what it takes it knows itself
    is_bound = inspect.ismethod(function) or isinstance(inspect.getattr_static(cls, name), staticmethod)
    try:
        inspect.signature(function).bind(*(wanted if is_bound else ("self", *wanted)))
    except TypeError:
        written = f"{name}({_as_written(inspect.signature(function).parameters.values())})"
        raise MethodError(f"method {label}: it has {written}, and {called}") from None


def _as_written(parameters: Iterable[inspect.Parameter]) -> str:
    """Parameters as they stand in a class, without their types."""
    return ", ".join(str(one.replace(annotation=inspect.Parameter.empty)) for one in parameters)[:120]


def require_as_declared(runner: Any, cls: type[Any], spec: MethodSpec, label: str) -> None:
    """Raise MethodError if an object was given another declaration in its constructor than its class has.

    The harness asks the class, before there is an object; what the constructor sets would count for nothing, without a word.
    """
    own = vars(runner) if hasattr(runner, "__dict__") else {}
    frame = own.get("frame")
    if isinstance(frame, str) and frame in ALIGNMENTS and frame not in (getattr(cls, "frame", "own"), spec.frame):
        _refuse_late("frame", f"'{frame}'", label)
    needs = own.get("needs")
    if isinstance(needs, Needs) and needs != getattr(cls, "needs", Needs()):
        _refuse_late("needs", needs.in_words(), label)
    builds_on = own.get("builds_on")
    if isinstance(builds_on, str) and builds_on != getattr(cls, "builds_on", None):
        _refuse_late("builds_on", f"'{builds_on}'", label)


def _refuse_late(name: str, value: str, label: str) -> NoReturn:
    raise MethodError(
        f"method {label}: its constructor sets {name} ({value}), which is too late: the class is asked; write it in the class, "
        f"as {name} = ... below the line that begins with class"
    )


def looked_at(reference: str, config: dict[str, Any], label: str) -> Declared:
    """The same of a class that is imported for it, once its configuration is found to fit. Raises MethodError."""
    cls = load_class(reference)
    require_config(cls, config, label)
    return declared_by(cls, label)
