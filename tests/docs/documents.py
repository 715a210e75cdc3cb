"""The documents of the repository, taken apart: prose, inline code, code blocks, tables, headings, links."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Document:
    """One Markdown file."""

    path: Path

    def __str__(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @cached_property
    def text(self) -> str:
        return COMMENT.sub("", self.path.read_text(encoding="utf-8"))

    @cached_property
    def fences(self) -> list[tuple[str, str]]:
        """Language and content of each fenced block."""
        return FENCE.findall(self.text)

    @cached_property
    def unfenced(self) -> str:
        return FENCE.sub("", self.text)

    @cached_property
    def blocks(self) -> list[str]:
        """Indented code blocks: lines after a blank one, indented by four, outside of lists."""
        found, block, before, listed = [], list[str](), "", False
        for line in [*self.unfenced.splitlines(), ""]:
            listed = (listed or line.startswith("* ")) and (line.startswith(("* ", "  ")) or not line)
            indented = line.startswith("    ") and not listed
            if indented and (block or not before.strip()):
                block.append(line[4:])
            elif block and not line.strip():
                block.append("")
            elif block:
                found.append("\n".join(block).strip("\n"))
                block = []
            before = line
        return [*found, *(["\n".join(block).strip("\n")] if any(block) else [])]

    @cached_property
    def prose(self) -> str:
        """Without code blocks."""
        return "\n".join(line for line in self.unfenced.splitlines() if not line.startswith("    "))

    @cached_property
    def inline(self) -> list[str]:
        """Inline code, in prose and tables."""
        return INLINE.findall(self.prose)

    @cached_property
    def links(self) -> list[str]:
        return LINK.findall(self.prose)

    @cached_property
    def anchors(self) -> set[str]:
        """Of the headings, as GitHub and the site make them."""
        return {_slug(line.lstrip("# ")) for line in self.unfenced.splitlines() if re.match(r"#+ ", line)}

    def tables(self) -> Iterator[list[dict[str, str]]]:
        """Each table as rows, by the names in its head."""
        rows = list[list[str]]()
        for line in [*self.prose.splitlines(), ""]:
            if line.startswith("|"):
                rows.append([cell.strip() for cell in line.strip().strip("|").split(" | ")])
            elif rows:
                head, _, *body = rows
                yield [dict(zip([name.strip("| ") for name in head], row, strict=False)) for row in body]
                rows = []


def code_in(cell: str) -> list[str]:
    """The inline code of a table's cell."""
    return INLINE.findall(cell)


def documents() -> list[Document]:
    """All that a reader is sent to. CHANGELOG.md tells the past, with the names of then."""
    paths = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
    return [Document(path) for path in paths]


def document(name: str) -> Document:
    return Document(ROOT / name)


def _slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower().replace("`", "")).replace(" ", "-")
