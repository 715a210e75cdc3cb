"""A cell's folder: what it shares with the others of its sweep is a link."""

from pathlib import Path

from hippodrome.eval.sweep.cell import _share


def test_what_cells_share_is_a_link_whatever_stood_there(tmp_path):
    cell = tmp_path / "cells" / "a"
    (cell / "towns" / "of").mkdir(parents=True)  # as a cell leaves it whose folder was deleted while it ran
    (tmp_path / "towns").mkdir()
    for _ in range(2):
        _share(cell, "towns")
        _share(cell, "recordings")  # not there yet: made by the first drive
        assert (cell / "towns").readlink() == (cell / "recordings").readlink().with_name("towns") == Path("../../towns")
    assert list((cell / "towns").iterdir()) == []
