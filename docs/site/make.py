"""The sources of the documentation's pages: ``python docs/site/make.py FOLDER``; `make site` then builds the pages from them.

The folder gets the files of ``docs/``, the README as start page, CONTRIBUTING and CHANGELOG, and a reference made from the front
door and the packages of ``core``. Links are written for a reader of the repository, ``docs/metrics.md``. Here they lead to the
pages of the site, and a link to a file that has no page, such as a scenario, becomes plain text.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import sys
from pathlib import Path, PurePosixPath
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
FROM_ROOT: Final = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
ROOMS: Final = (
    "roads",
    "solvers",
    "attractors",
    "views",
    "mapping",
    "matching",
    "refinement",
    "localization",
    "reading",
    "navigation",
)
LINK: Final = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#]*)(#[^)\s]*)?\)")
FRONT_DOOR: Final = """\
# The front door

Everything public is exported by the package itself, `from hippodrome import ...`.
[Hippodrome from Python](../python.md) shows how it is used.
"""
OF_THE_DOOR: Final = ("heading_level: 2", "skip_local_inventory: true")  # links lead to the packages' own pages
OF_A_MODULE: Final = ("show_root_heading: false", "show_root_toc_entry: false")


def main(folder: Path) -> None:
    """Write everything anew below ``folder``."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs", folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    for page in sorted(folder.glob("*.md")):
        page.write_text(with_links_turned(page.read_text(encoding="utf-8"), f"docs/{page.name}", page.name), encoding="utf-8")
    for name, page in FROM_ROOT.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        (folder / page).write_text(with_links_turned(text, name, page), encoding="utf-8")
    (folder / "reference").mkdir()
    for page, text in reference_pages().items():
        (folder / "reference" / page).write_text(text, encoding="utf-8")


def with_links_turned(markdown: str, source: str, page: str) -> str:
    """The text of the repository's file ``source`` with links that work on ``page`` of the site."""

    def turned(link: re.Match[str]) -> str:
        image, text, target, anchor = link[1], link[2], link[3], link[4] or ""
        if not target or ":" in target:
            return link[0]
        path = os.path.normpath(PurePosixPath(source).parent / target)
        if path in FROM_ROOT or path.startswith("docs/"):
            place = FROM_ROOT.get(path, path.removeprefix("docs/"))
            return f"{image}[{text}]({os.path.relpath(place, PurePosixPath(page).parent)}{anchor})"
        return text if (ROOT / path).exists() else link[0]

    return LINK.sub(turned, markdown)


def reference_pages() -> dict[str, str]:
    """Pages of directives, from which mkdocstrings makes the reference."""
    homes = front_door()
    public = [_directive(f"hippodrome.{homes[name]}.{name}", *OF_THE_DOOR) for name in homes]
    pages = {"index.md": "\n".join([FRONT_DOOR, *public])}
    pages["core.md"] = _page("core: types and poses", [ROOT / "core/types.py", ROOT / "core/se2.py"])
    return pages | {f"{room}.md": _page(f"core.{room}", sorted((ROOT / "core" / room).rglob("*.py"))) for room in ROOMS}


def front_door() -> dict[str, str]:
    """The public names in alphabetical order, each with the module that defines it, as ``hippodrome/__init__.py`` lists them."""
    tree = ast.parse((ROOT / ".ns/hippodrome/__init__.py").read_text(encoding="utf-8"))
    (table,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.target.id == "_HOMES"
    )
    assert table is not None
    homes: dict[str, str] = ast.literal_eval(table)
    return {name: homes[name] for name in sorted(homes, key=str.lower)}


def _page(title: str, modules: list[Path]) -> str:
    """The modules of a package; the package's own words come first."""
    text = f"# {title}\n"
    for path in modules:
        name = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        if path.name != "__init__.py":
            text += f"\n## {name.removeprefix('core.')}\n\n{_directive(f'hippodrome.{name}', *OF_A_MODULE)}"
        elif path.read_text(encoding="utf-8").strip():
            text += f"\n{_directive('hippodrome.' + name.removesuffix('.__init__'), *OF_A_MODULE, 'members: false')}"
    return text


def _directive(name: str, *options: str) -> str:
    return "\n".join([f"::: {name}", "    options:", *(f"      {option}" for option in options), ""])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
