"""What is wrong with a value of a scenario, in words for its author: pydantic speaks of tuples, dictionaries and patterns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

# Patterns of texts, in regular expressions and in words.
SCENARIO_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
METHOD_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9 ._+(),-]{0,39}$"
CLASS: Final = r"^[\w.]+:[\w.]+$"
POLICY: Final = r"(exec|stream):.*\S.*|[\w.]+:[\w.]+"  # a command that is fed step by step, or a Python object
SOURCE: Final = f"^({POLICY})$"
NEED: Final = r"^(road_network|start_pose|stereo|grain|metric_scale|[1-9][0-9]{1,3}x[1-9][0-9]{1,3})$"
PATTERNS: Final = {
    SCENARIO_NAME: "results are filed under it: letters, digits, '.', '_', '-', at most 64",
    METHOD_NAME: "a name begins with a letter or digit and has letters, digits, spaces and . _ + ( ) , - , at most 40",
    CLASS: "Input should be my_package.my_module:MyClass, or exec: or stream: and a command",
    SOURCE: "Input should be my_package.my_module:MyPolicy, or exec: or stream: and a command",
    NEED: "Input should be road_network, start_pose, stereo, grain, metric_scale, or a size like 640x480",
}

OWN_KEYS: Final = "takes keys of its own; docs/scenarios.md lists them"
# What a key wants, by pydantic's names of errors; for the others see ``_wanted``.
WANTED: Final = {
    "tuple_type": "a list, as in [a, b]",
    "list_type": "a list, as in [a, b]",
    "dict_type": "names with values, as in {a: b}",
    "model_type": "keys of its own (docs/scenarios.md lists them)",
    "dataclass_type": "keys of its own (docs/scenarios.md lists them)",
    "string_type": "text, in quotes where it looks like a number or a word like yes",
    "path_type": "the path of a file, in quotes where it looks like a number or a word like yes",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
}
UNKNOWN_KEY: Final = ("extra_forbidden", "unexpected_keyword_argument")  # pydantic's names, of models and of dataclasses
MODEL_TYPES: Final = ("model_type", "dataclass_type")  # the same for a plain value where keys are wanted
PLAIN_KINDS: Final = ("str", "int", "float", "bool", "path", "list", "dict")  # kinds that look like names of keys
OF_A_KEY: Final = "[key]"  # pydantic's name for the name of an entry, where it is that which is wrong
LONGEST: Final = 60  # characters of a value that an error repeats
LARGEST_PRINTED: Final = 10**LONGEST


@dataclass(frozen=True, slots=True)
class Fault:
    """One value of a scenario that is refused."""

    location: tuple[int | str, ...]  # its place in the file, from the outermost key
    kind: str  # pydantic's name of the error
    words: str
    given: Any  # the value


def faults_of(error: ValidationError, data: Any) -> list[Fault]:
    """Each value of ``data`` that a model refused, once. A key that takes values of several kinds names all of them."""
    apart: dict[tuple[int | str, ...], list[tuple[ErrorDetails, tuple[int | str, ...]]]] = {}
    for number, one in enumerate(error.errors(include_url=False)):
        location, choice = _placed(one["loc"], data)
        apart.setdefault((number,) if choice is None else (*location[:choice], OF_A_KEY), []).append((one, location))
    return [fault for group in apart.values() for fault in _faults_of_group(group)]


def _faults_of_group(group: list[tuple[ErrorDetails, tuple[int | str, ...]]]) -> Iterator[Fault]:
    """The faults of one value: of several kinds that it might be, those of the one whose shape it has, or one that names all."""
    shallow = min(len(location) for _, location in group)
    inner = [(one, location) for one, location in group if len(location) > shallow]
    if len(group) == 1 or inner:
        for one, location in inner or group:
            yield Fault(location, one["type"], words_of(one), one.get("input"))
    else:
        first, location = group[0]
        wanted = ", or ".join(dict.fromkeys(_wanted(one) for one, _ in group))
        yield Fault(location, first["type"], f"Input should be {wanted}{_not(first)}", first.get("input"))


def words_of(one: ErrorDetails) -> str:
    """What is wrong with one value, in a sentence without the name of its key."""
    kind, context = one["type"], one.get("ctx", {})
    if kind in UNKNOWN_KEY:
        return "unknown key; see the scenario reference in docs/scenarios.md"
    if kind in MODEL_TYPES:
        return OWN_KEYS
    if kind == "string_pattern_mismatch" and context.get("pattern") in PATTERNS:
        return f"{PATTERNS[context['pattern']]}{_not(one)}"
    if kind in WANTED:
        return f"Input should be {WANTED[kind]}{_not(one)}"
    message = one["msg"].removeprefix("Value error, ").partition(", unable to parse")[0]
    return f"{message}{_not(one)}" if "Input should" in message else message


def _wanted(one: ErrorDetails) -> str:
    """What one of several kinds of values would be."""
    kind, context = one["type"], one.get("ctx", {})
    if kind in WANTED:
        return WANTED[kind]
    if kind.startswith("int_"):
        return "a whole number"
    if kind.startswith("float_") or kind == "finite_number":
        return "a number"
    bounds = {"ge": "of at least", "gt": "above", "le": "of at most", "lt": "below"}
    named = next((f"a number {words} {context[name]:g}" for name, words in bounds.items() if name in context), None)
    return named or words_of({**one, "input": None}).removeprefix("Input should be ")


def _not(one: ErrorDetails) -> str:
    """What was given, where that is one value: ``, not 5``."""
    given = one.get("input")
    if isinstance(given, bool):
        return f", not {str(given).lower()}"
    if isinstance(given, int) and abs(given) > LARGEST_PRINTED:  # Python refuses to print what has thousands of digits
        return ""
    return f", not {repr(given)[:LONGEST]}" if isinstance(given, str | int | float) else ""


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
