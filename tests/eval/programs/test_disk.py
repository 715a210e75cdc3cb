"""What a program keeps on disk is counted: each file once, empty ones as well, and those that it holds open without a name."""

import os
from pathlib import Path

import pytest

from hippodrome.eval.programs.disk import ENTRY_BYTES, Disk


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "before").write_bytes(b"x" * 1_000_000)
    return tmp_path


def test_what_comes_into_a_folder_is_counted_and_what_was_there_is_not(folder):
    disk = Disk(10)
    disk.watch(folder)
    assert disk.kept_bytes() == 0
    (folder / "below").mkdir()
    (folder / "below/after").write_bytes(b"x" * 500_000)
    assert disk.kept_bytes() == pytest.approx(500_000, abs=4 * ENTRY_BYTES)
    disk.watch(folder)  # once more: what was there before stays what it was
    assert disk.kept_bytes() > 400_000


def test_a_file_of_two_names_counts_once_a_link_is_not_followed_and_a_hole_is_nothing(folder):
    disk = Disk(10)
    disk.watch(folder)
    os.link(folder / "before", folder / "again")
    (folder / "away").symlink_to(Path("/"))
    with (folder / "hole").open("wb") as stream:
        stream.truncate(1 << 40)
    assert disk.kept_bytes() <= 3 * ENTRY_BYTES


def test_empty_files_count(folder):
    disk = Disk(10)
    disk.watch(folder)
    for number in range(100):
        (folder / f"{number}").touch()
    assert disk.kept_bytes() == 100 * ENTRY_BYTES


def test_files_that_are_open_for_writing_count_wherever_they_lie(folder, tmp_path_factory):
    disk, elsewhere = Disk(10), tmp_path_factory.mktemp("elsewhere") / "file"
    disk.watch(folder)
    with elsewhere.open("wb") as stream:
        before = disk.kept_bytes([os.getpid()])  # what the tests themselves have open
        stream.write(b"x" * 700_000)
        stream.flush()
        elsewhere.unlink()
        assert disk.kept_bytes([os.getpid()]) - before == pytest.approx(700_000, abs=2 * ENTRY_BYTES)
        assert disk.kept_bytes() == 0


def test_looks_are_not_taken_all_the_time(folder):
    disk = Disk(10)
    disk.watch(folder)
    assert disk.is_due()
    disk.kept_bytes()
    assert not disk.is_due()
