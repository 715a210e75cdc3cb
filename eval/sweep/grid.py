"""The cells of a sweep: scenarios x seeds x values of parameters, each an ordinary scenario with a key of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hippodrome.eval.contest.entry import Added, entries_of, with_methods
from hippodrome.eval.contest.sources import methods_sha256
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.reuse import figure_code_sha256
from hippodrome.eval.sweep.executors import SweepError
from hippodrome.sim.key_words import faults_of, place_of
from hippodrome.sim.renamed import REMOVED, present_key
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NOISE_LEVELS
from hippodrome.sim.yaml_file import ScenarioError, parse_yaml

MAX_CELLS = 100_000  # more is taken for a slip of the keyboard


@dataclass(frozen=True, slots=True)
class Parameter:
    """A key of the scenario and the values that it takes in turn."""

    key: str  # dotted, as in docs/scenarios.md
    values: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class SweepCell:
    """One point of the grid."""

    scenario: Scenario
    parameters: tuple[tuple[str, str], ...]  # key and value as JSON: hashable, and the same on every machine

    @property
    def label(self) -> str:
        """How tables name the parameters."""
        return ", ".join(f"{key}={value.strip(chr(34))}" for key, value in self.parameters) or "as written"

    @property
    def name(self) -> str:
        return f"{self.scenario.name}, seed {self.scenario.seed}, {self.label}"

    @property
    def key(self) -> str:
        """Name of the cell's folder, made of its whole configuration and of the code: nothing stale is taken for finished."""
        text = json.dumps([self.scenario.model_dump_json(), cell_code_sha256(), *methods_sha256(self.scenario)])
        return f"{self.scenario.name}-{self.scenario.seed}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def parse_parameter(text: str) -> Parameter:
    """The parameter of ``KEY=V1,V2``, values as YAML. Raises ValueError if the text is not of that form."""
    key, equals, values = text.partition("=")
    try:
        _, found = parse_yaml(f"[{values}]", text[:80])
    except ScenarioError:
        found = None
    if not equals or not all(part.isidentifier() for part in key.split(".")) or not isinstance(found, list) or not found:
        raise ValueError(f"'{text}' is not KEY=VALUE,VALUE like noise=paper,harsh or mapping.traffic.vehicles=0,8")
    return Parameter(key, tuple(found))


def make_grid(
    paths: Sequence[Path], seeds: Sequence[int] | None, parameters: Sequence[Parameter], methods: Sequence[Added] = ()
) -> list[SweepCell]:
    """All cells of the grid, the last parameter's values changing fastest.

    Args:
        paths: The scenarios' files.
        seeds: Seeds that replace the scenarios' own; None: their own.
        parameters: Keys and the values that they take in turn.
        methods: Methods that take part beside ours and those that a scenario names.

    Raises:
        HippodromeError: A file is no scenario, a key or value cannot be set, a cell is there twice, or there are too many.
    """
    count = len(paths) * len(seeds or [0])
    for parameter in parameters:
        count *= len(parameter.values)
    if count > MAX_CELLS:
        raise SweepError(f"{count} cells, the limit is {MAX_CELLS}")
    chosen: Sequence[int | None] = seeds or (None,)
    scenarios = [with_methods(read_scenario(path, None, seed), methods) for path in paths for seed in chosen]
    cells = [cell for scenario in scenarios for cell in _cells(scenario, parameters)]
    for cell in cells:
        entries_of(cell.scenario)  # a method that cannot be loaded is said before anything is run
    seen: dict[tuple[str, int, str], SweepCell] = {}
    for cell in cells:
        if seen.setdefault((cell.scenario.name, cell.scenario.seed, cell.label), cell) is not cell:
            raise SweepError(f"{cell.name}: twice in the grid; give each scenario a name of its own and each value once")
    return cells


def with_value(scenario: Scenario, key: str, value: Any) -> Scenario:
    """The scenario with one key replaced, checked as if it stood in the file. Raises SweepError that names the key."""
    if (reason := REMOVED.get(present_key(key))) is not None:
        raise SweepError(f"--set {key}: has no effect any more: {reason}")
    values = scenario.model_dump()
    *parents, last = present_key(key).split(".")
    place: Any = values
    for part in parents:
        if part == "noise" and isinstance(place[part], str):  # a level's name stands for its values
            place[part] = NOISE_LEVELS[place[part]].model_dump()
        place = place.setdefault(part, {}) if parents[0] == "methods" and part == "config" else place.get(part)
        if not isinstance(place, dict):
            raise SweepError(f"--set {key}: '{part}' has no keys of its own; see docs/scenarios.md")
    place[last] = value
    try:
        return Scenario.model_validate(values)
    except ValidationError as error:
        fault = faults_of(error, values, Scenario)[0]
        place = place_of(fault.location)
        inner = "" if place == present_key(key) else f"{place}: "  # a value with keys of its own may have a fault below
        raise SweepError(f"--set {key}={value}: {inner}{fault.words}") from None


def cell_code_sha256() -> str:
    """Hash of the code that a cell's figures and samples come from."""
    return figure_code_sha256("eval/sweep/cell.py", "eval/drive/*.py")


def _cells(scenario: Scenario, parameters: Sequence[Parameter]) -> Iterator[SweepCell]:
    """The cells of one scenario and seed: all combinations of values."""
    for values in product(*(parameter.values for parameter in parameters)):
        chosen: Mapping[str, Any] = dict(zip((parameter.key for parameter in parameters), values, strict=True))
        changed = scenario
        for key, value in chosen.items():
            changed = with_value(changed, key, value)
        yield SweepCell(changed, tuple((key, json.dumps(value, sort_keys=True)) for key, value in chosen.items()))
