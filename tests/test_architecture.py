"""Imports follow the arrow scenarios -> sim -> core -> proto -> eval, and between the rooms of a part they run one way.

A room is a folder; a file that lies in a part's own folder (``core/types.py``, ``eval/run.py``) is a room of its own.
"""

import ast
import re
from pathlib import Path

import pytest

import hippodrome.core.types

ROOT = Path(hippodrome.core.types.__file__).parent.parent
MAY_IMPORT = {
    "core": {"core"},
    "sim": {"_files", "_folders", "_json", "_native", "_output", "_processes", "core", "sim"},
    "proto": {"_files", "core", "proto"},
    "eval": {"_files", "_folders", "_json", "_native", "_output", "_processes", "_spawn", "core", "sim", "proto", "eval"},
}
# What each room of core may import; every room may import types and se2.
CORE_ROOMS = {
    "types": set(),
    "se2": {"types"},
    "attractors": set(),
    "roads": set(),
    "solvers": set(),
    "views/egomotion": set(),
    "views": {"views/egomotion"},
    "mapping": {"attractors", "reading", "solvers", "views"},
    "matching/hmm": {"roads"},
    "matching/search": {"roads"},
    "matching": {"matching/search", "roads"},
    "refinement": {"matching", "matching/hmm", "matching/search", "reading", "roads", "solvers"},
    "localization/beliefs": {"attractors", "roads"},
    "localization": {"localization/beliefs", "reading", "roads", "views"},
    "reading": {"views/egomotion"},
    "navigation": {"localization", "localization/beliefs", "reading", "roads", "views"},
}
# The rooms of eval from the lowest to the highest: each may import only those before it.
EVAL_ROOMS = (
    "metrics", "files", "methods", "programs", "results", "pool", "reuse", "figures", "report", "rivals/ratslam",
    "rivals/orbslam3", "rivals", "contest", "evaluate", "run", "drive", "authoring", "gate", "board", "sweep", "trials/stress",
    "trials/robustness", "trials/rivals", "exchange/drives", "exchange/readers", "exchange/formats", "exchange", "real",
    "commands", "cli",
)  # fmt: skip
CORE_PACKAGES = {"cv2", "numba", "numpy", "scipy"}
STANDARD_IN_CORE = {
    "__future__", "collections", "dataclasses", "enum", "functools", "heapq", "itertools", "math", "typing",
    "mmap",  # memory without a file, for tables of which little is touched
}  # fmt: skip


def imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.module == "hippodrome":
                yield from (f"hippodrome.{alias.name}" for alias in node.names)
            else:
                yield node.module


@pytest.mark.parametrize("part", sorted(MAY_IMPORT))
def test_imports_follow_the_arrow(part):
    sources = [path for path in (ROOT / part).rglob("*.py") if not path.name.endswith("_pb2.py")]
    assert sources
    for path in sources:
        for name in imports(path):
            if name.startswith("hippodrome."):
                assert name.split(".")[1] in MAY_IMPORT[part], f"{path.name} imports {name}"


def test_core_is_numbers_only():
    for path in (ROOT / "core").rglob("*.py"):
        for name in imports(path):
            top = name.split(".")[0]
            assert top in CORE_PACKAGES | STANDARD_IN_CORE | {"hippodrome"}, f"{path.name} imports {name}"


def room_of(module):
    """Part and room of a module's dotted name: ("core", "matching/search")."""
    _, part, *rest = module.split(".")
    place = ROOT.joinpath(part, *rest)
    folder = rest if place.is_dir() else rest[:-1]
    return part, "/".join(folder or rest)


def arrows(part):
    """Imports (file, own room, imported room) between the rooms of a part, those by a name in a string included."""
    for path in sorted((ROOT / part).rglob("*.py")):
        if path.name.endswith("_pb2.py") or path.name == "__init__.py":
            continue
        own = room_of(f"hippodrome.{'.'.join(path.relative_to(ROOT).with_suffix('').parts)}")
        for module in [
            *_modules(path),
            *re.findall(r"[\"']-?m?(hippodrome\.[a-z0-9_.]+[a-z0-9_])", path.read_text(encoding="utf-8")),
        ]:
            if module.startswith(f"hippodrome.{part}.") and (target := room_of(module)) != own:
                yield path, own[1], target[1]


def _modules(path):
    """The modules that a file imports; of ``from package import module`` the module."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("hippodrome."):
            place = ROOT.joinpath(*node.module.split(".")[1:])
            for alias in node.names:
                yield f"{node.module}.{alias.name}" if (place / f"{alias.name}.py").exists() else node.module


def test_rooms_of_core_import_only_what_they_may():
    for path, own, target in arrows("core"):
        assert target in CORE_ROOMS[own] | {"types", "se2"}, f"{path}: {own} imports {target}"


def test_rooms_of_eval_import_only_lower_ones():
    for path, own, target in arrows("eval"):
        assert EVAL_ROOMS.index(target) < EVAL_ROOMS.index(own), f"{path}: {own} imports {target}"


@pytest.mark.parametrize("part", sorted(MAY_IMPORT))
def test_no_circle_between_rooms(part):
    """Independent of the tables above: rooms without an arrow out are taken away until none is left."""
    out = {}
    for _, own, target in arrows(part):
        out.setdefault(own, set()).add(target)
        out.setdefault(target, set())
    while out:
        ends = {room for room, targets in out.items() if not targets}
        assert ends, f"a circle among {sorted(out)}"
        out = {room: targets - ends for room, targets in out.items() if room not in ends}


def test_the_tables_name_every_room():
    for part, rooms in (("core", set(CORE_ROOMS)), ("eval", set(EVAL_ROOMS))):
        files = [path for path in (ROOT / part).rglob("*.py") if path.name != "__init__.py"]
        found = {room_of(f"hippodrome.{'.'.join(path.relative_to(ROOT).with_suffix('').parts)}")[1] for path in files}
        assert found == rooms


def test_temporary_folders_are_those_that_the_next_command_sweeps():
    """A killed process cannot take its folders away; only those of ``_folders`` are found again."""
    own = [path for part in MAY_IMPORT for path in (ROOT / part).rglob("*.py")]
    assert own and not [path for path in own if "TemporaryDirectory" in (text := path.read_text()) or "mkdtemp" in text]
