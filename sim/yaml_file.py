"""YAML files validated against one model; an error names the file, the line, the key and the limit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from hippodrome._files import read_bounded
from hippodrome.core.types import HippodromeError
from hippodrome.sim.key_words import faults_of, place_of

ModelT = TypeVar("ModelT", bound=BaseModel)
MAX_BYTES = 1 << 20  # a scenario is a page; more is a mistake or an attack
MAX_NODES = 100_000  # values, aliases written out; a scenario has some 250 keys
MOST_COUNTED = 1 << 62  # a bomb's size has as many digits as it has lines
UNFINISHED = -1  # size of a node that is being counted
MERGE = "tag:yaml.org,2002:merge"
# Numbers of YAML 1.1 that nobody means: 010 is eight, and 1:30 is ninety.
ODD_NUMBER: Final = re.compile(r"[-+]?(0[0-9_]+|[0-9_]+(:[0-9_.]+)+)")


class ScenarioError(HippodromeError):
    """A scenario file that cannot be used as it is."""


def load_yaml(path: Path, model: type[ModelT]) -> ModelT:
    """The file as ``model``; nothing is repaired and unknown keys are refused. Raises ScenarioError."""
    root, data = parse_yaml(read_yaml(path), str(path))
    try:
        return as_model(path, data, model)
    except ValidationError as error:
        first, *others = faults_of(error, data, model)
        place = f"{place_of(first.location)}: " if first.location else ""
        more = f" (and {len(others)} more: `hippodrome scenario validate` lists all)" if others else ""
        raise ScenarioError(f"{path}:{_line(root, first.location)}: {place}{first.words}{more}") from None


def as_model(path: Path, data: Any, model: type[ModelT]) -> ModelT:
    """The values of a file as ``model``. Raises ScenarioError if they are no mapping, ValidationError if they do not fit."""
    if not isinstance(data, dict):
        raise ScenarioError(f"{path}: a scenario is a mapping of keys to values; see scenarios/ for examples")
    return model.model_validate(data)


def read_yaml(path: Path) -> str:
    """The text of a file that is no longer than a scenario may be. Raises ScenarioError."""
    try:
        return read_bounded(path, MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror or error}; a scenario is a file of at most 1 MiB") from None
    except UnicodeDecodeError:
        raise ScenarioError(f"{path}: not UTF-8 text, so not a scenario") from None


def parse_yaml(text: str, place: str, ours: bool = True, twice: bool = False) -> tuple[yaml.Node | None, Any]:
    """The nodes of a YAML text, which know their lines, and its values, whatever is in it.

    Args:
        text: The text; of no more than ``MAX_BYTES``, as YAML is slow to read.
        place: What errors begin with: the file.
        ours: Whether numbers that YAML reads as others than they look are refused; other tools' files may have such as times.
        twice: Whether a key may be given twice, of which YAML takes the last one without a word.

    Raises:
        ScenarioError: It is no YAML, has a value that cannot be made, names a key twice, or grows beyond bounds by its aliases
            and merge keys.
    """
    loader = yaml.SafeLoader("")
    try:
        loader = yaml.SafeLoader(text)
        root = loader.get_single_node()
        if root is None:
            return None, None
        if (size := _expanded_size(root, {})) > MAX_NODES:
            raise ScenarioError(f"{place}: its aliases and merge keys make {size} values, the limit is {MAX_NODES}; write it out")
        if not twice and (first := next(repeated_keys(root, (), set()), None)) is not None:
            raise ScenarioError(f"{place}:{first[0]}: {first[1]}")
        for scalar in _scalars(root, set()):
            _require_value(loader, scalar, place)
            if ours:
                _require_plain(scalar, place)
        return root, loader.construct_document(root)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        reason = " ".join(str(getattr(error, "problem", None) or error).split())
        raise ScenarioError(f"{place}{line}: not valid YAML: {reason}") from None
    except RecursionError:
        raise ScenarioError(f"{place}: nested too deeply") from None
    except (TypeError, ValueError, OverflowError) as error:  # a key that is a list, for one
        raise ScenarioError(f"{place}: not valid YAML: {' '.join(str(error).split())[:200]}") from None
    finally:
        loader.dispose()


def _expanded_size(node: yaml.Node, known: dict[int, int]) -> int:
    """How many values a node stands for when each alias is written out. An alias of what it lies in is refused."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) in known:
        if known[id(node)] == UNFINISHED:
            raise yaml.MarkedYAMLError(problem="an alias stands for what it is a part of", problem_mark=node.start_mark)
        return known[id(node)]
    known[id(node)] = UNFINISHED
    children = [child for item in node.value for child in (item if isinstance(item, tuple) else (item,))]
    known[id(node)] = size = min(1 + sum(_expanded_size(child, known) for child in children), MOST_COUNTED)
    return size


