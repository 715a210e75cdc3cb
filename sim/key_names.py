"""The keys that a model has at a place of a file, found in the types of its fields: an error says which may be meant."""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final

from pydantic import AliasChoices, AliasPath, BaseModel

DEEPEST: Final = 12  # levels of keys that are searched for a key at another place
ALIKE: Final = 0.6  # share of letters from which on a key of the same place may be meant
MORE_ALIKE: Final = 0.85  # and one of another place
Path = tuple[str, ...]


def names_at(model: Any, location: Sequence[int | str]) -> list[str]:
    """The names of the keys that a model has at a place; none where the model is unknown, or the place takes any key."""
    kinds = _concrete(model)
    for part in location:
        kinds = [inner for kind in kinds for found in _inside(kind, part) for inner in _concrete(found)]
    return list(dict.fromkeys(name for kind in kinds for name, _ in _fields(kind)))


def path_meant(model: Any, location: Sequence[int | str]) -> tuple[int | str, ...] | None:
    """The place of the key that may be meant by an unknown one: one that is alike, here or elsewhere; None: there is none."""
    *parents, last = location
    if near := difflib.get_close_matches(str(last), names_at(model, parents), n=1, cutoff=ALIKE):
        return (*parents, near[0])
    paths = _all_paths(model) if isinstance(model, type) else ()
    near = difflib.get_close_matches(str(last), sorted({path[-1] for path in paths}), n=1, cutoff=MORE_ALIKE)
    found = [path for path in paths if near and path[-1] == near[0]]
    return min(found, key=lambda path: (-_shared(path, parents), len(path)), default=None)


def unread_key(model: Any, data: Any, above: Sequence[int | str] = ()) -> tuple[int | str, ...] | None:
    """The place of the first key of ``data`` that a model would pass over without a word; None: there is none.

    A model that allows keys, forbids them or ignores them on purpose has said so; one that changes its input first reads it in a
    way of its own.
    """
    if not (isinstance(model, type) and issubclass(model, BaseModel) and isinstance(data, Mapping)):
        return None
    changes = any(one.info.mode != "after" for one in model.__pydantic_decorators__.model_validators.values())
    fields = _fields(model)
    known = {name for name, _ in fields} | set(model.model_fields)
    for key, value in data.items():
        if key not in known and model.model_config.get("extra") is None and not changes:
            return (*above, key)
        for _, kind in (field for field in fields if field[0] == key):
            concrete = _concrete(kind)
            if len(concrete) == 1 and (found := unread_key(concrete[0], value, (*above, key))) is not None:
                return found
    return None


def _shared(path: Sequence[str], parents: Sequence[int | str]) -> int:
    """How many parts two places have in common from the outermost on."""
    return next((number for number, pair in enumerate(zip(path, parents, strict=False)) if pair[0] != pair[1]), len(parents))


@lru_cache(maxsize=64)
def _all_paths(model: type) -> tuple[Path, ...]:
    """The places of all keys of a model."""
    return tuple(_paths(model, ()))


def _paths(kind: Any, above: Path) -> Iterator[Path]:
    """The places of all keys below a model, those that hold further keys too."""
    if len(above) < DEEPEST:
        for concrete in _concrete(kind):
            for name, inner in _fields(concrete):
                yield (*above, name)
                yield from _paths(inner, (*above, name))


def _concrete(kind: Any) -> list[Any]:
    """The kinds that a type stands for: the members of a union, each without what ``Annotated`` adds."""
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        return _concrete(typing.get_args(kind)[0])
    if origin in (typing.Union, types.UnionType):
        return [one for part in typing.get_args(kind) for one in _concrete(part)]
    return [kind]


def _inside(kind: Any, part: int | str) -> list[Any]:
    """What kinds a value may have that lies under a key, or at a number, of a value of a kind."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(origin, type) and issubclass(origin, Mapping) and len(parts) == 2:
        return [parts[1]]
    if origin in (tuple, list, Sequence) and parts and isinstance(part, int):
        return [parts[min(part, len(parts) - 1)] if parts[-1] is not ... else parts[0]]
    return [inner for name, inner in _fields(kind) if name == part]


@lru_cache(maxsize=512)
def _fields_of_class(kind: type) -> tuple[tuple[str, Any], ...]:
    """Name in the file, and type, of each field of a model or dataclass."""
    if issubclass(kind, BaseModel):
        return tuple((name, field.annotation) for key, field in kind.model_fields.items() for name in _names(key, field))
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind, include_extras=True)
        return tuple((field.name, hints[field.name]) for field in dataclasses.fields(kind) if field.init)
    return ()


def _names(key: str, field: Any) -> list[str]:
    """The names by which a file may give a field of a model: its aliases, or its own."""
    alias = field.validation_alias or field.alias
    choices = alias.choices if isinstance(alias, AliasChoices) else [alias] if alias is not None else [key]
    return [str(one.path[0]) if isinstance(one, AliasPath) else one for one in choices]


def _fields(kind: Any) -> tuple[tuple[str, Any], ...]:
    return _fields_of_class(kind) if isinstance(kind, type) else ()
