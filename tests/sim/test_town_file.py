"""A large town is read once and kept: what comes from disk is what was read, and a damaged file is made anew."""

import fcntl
import json
import os
from dataclasses import fields, replace

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.sim import town, town_file
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import TownSpec, build_town, read_town
from hippodrome.sim.town_file import kept_town
from hippodrome.sim.town_reader import read_apart
from tests.changes import array_changed


def same(one, other):
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return type(one) is type(other) and one == other


@pytest.fixture
def net_file(tmp_path, monkeypatch):
    monkeypatch.setattr(town_file, "LARGE_BYTES", 0)
    path = tmp_path / "Straße 1.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=3", "--grid.length=80", "--tls.guess", "-o", str(path))
    return path


def with_heights(town):
    outlines = tuple(np.arange(float(len(outline))) for outline in town.junction_polygons_m)
    return replace(town, heights_m=np.arange(float(len(town.network.points_m))), junction_heights_m=outlines, notes=("a\nb", "ü"))


@pytest.mark.parametrize("town_of", [lambda town: town, with_heights], ids=["flat", "with heights"])
def test_a_town_comes_back_as_it_was(tmp_path, net_file, town_of):
    folder = tmp_path / "towns"
    read = town_of(read_town(net_file))
    assert kept_town(net_file, folder, lambda: read) is read
    kept = kept_town(net_file, folder, lambda: pytest.fail("read again"))
    assert same(kept, read) and kept.network.lane_count > 20
    (path,) = folder.glob("kept/*.town.npz")
    whole = path.read_bytes()
    for broken in (whole[:-300], whole[:2000] + bytes(8) + whole[2008:], b""):  # cut, changed, empty
        path.write_bytes(broken)
        assert kept_town(net_file, folder, lambda: read) is read
        assert path.read_bytes() == whole


def test_a_scenario_s_town_is_kept_unless_it_is_refused(tmp_path, net_file):
    folder = tmp_path / "towns"
    first = build_town(TownSpec(network=net_file), 1, folder)
    assert same(first, build_town(TownSpec(network=net_file), 1, folder))
    with pytest.raises(HippodromeError, match="keeps right"):
        build_town(TownSpec(network=net_file, driving_side="left"), 1, folder)
    net_file.write_text(net_file.read_text().replace("<edge ", "<edge x='1' ", 1))
    assert same(first, build_town(TownSpec(network=net_file), 1, folder)) and len(list(folder.glob("kept/*"))) == 2
    net_file.write_text(net_file.read_text()[:4000])
    with pytest.raises(HippodromeError, match="broken network"):
        build_town(TownSpec(network=net_file), 1, folder)
    assert len(list(folder.glob("kept/*"))) == 2


def test_a_large_network_is_read_by_a_process_of_its_own(tmp_path, net_file, monkeypatch):
    """``sumolib``'s objects are hundreds of megabytes that never all come back."""
    monkeypatch.setattr(town, "read_town", lambda *_: pytest.fail("read here"))
    assert same(build_town(TownSpec(network=net_file), 1, tmp_path), read_town(net_file))
    odd = tmp_path / os.fsdecode(b"odd\xff.net.xml")
    odd.write_text("<net><edge")
    with pytest.raises(HippodromeError, match="broken network") as found:
        read_apart(odd, town.READER, refuse)
    assert str(found.value).startswith(f"{odd}: ")
    with pytest.raises(HippodromeError, match="as SUMO says"):
        read_apart(net_file, town.READER, refuse)


def refuse():
    raise HippodromeError("as SUMO says")


def test_a_kept_town_that_was_changed_or_is_another_network_s_is_read_anew(tmp_path, net_file):
    folder, read = tmp_path / "towns", read_town(net_file)
    kept_town(net_file, folder, lambda: read)
    (path,) = folder.glob("kept/*.town.npz")
    whole = path.read_bytes()
    for seed in range(60):
        array_changed(np.random.default_rng(seed), path)  # sums of the archive are right, as of one who did it on purpose
        assert same(kept_town(net_file, folder, lambda: read), read) and path.read_bytes() == whole, seed
    np.savez(path, words=np.array([{"name": "a"}], dtype=object))
    assert kept_town(net_file, folder, lambda: read) is read  # nothing in it is unpickled
    other = tmp_path / "other.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number=2", "--grid.length=90", "-o", str(other))
    kept_town(other, folder, lambda: read_town(other))
    (others,) = folder.glob("kept/other-*.town.npz")
    path.write_bytes(others.read_bytes())
    assert kept_town(net_file, folder, lambda: read) is read


@pytest.mark.parametrize("command", [("scenario", "new", "t", "--from"), ("scenario", "validate")], ids=" ".join)
def test_a_command_that_holds_its_own_folder_does_not_wait_for_itself(tmp_path, net_file, monkeypatch, command):
    """The folder of the town was locked twice by one process: ``scenario new`` of a large network never ended."""
    monkeypatch.chdir(tmp_path)
    scenario = tmp_path / "s.yaml"
    scenario.write_text(f"name: s\ntown: {{network: {json.dumps(str(net_file))}}}\n")
    what = net_file if command[1] == "new" else scenario
    monkeypatch.setattr(town_file, "fcntl", Unwaiting)
    assert main([*command, str(what)]) == 0


class Unwaiting:
    """The system's locks, but what would wait for ever fails."""

    LOCK_EX = fcntl.LOCK_EX

    @staticmethod
    def flock(handle, operation):
        try:
            fcntl.flock(handle, operation | fcntl.LOCK_NB)
        except BlockingIOError:
            pytest.fail("waits for a lock that this process has")
