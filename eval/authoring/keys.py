"""Every key of a scenario with its meaning, read from the models themselves: each is declared, and explained, in one place."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import tokenize
import typing
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel

from hippodrome.eval.authoring.meanings import MEANINGS
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import SelfMotionNoise

SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}


@dataclasses.dataclass(frozen=True, slots=True)
class Key:
    """One key of a scenario."""

    path: tuple[str, ...]  # its place in the file, from the outermost key
    kind: str  # what it takes, in words
    default: Any  # its value where it is left out
    limits: str  # limits of a number, in signs; empty: none
    meaning: str

    @property
    def name(self) -> str:
        """The key as people write it, ``mapping.tour.length_m``."""
        return ".".join(self.path)


@lru_cache(maxsize=1)
def scenario_keys() -> tuple[Key, ...]:
    """All keys that hold values, in the order of the models."""
    return tuple(_keys(Scenario, (), Scenario(name="name").model_dump(mode="json")))


@lru_cache(maxsize=1)
def noise_keys() -> tuple[Key, ...]:
    """The keys that ``noise`` has when it is no level's name."""
    return tuple(_keys(SelfMotionNoise, ("noise",), {"noise": None}))


def is_model(kind: Any) -> bool:
    """Whether a type has keys of its own."""
    return isinstance(kind, type) and (issubclass(kind, BaseModel) or dataclasses.is_dataclass(kind))


def models(model: type) -> tuple[type, ...]:
    """The model itself and all models that its fields hold, each once."""
    inner = [found for _, kind, _ in fields_of(model) if is_model(kind) for found in models(kind)]
    return tuple(dict.fromkeys([model, *inner]))


def meanings(model: type) -> dict[str, str]:
    """What each field means: its comment, or its entry in ``MEANINGS``."""
    return {name: comment or MEANINGS.get(f"{model.__name__}.{name}", "") for name, comment in comments(model).items()}


@lru_cache(maxsize=256)
def comments(model: type) -> dict[str, str]:
    """What each field's comment says: the text after ``#`` on the lines of its declaration. Inherited fields come first."""
    parents = [parent for parent in model.__bases__ if dataclasses.is_dataclass(parent)]
    inherited = {name: comment for parent in parents for name, comment in comments(parent).items()}
    lines, first = inspect.getsourcelines(model)
    source = inspect.cleandoc("".join(lines)) if lines[0].startswith(" ") else "".join(lines)
    words: dict[int, str] = {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            words[token.start[0]] = token.string.lstrip("# ").removeprefix("fmt: skip").strip()
    (body,) = ast.parse(source).body
    assert isinstance(body, ast.ClassDef), f"{model} at line {first}"
    fields = [node for node in body.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)]
    return inherited | {
        node.target.id: " ".join(filter(None, (words.get(line) for line in range(node.lineno, (node.end_lineno or 0) + 1))))
        for node in fields
        if isinstance(node.target, ast.Name)
    }


def fields_of(model: type) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    """Name, type and constraints of each field."""
    if issubclass(model, BaseModel):
        for name, info in model.model_fields.items():
            yield name, info.annotation, (*info.metadata, *_inner_constraints(info.annotation))
    else:
        hints = typing.get_type_hints(model)
        for field in dataclasses.fields(model):  # type: ignore[arg-type]
            yield field.name, hints[field.name], ()


def _keys(model: type, path: tuple[str, ...], defaults: Any) -> Iterator[Key]:
    words = meanings(model)
    for name, annotation, constraints in fields_of(model):
        default = defaults.get(name) if isinstance(defaults, dict) else None
        if is_model(annotation):
            yield from _keys(annotation, (*path, name), default)
        else:
            yield Key((*path, name), _kind(annotation), default, _limits(constraints), words.get(name, ""))


def _inner_constraints(annotation: Any) -> tuple[Any, ...]:
    """Constraints of the parts of a type: those of ``Annotated[float, Field(gt=0)] | None`` sit inside its first part."""
    inside = (getattr(part, "__metadata__", ()) for part in get_args(annotation))
    infos = [info for metadata in inside for info in metadata]
    return tuple(rule for info in infos for rule in getattr(info, "metadata", (info,)))


def _kind(annotation: Any) -> str:
    """A type in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return " or ".join(str(part) for part in parts)
    if origin is typing.Annotated:
        return _kind(parts[0])
    if origin in (tuple, list):
        return f"list of {_kind(parts[0])}"
    if parts:
        return " or ".join(_kind(part) for part in parts)
    words = {int: "integer", float: "number", str: "text", bool: "true or false", type(None): "null"}
    return words.get(annotation, "mapping" if is_model(annotation) else "path" if "Path" in str(annotation) else str(annotation))


def _limits(constraints: tuple[Any, ...]) -> str:
    """Constraints in signs: "> 0, ≤ 5"."""
    found = [
        f"{sign} {_plain(getattr(rule, name))}" for rule in constraints for name, sign in SIGNS.items() if hasattr(rule, name)
    ]
    return ", ".join(dict.fromkeys(found))


def _plain(limit: float) -> str:
    """A limit without an exponent, as people write it."""
    return f"{limit:,.0f}" if limit == int(limit) else f"{limit:g}"
