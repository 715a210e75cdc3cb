"""Which values of a file a model refuses: each with its place, in words for the file's author, and the key that may be meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hippodrome._output import one_line
from hippodrome.sim.key_names import names_at, path_meant
from hippodrome.sim.spec import Spec
from hippodrome.sim.value_words import LONGEST, MODEL_TYPES, MUST_BE, UNKNOWN_KEY, not_given, wanted_of, words_of

PLAIN_KINDS: Final = ("str", "int", "float", "bool", "path", "list", "dict")  # kinds that look like names of keys
OF_A_KEY: Final = "[key]"  # pydantic's name for the name of an entry, where it is that which is wrong
KEYS_NAMED: Final = 12  # keys that an error names, of a model that has more
KEYS_SHOWN: Final = 3  # keys that it names where a plain value was given: they show what is meant
REFERENCE: Final = "docs/scenarios.md lists all"


@dataclass(frozen=True, slots=True)
class Fault:
    """One value of a file that is refused."""

    location: tuple[int | str, ...]  # its place in the file, from the outermost key
    kind: str  # pydantic's name of the error
    words: str
    given: Any  # the value


def place_of(location: Sequence[int | str]) -> str:
    """A place in a file as people write it, ``mapping.tour.length_m``, in one line whatever the keys are."""
    return ".".join(one_line(str(part))[:LONGEST] or "''" for part in location)


def first_fault(error: ValidationError, data: Any, model: Any = None, top: str = "top level") -> str:
    """The place of the first value that a model refused, what is wrong with it, and how many others there are: in one line.

    Args:
        error: What was raised.
        data: What was read.
        model: The model that refused it, if an unknown key is to be answered with those that there are.
        top: What stands for the place of the whole.
    """
    first, *others = faults_of(error, data, model)
    more = f" (and {len(others)} more)" if others else ""
    return f"{place_of(first.location) or top}: {first.words}{more}"


def faults_of(error: ValidationError, data: Any, model: Any = None) -> list[Fault]:
    """Each value of ``data`` that ``model`` refused, once. A key that takes values of several kinds names all of them.

    ``model``, where it is known, adds to an unknown key which one may be meant, and to a plain value which keys are wanted.
    """
    apart: dict[tuple[int | str, ...], list[tuple[ErrorDetails, tuple[int | str, ...]]]] = {}
    for number, one in enumerate(error.errors(include_url=False)):
        location, choice = _placed(one["loc"], data)
        apart.setdefault((number,) if choice is None else (*location[:choice], OF_A_KEY), []).append((one, location))
    return [fault for group in apart.values() for fault in _faults_of_group(group, model)]


def _faults_of_group(group: list[tuple[ErrorDetails, tuple[int | str, ...]]], model: Any) -> Iterator[Fault]:
    """The faults of one value: of several kinds that it might be, those of the one whose shape it has, or one that names all."""
    shallow = min(len(location) for _, location in group)
    inner = [(one, location) for one, location in group if len(location) > shallow]
    if len(group) == 1 or inner:
        for one, location in inner or group:
            yield Fault(location, one["type"], _words(one, location, model), one.get("input"))
    else:
        first, location = group[0]
        wanted = ", or ".join(dict.fromkeys(f"{wanted_of(one)}{_keys_of(one, location, model)}" for one, _ in group))
        yield Fault(location, first["type"], f"{MUST_BE}{wanted}{not_given(first)}", first.get("input"))


def _words(one: ErrorDetails, location: Sequence[int | str], model: Any) -> str:
    """What is wrong with one value, with the keys that there are where they are the matter."""
    if one["type"] in UNKNOWN_KEY:
        return unknown_words(location, model)
    if one["type"] in MODEL_TYPES:
        return f"takes keys of its own{_keys_of(one, location, model)}{not_given(one)}"
    return words_of(one)


def unknown_words(location: Sequence[int | str], model: Any) -> str:
    """That a key is unknown, and the cure: the key that may be meant, or those that there are."""
    meant = path_meant(model, location)
    if meant is not None:
        return f"unknown key; did you mean {place_of(meant)}?"
    names = names_at(model, location[:-1])
    return f"unknown key; take it out{f'; there are {_listed(names, model)}' if names else ''}"


def _keys_of(one: ErrorDetails, location: Sequence[int | str], model: Any) -> str:
    """The keys that a value would have that has to have some, in brackets; empty where they are not known."""
    names = names_at(model, location) if one["type"] in MODEL_TYPES else []
    return f" ({', '.join([*names[:KEYS_SHOWN], '...'] if len(names) > KEYS_SHOWN else names)})" if names else ""


def _listed(names: Sequence[str], model: Any) -> str:
    """Names of keys, in one line that can be read."""
    if len(names) <= KEYS_NAMED:
        return ", ".join(names)
    more = REFERENCE if isinstance(model, type) and issubclass(model, Spec) else f"{len(names) - KEYS_NAMED} more"
    return f"{', '.join(names[:KEYS_NAMED])}; {more}"


def _placed(location: Sequence[int | str], data: Any) -> tuple[tuple[int | str, ...], int | None]:
    """Pydantic's location without what is not in the file, and where the first kind of a union stood in it; None: nowhere."""
    found: list[int | str] = []
    choice: int | None = None
    for part in location:
        here = _has(data, part)
        if here or not _is_kind(part):
            found.append(part)
            data = data[part] if here else None  # what is not here is missing, or has another, earlier name in the file
        elif part != OF_A_KEY and choice is None:
            choice = len(found)
    return tuple(found), choice


def _is_kind(part: int | str) -> bool:
    """Whether a part of pydantic's location is no key, but a kind of value: ``tuple[str, ...]``, ``SelfMotionNoise``."""
    return isinstance(part, str) and (not part.isidentifier() or part[0].isupper() or part in PLAIN_KINDS)


def _has(data: Any, part: int | str) -> bool:
    """Whether a mapping has this key, or a list this place."""
    if isinstance(data, Mapping):
        return part in data
    return isinstance(data, list | tuple) and isinstance(part, int) and part < len(data)
