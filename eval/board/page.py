"""``board.html``: the tables of all folders on one page. It asks no server for anything, and its columns sort by a click."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.eval.board.entries import Cell, Drive, Table, read_folders, tables
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.pages import POLICY
from hippodrome.eval.report.tables import scrolling

BOARD: Final = "board.html"
SORT: Final = """
for (const table of document.querySelectorAll('table')) {
  const heads = [...table.querySelectorAll('thead th')];
  heads.forEach((head, column) => head.querySelector('button').addEventListener('click', () => {
    const up = head.getAttribute('aria-sort') !== 'ascending';
    for (const other of heads) other.removeAttribute('aria-sort');
    head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const body = table.tBodies[0];
    const value = row => { const text = row.cells[column].dataset.value; return text === undefined ? null : text; };
    [...body.rows].sort((a, b) => {
      const one = value(a), other = value(b);
      if (one === null || other === null) return (one === null) - (other === null);
      const order = column ? one - other : one.localeCompare(other);
      return up ? order : -order;
    }).forEach(row => body.append(row));
  }));
}
for (const box of document.querySelectorAll('.scroll')) {
  const look = () => box.classList.toggle('more', box.scrollLeft + box.clientWidth < box.scrollWidth - 1);
  box.addEventListener('scroll', look, { passive: true });
  new ResizeObserver(look).observe(box);
}
"""
SEVERAL: Final = (
    " Columns of one scenario's name are of different drives, as something was set otherwise; the letters behind the name are "
    "the begin of the hash of what was set."
)
STYLE: Final = """
tbody :is(th, td) { vertical-align: top; }
td details { margin: 0; text-align: left; white-space: normal; max-width: 26rem; margin-left: auto; }
td summary { margin-left: auto; white-space: nowrap; } td small { display: block; }
"""


def write_board(folders: Sequence[Path], out: Path) -> Path:
    """Write the board of these result folders into ``out``, a file; its path. Raises HippodromeError."""
    write_atomically(out, board_html(tables(read_folders(folders)), folder_names(folders)).encode())
    return out


def folder_names(folders: Sequence[Path]) -> list[str]:
    """The folders' names; the whole path of those that share their name with another."""
    names = [folder.name for folder in folders]
    return [str(folder) if names.count(folder.name) > 1 else folder.name for folder in folders]


def _counted(folders: int) -> str:
    return "one folder" if folders == 1 else f"{folders} folders"


def board_html(made: Sequence[Table], names: Sequence[str]) -> str:
    """The page. The same results give the same bytes."""
    sections = [element("section", element("h2", table.figure.title), _table(table), id=table.figure.key) for table in made]
    links = [element("a", table.figure.title, href=f"#{table.figure.key}") for table in made]
    lede = (
        f"Methods and scenarios of {_counted(len(names))} of results: {', '.join(names)}. "
        "A click on a heading sorts by its column. A cell opens to show its definition, its spread, where it is from and the "
        "command that makes it again."
    )
    lede += SEVERAL if any(_is_twice(drive, _shown(table)) for table in made for drive in table.drives) else ""
    body = element(
        "body",
        element("header", element("h1", "Methods x scenarios"), element("p", lede), element("nav", links)),
        element("main", sections if sections else element("p", "There is no figure in these results.")),
        element("footer", "Made by ", element("code", "hippodrome board DIR...")),
        element("script", Html(SORT)),
    )
    style = (files("hippodrome.eval.report") / "style.css").read_text(encoding="utf-8")
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="color-scheme", content="light dark"),
        element("title", "hippodrome board"),
        element("style", Html(style + STYLE)),
    )
    return "<!doctype html>\n" + element("html", head, body, lang="en") + "\n"


def _table(table: Table) -> Html:
    """Lines of one method that have different definitions are told apart by a number."""
    shown = _shown(table)
    head = element("tr", _sorter("Method", scope="col"), [_heading(drive, shown) for drive in shown])
    rows, count = [], dict[str, int]()
    several = {method for method, _ in table.lines if sum(other == method for other, _ in table.lines) > 1}
    for (method, definition), cells in table.lines.items():
        count[method] = count.get(method, 0) + 1
        name = f"{method} [{count[method]}]" if method in several else method
        first = element("th", name, scope="row", data_value=name, title=definition)
        rows.append(element("tr", first, [_cell(cells.get(drive), definition) for drive in shown]))
    return scrolling(element("table", element("thead", head), element("tbody", rows)), table.figure.title)


def _shown(table: Table) -> list[Drive]:
    """The drives of which the table has a figure."""
    return [drive for drive in table.drives if any(drive in line for line in table.lines.values())]


def _is_twice(drive: Drive, shown: Sequence[Drive]) -> bool:
    return sum(other.name == drive.name for other in shown) > 1


def _heading(drive: Drive, shown: Sequence[Drive]) -> Html:
    """The scenario's name; with its hash where another drive has the same."""
    words = joined(drive.name, element("small", f" {drive.asked[:6]}") if _is_twice(drive, shown) else None)
    return _sorter(words, scope="col", title=drive.asked)


def _sorter(words: str | Html, **attributes: str) -> Html:
    """A heading that sorts by its column, with the keyboard too."""
    return element("th", element("button", words, type="button", class_="sort"), **attributes)


def _cell(cell: Cell | None, definition: str) -> Html:
    if cell is None:
        return element("td", "-")
    lines = [definition, *(f"failed: {cause}" for cause in cell.failures), *(f"refused: {cause}" for cause in cell.refusals)]
    lines += cell.sources
    details = element(
        "details",
        element("summary", _summary(cell)),
        [element("small", line) for line in lines],
        element("code", cell.command),
    )
    value = f"{np.mean(cell.values):.6f}" if cell.values else None
    return element("td", details, data_value=value, class_="bad" if cell.failures or cell.refusals else None)


def _summary(cell: Cell) -> Html:
    """Mean, and the lowest and highest of several values; how many failed or were refused."""
    parts: list[str] = []
    if cell.values:
        parts.append(_figure(float(np.mean(cell.values))))
    if len(cell.values) > 1:
        least, most = _figure(min(cell.values)), _figure(max(cell.values))
        parts.append(f"({len(cell.values)} runs)" if least == most else f"({least} to {most}, {len(cell.values)} runs)")
    parts += [f"{len(cell.failures)} FAILED"] if cell.failures else []
    parts += [f"{len(cell.refusals)} REFUSED"] if cell.refusals else []
    return joined(" ".join(parts))


def _figure(value: float) -> str:
    """Two digits after the point; of less than a hundredth the first digit, as it is not nothing."""
    return f"{value:.2f}" if value == 0.0 or abs(value) >= 0.01 else f"{value:.1g}"
