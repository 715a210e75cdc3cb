"""The programs that docs/methods.md shows, one for each way in, as somebody new would type them."""

import re
import sys
from pathlib import Path

import pytest

from hippodrome.eval.contest.entry import entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform

PAGE = Path(__file__).parents[3] / "docs/methods.md"
LONGEST = 40  # lines of a program
COMMANDS = 5  # that it takes to have rows
METHODS = ("class=my_module:MyMapper", "files=exec:./run.sh {sequence} {out}", f"fed=stream:{sys.executable} client.py")


def program(name):
    """The block of the page that begins with this name."""
    blocks = re.findall(r"```(?:python|sh)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (found,) = (block for block in blocks if re.search(rf"^# {re.escape(name)}(:|$)", block, re.MULTILINE))
    return found


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("my_module.py", "run.sh", "client.py"):
        (tmp_path / name).write_text(program(name))
    (tmp_path / "run.sh").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_each_way_in_has_a_row_and_all_have_the_same(folder, materials):
    entries = entries_of(with_methods(materials.scenario, [parse_method(text) for text in METHODS]))[-3:]
    rows = perform(materials, entries).rows
    assert [row.failure for row in rows] == [None, None, None]
    assert [row.ape.mean_m for row in rows] == pytest.approx([rows[0].ape.mean_m] * 3, abs=1e-6)


def test_each_way_in_is_short(folder):
    for path in folder.iterdir():
        assert len(path.read_text().splitlines()) <= LONGEST, path.name
    for title in ("A Python class", "A program that reads files", "A program that is fed frame by frame"):
        section = PAGE.read_text().partition(f"## {title}\n")[2].partition("\n## ")[0].partition("\n### ")[0]
        commands = re.findall(r"^    (?:hippodrome|chmod) .*$", section, re.MULTILINE)
        assert 2 <= len(commands) <= COMMANDS, title
