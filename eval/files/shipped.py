"""The scenarios that come with the package, found by name: ``towns/rural``, in a checkout and in an installed wheel alike."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import hippodrome.core.types

FOLDER: Final = Path(hippodrome.core.types.__file__).parent.parent / "scenarios"
ENDING: Final = ".yaml"


def shipped(path: Path) -> Path:
    """The file of the scenario that is called so, if there is no file of this name; else the path as it is."""
    if path.is_absolute() or path.exists():
        return path
    parts = path.parts[1:] if path.parts[:1] == (FOLDER.name,) else path.parts  # also scenarios/towns/rural.yaml, from elsewhere
    if ".." in parts or not parts:
        return path
    named = FOLDER.joinpath(*parts)
    found = named if named.suffix == ENDING else named.with_name(named.name + ENDING)
    return found if found.is_file() else path


def names() -> Iterator[tuple[str, str]]:
    """Name and first comment of each scenario, by name."""
    for path in sorted(FOLDER.rglob(f"*{ENDING}")):
        lines = path.read_text(encoding="utf-8").splitlines()
        comment = next((line.lstrip("# ") for line in lines if line.startswith("#")), "")
        yield path.relative_to(FOLDER).with_suffix("").as_posix(), comment
