"""Files are whole or absent, and hashes of code tell a changed, a renamed and a new file."""

import ast
import ctypes
import hashlib
import os
import sys
from pathlib import Path

import pytest

from hippodrome import _files, _folders, _native
from hippodrome._files import code_sha256, replacing, sha256_of, write_atomically
from hippodrome.core.types import HippodromeError


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_takes_its_name_when_the_block_ends(tmp_path):
    path = tmp_path / "new" / "a.txt"
    with replacing(path) as temporary:
        temporary.write_text("whole")
        assert not path.exists()
        assert temporary.parent == path.parent
    assert path.read_text() == "whole"
    assert path.stat().st_mode & 0o777 == 0o644
    assert names(path.parent) == ["a.txt"]


def test_the_reason_of_an_unreadable_file_is_in_words_and_names_no_file(tmp_path):
    with pytest.raises(OSError, match="No such file") as told:
        _files.read_bounded(tmp_path / "none", 9)
    assert _files.why_unreadable(told.value) == "No such file or directory"
    assert _files.why_unreadable(OSError("not a regular file")) == "not a regular file"
    assert _files.why_unreadable(ValueError("two\nlines")) == "two lines"
    assert _files.why_unreadable(RecursionError()) == "RecursionError"
    for data, words in ((b"a\xe9", "not UTF-8 text (byte 1); save it as UTF-8"), ("a".encode("utf-16"), "UTF-16 text; save"),
                        (b"PK\x03\x04\xff", "packed by zip"), (b"\x1f\x8b\x08\xff", "packed by gzip; unpack it")):  # fmt: skip
        with pytest.raises(UnicodeDecodeError) as told:
            data.decode()
        assert _files.why_unreadable(told.value).startswith(words)


def test_an_error_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("precious")
    with pytest.raises(KeyError), replacing(path) as temporary:
        temporary.write_text("half")
        raise KeyError
    assert path.read_text() == "precious"
    assert names(tmp_path) == ["a.txt"]


def test_what_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HippodromeError, match=r"file/a\.txt: cannot be written: (Not a directory|File exists)"):
        write_atomically(tmp_path / "file" / "a.txt", b"x")
    with pytest.raises(HippodromeError, match=r": cannot be written: Is a directory"):
        (tmp_path / "folder").mkdir()
        write_atomically(tmp_path / "folder", b"x")
    assert names(tmp_path) == ["file", "folder"]
    write_atomically(tmp_path / "a.txt", b"one")
    write_atomically(tmp_path / "a.txt", b"two")
    assert (tmp_path / "a.txt").read_bytes() == b"two"


def test_a_files_hash_is_sha256(tmp_path):
    (tmp_path / "a").write_bytes(b"x" * 1_000_000)
    assert sha256_of(tmp_path / "a") == hashlib.sha256(b"x" * 1_000_000).hexdigest()


def test_the_hash_of_code_is_of_names_and_contents_also_behind_a_link(tmp_path):
    def hashed(name, change=lambda root: None):
        root = tmp_path / name
        (root / "part" / "inner").mkdir(parents=True)
        (root / "part" / "a.py").write_text("a = 1")
        (root / "part" / "inner" / "b.py").write_text("b = 1")
        (root / "other.py").write_text("c = 1")
        change(root)
        return code_sha256(root, ["part/**/*.py"])

    first = hashed("one")
    assert len(first) == 16
    assert hashed("same") == first
    assert hashed("unasked", lambda root: (root / "other.py").write_text("c = 2")) == first
    changed = {
        hashed("changed", lambda root: (root / "part" / "inner" / "b.py").write_text("b = 2")),
        hashed("renamed", lambda root: (root / "part" / "a.py").rename(root / "part" / "c.py")),
        hashed("new", lambda root: (root / "part" / "inner" / "d.py").write_text("")),
    }
    assert len(changed | {first}) == 4
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "part").symlink_to(tmp_path / "one" / "part")
    assert code_sha256(tmp_path / "linked", ["part/**/*.py"]) == first


def test_it_lies_beneath_all_parts():
    """They import the standard library, each other and the error of ``core.types``, so that every part may import them."""
    found = set()
    for module in (_files, _folders, _native):
        for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom | ast.Import):
                found |= {node.module} if isinstance(node, ast.ImportFrom) else {alias.name for alias in node.names}
    beneath = {"hippodrome.core.types", "hippodrome._folders"}
    assert {name for name in found if name.split(".")[0] not in sys.stdlib_module_names} == beneath


def test_what_was_freed_goes_back_to_the_system():
    status = Path("/proc/self/status")
    if not status.exists() or not hasattr(ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("this C library keeps what is freed, or this system does not say what a process holds")

    def held_bytes():
        return 1024 * int(status.read_text().partition("VmRSS:")[2].split()[0])

    pieces = [bytes(60_000) for _ in range(2_000)]  # small enough for the heap, 120 MB together
    del pieces[:-1]  # the last one lies above the others
    _native.give_back_memory()
    before = held_bytes()
    pieces = [bytes(60_000) for _ in range(2_000)]
    assert held_bytes() - before > 60e6
    del pieces[:-1]
    _native.give_back_memory()
    assert held_bytes() - before < 20e6


def test_what_native_libraries_say_is_unheard_and_the_rest_is_not(capfd):
    with _native.unheard():
        os.write(2, b"libpng error: bad adaptive filter value")
    os.write(2, b"said by us")
    with pytest.raises(ValueError, match="x"), _native.unheard():
        raise ValueError("x")
    os.write(2, b" and again")
    assert capfd.readouterr().err == "said by us and again"
