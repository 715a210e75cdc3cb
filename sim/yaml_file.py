"""YAML files validated against one model; an error names the file, the line, the key and the limit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from hippodrome.core.types import HippodromeError

ModelT = TypeVar("ModelT", bound=BaseModel)
UNKNOWN_KEY = {"extra_forbidden", "unexpected_keyword_argument"}  # pydantic's names, of models and of dataclasses
MAX_BYTES = 1 << 20  # a scenario is a page; more is a mistake or an attack


class ScenarioError(HippodromeError):
    """A scenario file that cannot be used as it is."""


def load_yaml(path: Path, model: type[ModelT]) -> ModelT:
    """The file as ``model``; nothing is repaired and unknown keys are refused. Raises ScenarioError."""
    text = _read(path)
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        raise ScenarioError(f"{path}{line}: not valid YAML: {getattr(error, 'problem', None) or error}") from None
    except RecursionError:
        raise ScenarioError(f"{path}: nested too deeply") from None
    if not isinstance(data, dict):
        raise ScenarioError(f"{path}: a scenario is a mapping of keys to values; see scenarios/ for examples")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        others = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise ScenarioError(
            f"{path}:{_line(root, first['loc'])}: {place}: {_reason(first['type'], first['msg'])}{others}"
        ) from None


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ScenarioError(f"{path}: {path.stat().st_size} bytes, a scenario has at most {MAX_BYTES}")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ScenarioError(f"{path}: not UTF-8 text, so not a scenario") from None


def _reason(kind: str, message: str) -> str:
    return "unknown key; see the scenario reference in docs/scenarios.md" if kind in UNKNOWN_KEY else message


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
