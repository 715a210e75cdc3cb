"""Every error of a scenario file at once, each with file, line and key: an author mends them in one go."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import yaml
from pydantic import ValidationError

from hippodrome.sim.key_words import Fault, faults_of, place_of
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.value_words import MISSING
from hippodrome.sim.yaml_file import ScenarioError, as_model, parse_yaml, read_yaml, repeated_keys


def file_errors(path: Path) -> tuple[str, ...]:
    """One line for each error, in the order of the file; none if it is a scenario. Networks are not looked at."""
    try:
        root, data = parse_yaml(read_yaml(path), str(path), twice=True)
        found = list(repeated_keys(root, (), set()))
        as_model(path, data, Scenario)
    except ScenarioError as error:  # unreadable, or no YAML: there is no second error to find
        return (str(error),)
    except ValidationError as error:
        found += _invalid(root, faults_of(error, data, Scenario))
    found = sorted(dict.fromkeys(found), key=lambda one: one[0])
    return tuple(f"{path}:{line}: {words}" for line, words in found)


def _invalid(root: yaml.Node | None, faults: Iterable[Fault]) -> Iterator[tuple[int, str]]:
    """Line and words of what the model refuses."""
    for fault in faults:
        line, place, node = _find(root, fault.location)
        if fault.kind in MISSING:
            place = f"{place}.{fault.location[-1]}".removeprefix(".")
        elif isinstance(node, yaml.MappingNode) and isinstance(fault.given, int | float):
            place = f"{place}: {fault.location[-1]}"  # a key that stands in the file below an earlier name
        yield line, f"{place}: {fault.words}".removeprefix(": ")


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
                path.append(place_of([part]))
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
            path.append(str(part))
    return line, ".".join(path), node
