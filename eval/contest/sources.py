"""Hashes of what the methods of a scenario are made of, so that no result of older code is taken for one of theirs."""

from __future__ import annotations

import hashlib
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.machinery import ModuleSpec
from pathlib import Path

from hippodrome._files import sha256_of
from hippodrome.eval.programs.references import search_here
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import Scenario


def methods_sha256(scenario: Scenario) -> list[str]:
    """One hash for each method that the scenario names, none if it names none."""
    return [method_sha256(spec) for spec in scenario.methods.values()]


def method_sha256(spec: MethodSpec) -> str:
    """Hash of a class's module, or of the files that a command names. What these use in turn is not in it."""
    files = [_module_file(spec.class_)] if spec.class_ is not None else []
    for command in (spec.command, spec.stream, spec.localize):
        files += [Path(word) for word in _words(command)]
    known = [sha256_of(path) for path in files if path is not None and path.is_file()]
    return hashlib.sha256("".join(known).encode()).hexdigest()


def _module_file(reference: str) -> Path | None:
    """The file of a module; none of the packages that it lies in is imported for it, as that would run them."""
    search_here()
    name, places, file = "", None, None
    for part in reference.partition(":")[0].split("."):
        name = f"{name}.{part}" if name else part
        if (found := _spec_of(name, places)) is not None:
            file, inside = found.origin, found.submodule_search_locations
        else:  # a folder alone is a package, too
            file, inside = None, [path for place in places or sys.path if Path(path := str(Path(place, part))).is_dir()]
        places = list(inside or ())
    return None if file is None else Path(file)


def _spec_of(name: str, places: Sequence[str] | None) -> ModuleSpec | None:
    """Where a module lies, by the first finder that knows it."""
    for finder in sys.meta_path:
        with suppress(ImportError, ValueError, AttributeError, KeyError):  # an old finder; a folder in one not yet imported
            if (found := finder.find_spec(name, places)) is not None:
                return found
    return None


def _words(command: str | None) -> list[str]:
    try:
        return shlex.split(command or "")
    except ValueError:
        return []
