"""Every error of a scenario file at once, each with file, line and key: an author mends them in one go."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import yaml
from pydantic import ValidationError

from hippodrome.eval.authoring.keys import key_paths, scenario_keys
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import SelfMotionNoise
from hippodrome.sim.yaml_file import ScenarioError, load_yaml, parse_yaml, read_yaml

UNKNOWN: Final = "extra_forbidden"  # pydantic's name for a key that the model does not have
MODEL_TYPES: Final = ("model_type", "dataclass_type")  # pydantic's names for a plain value where a mapping is wanted


def file_errors(path: Path) -> tuple[str, ...]:
    """One line for each error, in the order of the file; none if it is a scenario. Networks are not looked at."""
    first: ScenarioError | None = None
    try:
        load_yaml(path, Scenario)
    except ScenarioError as error:
        first = error
        if not isinstance(error.__context__, ValidationError):  # unreadable, or no YAML: there is no second error to find
            return (str(error),)
    root, _ = parse_yaml(read_yaml(path), str(path))
    found = list(_repeated(root, (), set()))
    if first is not None and isinstance(first.__context__, ValidationError):
        found += _invalid(root, first.__context__)
    found = sorted(dict.fromkeys(found), key=lambda one: one[0])
    return tuple(f"{path}:{line}: {words}" for line, words in found)


def _invalid(root: yaml.Node | None, error: ValidationError) -> Iterator[tuple[int, str]]:
    """Line and words of what the model refuses."""
    for one in error.errors(include_url=False):
        line, place, node = _find(root, one["loc"])
        if one["type"] == "missing":
            place = f"{place}.{one['loc'][-1]}".removeprefix(".")
        elif isinstance(node, yaml.MappingNode) and isinstance(one.get("input"), int | float) and isinstance(one["loc"][-1], str):
            place = f"{place}: {one['loc'][-1]}"  # a key that stands in the file below an earlier name
        if isinstance(node, yaml.MappingNode) and one["type"] == "literal_error":
            continue  # a mapping was never meant to be one of the names: its own errors follow
        if one["type"] in MODEL_TYPES and place == "noise":
            continue  # a name was never meant to be a mapping: the error about names follows
        yield line, f"{place}: {_reason(one, place)}".removeprefix(": ")


def _reason(one: Mapping[str, Any], place: str) -> str:
    """What is wrong with the value at ``place``, in our words where pydantic's would not help; ``one`` is its error."""
    if one["type"] == UNKNOWN:
        near = difflib.get_close_matches(place, _known(place), n=1, cutoff=0.6)
        return f"unknown key; {f'did you mean {near[0]}?' if near else 'docs/scenarios.md lists all'}"
    if one["type"] == "missing":
        return "must be given"
    if one["type"] in MODEL_TYPES:
        return "takes keys of its own; docs/scenarios.md lists them"
    if one["type"] == "string_pattern_mismatch":
        return next(key.meaning for key in scenario_keys() if key.name == place)
    message = str(one["msg"]).removeprefix("Value error, ").partition(", unable to parse")[0]
    given = one.get("input")
    return f"{message}, not {given!r}" if isinstance(given, str | int | float) and "Input should" in message else message


def _known(place: str) -> list[str]:
    """All keys of the same depth as the unknown one, whether they hold a value or further keys."""
    depth = place.count(".") + 1
    paths = (*key_paths(Scenario), *(("noise", *path) for path in key_paths(SelfMotionNoise)))
    return sorted({".".join(path[:depth]) for path in paths if len(path) >= depth})


def _find(node: yaml.Node | None, location: Sequence[int | str]) -> tuple[int, str, yaml.Node | None]:
    """Line, dotted path and node of the deepest part of ``location`` that the file really has.

    ``location`` is pydantic's; the names of the model's types that it may have in it are not in the file and are skipped.
    """
    line, path = node.start_mark.line + 1 if node else 1, []
    for part in location:
        if isinstance(node, yaml.MappingNode):
            pair = next((pair for pair in reversed(node.value) if pair[0].value == str(part)), None)
            if pair is not None:
                line, node = pair[0].start_mark.line + 1, pair[1]
                path.append(str(part))
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
            path.append(str(part))
    return line, ".".join(path), node


def _repeated(node: yaml.Node | None, path: tuple[str, ...], seen: set[int]) -> Iterator[tuple[int, str]]:
    """Line and words for each key that is given twice, of which YAML readers take the last one without a word.

    Nodes in ``seen`` are left out: an alias may lead back to one of them.
    """
    if not isinstance(node, yaml.MappingNode) or id(node) in seen:
        return
    seen.add(id(node))
    first: dict[str, int] = {}
    for key, value in node.value:
        line, place = key.start_mark.line + 1, (*path, str(key.value))
        if key.value in first:
            yield line, f"{'.'.join(place)}: given twice, first in line {first[key.value]}; remove one"
        first.setdefault(key.value, line)
        yield from _repeated(value, place, seen)
