"""Imports follow the arrow scenarios -> sim -> core -> proto -> eval, and core knows no simulator, no GL, no files."""

import ast
from pathlib import Path

import pytest

import hippodrome.core.types

ROOT = Path(hippodrome.core.types.__file__).parent.parent
MAY_IMPORT = {
    "core": {"core"},
    "sim": {"_files", "core", "sim"},
    "proto": {"_files", "core", "proto"},
    "eval": {"_files", "core", "sim", "proto", "eval"},
}
CORE_PACKAGES = {"cv2", "numba", "numpy", "scipy"}
STANDARD_IN_CORE = {"__future__", "collections", "dataclasses", "enum", "functools", "heapq", "itertools", "math", "typing"}


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
