"""What all pages are made of: one file that needs no network, in one style, whose tables sort and are taken along."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final

from hippodrome._files import write_atomically
from hippodrome.eval.report.files import read_picture
from hippodrome.eval.report.markup import Child, Html, element, joined
from hippodrome.eval.report.sections import gallery
from hippodrome.eval.report.tables import plain_table

# The page asks no server for anything: pictures, style and script are in the file itself.
POLICY: Final = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
# Of a page that has tables and pictures only.
TABLE_SCRIPTS: Final = ("basics.js", "vector.js", "save.js", "night.js", "tables.js")
UNITS: Final = ("m", "s", "ms", "%")  # after a comma in a head
WIDE: Final = 6  # columns from which on a table does not fit a phone
BAD = re.compile(r"^(WORSE|FAILED|failed|refused|MISSED)\b")  # words of a verdict
GOOD = re.compile(r"^(better|held|aim reached|passed)\b")


def asset(name: str) -> str:
    """The text of a script or a style of the pages."""
    return (files("hippodrome.eval.report") / name).read_text(encoding="utf-8")


def page(
    title: str, body: Sequence[Child], scripts: Sequence[str], early: str | None = None, policy: str = POLICY, style: str = ""
) -> str:
    """A whole document.

    Args:
        title: Of the window.
        body: What is between the begin of the body and its scripts.
        scripts: Names of the scripts, each of which uses those before it.
        early: A script that runs before anything is shown.
        policy: Where the page may load from.
        style: Style of this page alone.
    """
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        element("script", Html(early)) if early else None,
        element("style", Html(asset("style.css") + style)),
    )
    enlarged = element("dialog", element("button", element("img", alt=""), type="button", aria_label="Close"))
    dialog = enlarged if scripts else None
    script = element("script", Html("\n".join(asset(name) for name in scripts))) if scripts else None
    return "<!doctype html>\n" + element("html", head, element("body", *body, dialog, script), lang="en") + "\n"


def write_trial_page(
    path: Path, title: str, text: str, pictures: Sequence[Path] = (), command: str = "", verdict: str | None = None
) -> None:
    """Write a page of what a command found, beside its other files.

    Args:
        path: The page.
        title: What was tried.
        text: The findings as Markdown that we wrote: headings, tables, lists and paragraphs.
        pictures: Figures, each with its SVG beside it if there is one; those that do not exist are left out.
        command: What writes the page again.
        verdict: A word for the whole, shown beside the title.
    """
    badge = element("span", verdict, class_=f"badge {'good' if GOOD.match(verdict) else 'bad'}") if verdict else None
    found = [picture for one in pictures if one.exists() and (picture := read_picture(one)) is not None]
    body = [
        element("header", element("h1", title), " ", badge),
        element(
            "main",
            element("section", *_blocks(text), class_="trial", data_town=title),
            element("section", element("h2", "Figures"), gallery(found), data_town=title) if found else None,
        ),
        element("footer", "Made by ", element("code", command), ". The same figures lie beside this page as JSON or Markdown."),
    ]
    write_atomically(path, page(title, body, TABLE_SCRIPTS).encode())


def _blocks(text: str) -> Iterator[Html]:
    """The elements of a text in Markdown; the first heading is left out, as the page has its title."""
    title = "results"
    for number, block in enumerate(_parts(text)):
        first = block[0]
        if first.startswith("#"):
            title = first.lstrip("# ")
            if number:
                yield element("h2", title)
        elif first.startswith("|"):
            yield _table([_cells(line) for line in block if not re.fullmatch(r"[|\-: ]+", line)], title)
        elif first.startswith("- "):
            yield element("ul", [element("li", _inline(line.removeprefix("- "))) for line in block], class_="definitions")
        else:
            words = " ".join(block)
            yield element("p", _inline(words[:1].upper() + words[1:]), class_="note")


def _parts(text: str) -> Iterator[list[str]]:
    """Runs of lines of one kind: headings, tables, lists, paragraphs."""
    run: list[str] = []
    for line in [*text.splitlines(), ""]:
        kind = line[:1] if line[:1] in "#|" else line[:2] if line[:2] == "- " else "text"
        if run and (not line.strip() or kind != _kind(run[0]) or kind == "#"):
            yield run
            run = []
        if line.strip():
            run.append(line)


def _kind(line: str) -> str:
    return line[:1] if line[:1] in "#|" else line[:2] if line[:2] == "- " else "text"


def _cells(line: str) -> list[str]:
    """The cells of a table's line, in which a bar of the text has a backslash before it."""
    cells = re.split(r"(?<!\\)\|", line.strip().removeprefix("|").removesuffix("|"))
    return [cell.strip().replace("\\|", "|").replace("&lt;", "<") for cell in cells]


def _inline(text: str) -> Html:
    """Words, those between backticks as code."""
    return joined(*(element("code", part) if place % 2 else part for place, part in enumerate(text.split("`"))))


def _table(lines: Sequence[Sequence[str]], label: str) -> Html:
    """A table in which every figure has a column of its own."""
    heads, *rows = lines
    same = heads[0] if len(heads) > WIDE and len({row[0] for row in rows}) == 1 and len(rows) > 1 else None
    if same is not None:  # a column that says the same in all rows takes the place of what one looks for
        said, heads, rows = rows[0][0], heads[1:], [row[1:] for row in rows]
    columns = [_split(head, [row[place] for row in rows]) for place, head in enumerate(heads)]
    flat = [one for column in columns for one in column]
    made = plain_table(
        [head for head, _ in flat], [[_toned(cells[place]) for _, cells in flat] for place in range(len(rows))], label
    )
    return made if same is None else joined(element("p", f"{same[:1].upper()}{same[1:]}: {said}.", class_="note"), made)


def _split(head: str, cells: Sequence[str]) -> list[tuple[str, list[str]]]:
    """A column of several figures, "error mean / p95, m", as one column each; any other column as it is."""
    names, _, unit = head.rpartition(", ") if ", " in head else (head, "", "")
    parts = names.split(" / ")
    figures = [cell.split(" / ") for cell in cells]
    if len(parts) < 2 or any(len(one) not in (1, len(parts)) for one in figures):
        return [(f"{names} ({unit})" if unit in UNITS else head, list(cells))]
    begin = parts[0].rpartition(" ")[0]
    titles = [parts[0], *(f"{begin} {part}".strip() for part in parts[1:])]
    return [
        (f"{title} ({unit})" if unit else title, [one[place] if len(one) == len(parts) else one[0] for one in figures])
        for place, title in enumerate(titles)
    ]


def _toned(cell: str) -> Child:
    tone = "bad" if BAD.match(cell) else "good" if GOOD.match(cell) else None
    return element("span", _inline(cell), class_=tone) if tone else _inline(cell)
