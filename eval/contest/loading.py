"""Classes of methods found by their names, and objects made of them; what the process in which a class runs begins with."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.references import object_of, said
from hippodrome.sim.key_names import unread_key
from hippodrome.sim.key_words import faults_of, place_of, unknown_words

if TYPE_CHECKING:
    from hippodrome.sim.scenario import Scenario


def load_class(reference: str) -> type[Any]:
    """The class of ``module:Class``; the working directory is searched as well. Raises MethodError."""
    try:
        found = object_of(reference)
    except HippodromeError as error:
        raise MethodError(f"method {reference}: {error}") from error
    if not isinstance(found, type):
        raise MethodError(f"method {reference}: that is a {type(found).__name__}, not a class")
    return found


def made_of(cls: type[Any], config: dict[str, Any], scenario: Scenario | None, label: str) -> Any:
    """An object of a method's class: from the whole scenario (ours alone), from a configuration of its own, or from nothing."""
    try:
        if scenario is not None and hasattr(cls, "of_scenario"):
            return cls.of_scenario(scenario)
        return cls(**config) if (settings := require_config(cls, config, label)) is None else cls(settings)
    except HippodromeError:
        raise
    except Exception as error:
        raise MethodError(f"method {label}: it cannot be made: {said(error)}") from error


def require_config(cls: type[Any], config: dict[str, Any], label: str) -> BaseModel | None:
    """The settings as the class's ``Config``, if it has one. Raises MethodError if one does not fit."""
    own = getattr(cls, "Config", None)
    if not (isinstance(own, type) and issubclass(own, BaseModel)):
        _require_keywords(cls, config, label)
        return None
    try:
        settings = own.model_validate(config)
    except ValidationError as error:
        fault = faults_of(error, config, own)[0]
        raise MethodError(f"method {label}: {_of_config(*fault.location)}: {fault.words}") from None
    except Exception as error:  # its own validators may raise anything
        raise MethodError(f"method {label}: config: its Config cannot be made: {said(error)}") from error
    if (unread := unread_key(own, config)) is not None:
        raise MethodError(f"method {label}: {_of_config(*unread)}: {unknown_words(unread, own)}")
    _require_one_argument(cls, settings, label)
    return settings


def _of_config(*location: int | str) -> str:
    return place_of(("config", *location))


def _require_keywords(cls: type[Any], config: dict[str, Any], label: str) -> None:
    """Raise MethodError if settings are no arguments of the constructor, or one that it must have is not among them."""
    if (signature := _signature(cls)) is None:
        return
    kinds = inspect.Parameter
    named = {
        name: one for name, one in signature.parameters.items() if one.kind in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY)
    }
    takes_any = any(one.kind is kinds.VAR_KEYWORD for one in signature.parameters.values())
    for name in config:
        if name not in named and not takes_any:
            known = f"there are {', '.join(named)}" if named else "the class has no Config, and its constructor takes nothing"
            raise MethodError(f"method {label}: {_of_config(name)}: unknown setting; {known}")
    for name, one in named.items():
        if one.default is kinds.empty and name not in config:
            cure = "set it there, or give it a default in the constructor"
            raise MethodError(f"method {label}: {_of_config(name)}: must be given, as the constructor asks for it; {cure}")


def _require_one_argument(cls: type[Any], settings: BaseModel, label: str) -> None:
    """Raise MethodError if the constructor cannot be called with the settings alone."""
    if (signature := _signature(cls)) is None:
        return
    try:
        signature.bind(settings)
    except TypeError:
        written = f"def __init__(self{''.join(f', {one}' for one in signature.parameters.values())})"
        raise MethodError(
            f"method {label}: the class has a Config, so that its constructor is called with one: def __init__(self, config); "
            f"its own is {written[:120]}"
        ) from None


def _signature(cls: type[Any]) -> inspect.Signature | None:
    """What the constructor of a class takes; None if that cannot be told."""
    try:
        return inspect.signature(cls)
    except (TypeError, ValueError):
        return None