def _scalars(node: yaml.Node, seen: set[int]) -> Iterator[yaml.ScalarNode]:
    """Each single value below a node, once."""
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, yaml.ScalarNode):
        yield node
    else:
        for item in node.value:
            for child in item if isinstance(item, tuple) else (item,):
                yield from _scalars(child, seen)


def _require_value(loader: yaml.SafeLoader, node: yaml.ScalarNode, place: str) -> None:
    """Raise ScenarioError, with the line, if a value cannot be made of what is written: there is no 2001-99-99."""
    if node.tag == MERGE:
        return
    if "\0" in node.value:
        raise ScenarioError(f"{place}:{node.start_mark.line + 1}: a zero byte, which no name of a file may have; take it out")
    try:
        loader.construct_object(node)
    except yaml.YAMLError:
        raise
    except Exception as error:  # PyYAML lets through whatever int(), float(), datetime() or a lookup make of it
        kind = node.tag.rpartition(":")[2]
        written = node.value if len(node.value) <= 40 else f"{node.value[:40]}... ({len(node.value)} characters)"
        cause = f"'{written}' is no {kind} ({type(error).__name__}); quote it if it is meant as text"
        raise ScenarioError(f"{place}:{node.start_mark.line + 1}: {cause}") from None


def _require_plain(node: yaml.ScalarNode, place: str) -> None:
    """Raise ScenarioError, with the line, where YAML reads another number than stands there."""
    if node.style is None and node.tag.rpartition(":")[2] in ("int", "float") and ODD_NUMBER.fullmatch(node.value):
        cause = f"'{node.value[:40]}' is another number for YAML than it looks; write it in digits, or in quotes if it is text"
        raise ScenarioError(f"{place}:{node.start_mark.line + 1}: {cause}")


def repeated_keys(node: yaml.Node | None, path: tuple[str, ...], seen: set[int]) -> Iterator[tuple[int, str]]:
    """Line and words for each key below ``node``, which lies at ``path``, that is given twice.

    Nodes in ``seen`` are left out: an alias may lead back to one of them.
    """
    if node is None or isinstance(node, yaml.ScalarNode) or id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for number, item in enumerate(node.value):
            yield from repeated_keys(item, (*path, str(number)), seen)
        return
    first: dict[str, int] = {}
    for key, value in node.value:
        line, place = key.start_mark.line + 1, (*path, str(key.value))
        if isinstance(key, yaml.ScalarNode):
            if key.value in first:
                yield line, f"{'.'.join(place)}: given twice, first in line {first[key.value]}; remove one"
            first.setdefault(key.value, line)
        yield from repeated_keys(value, place, seen)


def _line(node: yaml.Node | None, location: Sequence[int | str]) -> int:
    """Line of the deepest part of ``location`` that the file really has (union tags of the model are skipped)."""
    line = node.start_mark.line + 1 if node else 1
    for part in location:
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if key.value == str(part):
                    node, line = value, key.start_mark.line + 1
                    break
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
    return line
