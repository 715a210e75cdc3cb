"""Classes of methods found by their names, and objects made of them; what the process in which a class runs begins with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.references import object_of, said

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
    """The settings as the class's ``Config``, if it has one. Raises MethodError if they do not fit."""
    own = getattr(cls, "Config", None)
    if not (isinstance(own, type) and issubclass(own, BaseModel)):
        return None
    try:
        return own.model_validate(config)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise MethodError(f"method {label}: config.{place}: {first['msg']}") from None
