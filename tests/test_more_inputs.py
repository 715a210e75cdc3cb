"""Ten more inputs of each kind that programs stumble over, with what comes of each; docs/hostile-inputs.md has the table.

Each is made here, of a few lines, and goes through the command line. A row says what the last line of the answer holds.
"""

import gzip
import json
import re
import shutil

import numpy as np
import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.results.model import write_results
from hippodrome.sim.recording import MANIFEST
from hippodrome.sim.recording_checks import CHECKSUM
from tests.eval.exchange.subjects import TUM
from tests.eval.results.test_model import results
from tests.sim.test_map_import import BLOCK
from tests.subjects import TINY, resealed

ROWS = TUM.splitlines()


def answer(capsys, *command):
    """Exit status and the one line of a refusal, or what was printed."""
    capsys.readouterr()
    status = main([str(word) for word in command])
    said = capsys.readouterr()
    assert status in (DONE, BAD_INPUT) and "Traceback" not in said.err
    if status == BAD_INPUT:
        assert len(said.err.strip().splitlines()) == 1, said.err
    return status, said.err if status == BAD_INPUT else said.out


def columns(text, change):
    return "\n".join(" ".join(change(line.split())) for line in text.splitlines()) + "\n"


TRAJECTORIES = {
    "windows-lines": (TUM.replace("\n", "\r\n"), DONE, "APE"),
    "tabs": (TUM.replace(" ", "\t"), DONE, "APE"),
    "comments-between": (TUM.replace("\n", "\n# a comment\n"), DONE, "APE"),
    "quaternion-twice-as-long": (columns(TUM, lambda w: [*w[:4], *(repr(2 * float(one)) for one in w[4:])]),
                                 BAD_INPUT, "unit quaternion"),
    "quaternion-of-zeros": (columns(TUM, lambda w: [*w[:4], "0", "0", "0", "0"]), BAD_INPUT, "unit quaternion"),
    "utf-16": (TUM.encode("utf-16"), BAD_INPUT, "cannot be read as text"),
    "commas-for-points": (TUM.replace(".", ","), BAD_INPUT, "is no number"),
    "a-word-for-a-time": (TUM.replace(ROWS[3].split()[0], "now", 1), BAD_INPUT, "is no number"),
    "times-backwards": ("\n".join(reversed(ROWS)) + "\n", BAD_INPUT, "does not increase; sort"),
    "nothing-but-comments": ("# t x y z qx qy qz qw\n", BAD_INPUT, "no poses"),
}  # fmt: skip


@pytest.mark.parametrize("name", TRAJECTORIES)
def test_trajectories(made, tmp_path, capsys, name):
    content, status, said = TRAJECTORIES[name]
    path = tmp_path / "a.tum"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    got = answer(capsys, "score", path, made / "rec")
    assert got[0] == status and re.search(said, got[1]), got


SCENARIOS = {
    "a-list": ("- name: a\n", "a scenario is a mapping"),
    "a-key-twice": (TINY + "seed: 4\n", ":7: seed: given twice, first in line 2"),
    "a-tab": ("name: a\n\tseed: 1\n", ":2: not valid YAML"),
    "python-object": ("name: !!python/object/apply:os.system [ls]\n", ":1: not valid YAML: could not determine"),
    "two-documents": (TINY + "---\n" + TINY, ":7: not valid YAML: but found another document"),
    "alias-to-itself": ("name: &a [*a]\n", "an alias stands for what it is a part of"),
    "billion-laughs": ("a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(f"{b}: &{b} [{','.join(9 * ['*' + a])}]\n" for a, b in
                       zip("abcdefg", "bcdefgh", strict=True)), "aliases and merge keys make"),
    "deep": ("name: " + "[" * 20_000, "nested too deeply"),
    "binary": (TINY.replace("seed: 3", "seed: !!binary aGVsbG8="), ":2: seed: must be a whole number"),
    "infinity": (TINY.replace("rate_hz: 5", "rate_hz: .inf"), ":4: camera.rate_hz: must be a finite number"),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios(tmp_path, capsys, name):
    content, said = SCENARIOS[name]
    path = tmp_path / "a.yaml"
    path.write_text(content)
    status, got = answer(capsys, "scenario", "validate", path)
    assert status == BAD_INPUT and f"{path}" in got and re.search(said, got)


def swap(pattern, by, count=1):
    """A change of the text that hits something."""

    def changed(text):
        found = re.sub(pattern, by, text, count=count, flags=re.DOTALL)
        assert found != text
        return found

    return changed


NETWORKS = {
    "utf-16": (lambda text: text.encode("utf-16"), "not a SUMO network"),
    "no-end": (lambda text: text[: len(text) // 2], "broken network .*unclosed token"),
    "two-roots": (lambda text: text + text[text.index("<net") :], "junk after document element"),
    "one-point": (swap(r'(<lane [^>]*shape=")[^ "]* [^"]*"', r'\1 1,1"'), "Shape of lane .* is broken"),
    "no-lanes": (swap(r"<lane [^>]*/>", "", 0), "a lane is named that its edge does not have"),
    "same-name-twice": (swap(r'<edge id="A1A0"', '<edge id="A0A1"'), "'A1A0' is named and not described"),
    "to-nowhere": (swap(r'(<edge id="A0A1"[^>]*to=")A1', r"\1nowhere"), "junction 'nowhere', which the file does not describe"),
    "length-of-zero": (swap(r'(<lane id="A0A1_0"[^>]*length=")[^"]*', r"\g<1>0"), "lane 'A0A1_0'"),
    "connection-to-no-lane": (
        swap(r'(<connection from="A0A1"[^>]*toLane=")0', r"\g<1>7"),
        "a lane is named that its edge does not have",
    ),
    "entity": (swap(r"<net ", '<!DOCTYPE net [<!ENTITY a "b">]><net '), "entit"),
}


@pytest.mark.parametrize("name", NETWORKS)
def test_networks(made, tmp_path, capsys, name):
    change, said = NETWORKS[name]
    path = tmp_path / "a.net.xml"
    content = change((made / "a.net.xml").read_text())
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    status, got = answer(capsys, "scenario", "new", "town", "--from", path, "--out", tmp_path / "town.yaml")
    assert status == (BAD_INPUT if said else DONE) and re.search(said, got)


MAPS = {
    "packed-twice.osm.gz": (gzip.compress(gzip.compress(BLOCK.encode())), ""),
    "not-packed.osm.gz": (BLOCK.encode(), ""),
    "packed.osm": (gzip.compress(BLOCK.encode()), ""),
    "cut.osm.gz": (gzip.compress(BLOCK.encode())[:-20], "ended before the end-of-stream"),
    "nodes-only.osm": (re.sub(r"<way.*</way>", "", BLOCK, flags=re.DOTALL).encode(), "holds no roads for cars"),
    "way-of-unknown-nodes.osm": (BLOCK.replace('<nd ref="', '<nd ref="9').encode(), "is not known"),
    "latitude-of-900.osm": (re.sub(r'lat="[^"]*"', 'lat="900"', BLOCK, count=1).encode(), "holds no roads for cars"),
    "all-in-one-place.osm": (re.sub(r'lon="[^"]*"', 'lon="1"', re.sub(r'lat="[^"]*"', 'lat="1"', BLOCK)).encode(), "only 1 node"),
    "words.xodr": (b"hello", "it has no XML element; is it whole"),
    "empty.xodr": (b"<OpenDRIVE/>", "holds no roads for cars"),
    "net-in-disguise.osm": (b"<net version='1.20'/>", "it begins with <net>, and OpenStreetMap with <osm>"),
}


@pytest.mark.parametrize("name", MAPS)
def test_maps(tmp_path, capsys, name):
    content, said = MAPS[name]
    (tmp_path / name).write_bytes(content)
    status, got = answer(capsys, "scenario", "new", "town", "--from", tmp_path / name, "--out", tmp_path / "town.yaml")
    assert status == (BAD_INPUT if said else DONE) and re.search(said, got)


def leaf(*path, value):
    """A results file with one value changed."""

    def changed(data):
        place = data
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        return json.dumps(data)

    return changed


RESULTS = {
    "nan": (leaf("scenarios", 0, "rows", 0, "ape", "mean_m", value=float("nan")), "mean_m: must be a finite number"),
    "a-word": (leaf("scenarios", 0, "rows", 0, "ape", "mean_m", value="small"), "mean_m: must be a number"),
    "a-list": (lambda _: "[]", "top level: takes keys of its own"),
    "null": (lambda _: "null", "top level: takes keys of its own"),
    "no-scenarios": (leaf("scenarios", value=[]), ""),
    "a-name-of-escapes": (leaf("scenarios", 0, "name", value="\x1b]0;x\x07[red]\u202e"), ""),
    "a-name-of-a-path": (leaf("scenarios", 0, "name", value="../../../tmp/x"), ""),
    "same-twice": (lambda data: json.dumps({"scenarios": data["scenarios"] * 2}), ""),
    "deep": (lambda _: "[" * 100_000, "not a readable results file"),
    "later-fields": (leaf("scenarios", 0, "invented", value={"a": [1, None]}), ""),
}


@pytest.mark.parametrize("name", RESULTS)
def test_results(tmp_path, capsys, name):
    for folder in ("a", "b"):
        write_results(tmp_path / folder / "results.json", results())
    path = tmp_path / "b" / "results.json"
    change, said = RESULTS[name]
    path.write_text(change(json.loads(path.read_text())))
    for command in (("compare", tmp_path / "a", tmp_path / "b"), ("report", tmp_path / "b")):
        status, got = answer(capsys, *command)
        if command[0] == "report" or said:  # that nothing is there to be compared is an answer too
            assert status == (BAD_INPUT if said else DONE) and re.search(said, got)
        assert "\x1b]" not in got and "\u202e" not in got
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def arrays(**changed):
    def change(folder):
        with np.load(folder / "samples.npz") as data:
            whole = dict(data)
        np.savez(folder / "samples.npz", **{**whole, **{key: value(whole[key]) for key, value in changed.items()}})

    return change


def manifest(**changed):
    def change(folder):
        found = json.loads((folder / MANIFEST).read_text())
        (folder / MANIFEST).write_text(json.dumps({**found, **changed}))

    return change


def folder_for_frames(folder):
    (folder / "frames-0000.zip").unlink()
    (folder / "frames-0000.zip").mkdir()


RECORDINGS = {
    "times-of-a-year": (arrays(t_s=lambda t_s: t_s * 1e6), "is not the time since the step before"),
    "times-twice": (arrays(t_s=lambda t_s: np.repeat(t_s[::2], 2)), "followed by an earlier or the same one"),
    "big-endian": (arrays(speed=lambda speed: speed.astype(">f8")), ""),
    "half-precision": (arrays(speed=lambda speed: speed.astype("f2")), ""),
    "fortran-order": (arrays(poses_m=np.asfortranarray), ""),
    "pickled": (arrays(lane_ids=lambda _: np.array([{}], dtype=object)), "allow_pickle"),
    "format-2": (manifest(format=2), "recording format 2, this version reads 1"),
    "checksum-of-zeros": (manifest(**{CHECKSUM: "0" * 64}), "manifest_sha256 does not hold"),
    "camera-of-words": (manifest(camera="wide"), ""),
    "frames-are-a-folder": (folder_for_frames, "named in the manifest and not there"),
}


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings(made, tmp_path, capsys, name):
    shutil.copytree(made / "rec", tmp_path / "rec")
    change, said = RECORDINGS[name]
    change(tmp_path / "rec")
    if "checksum" not in name:
        resealed(np.random.default_rng(0), tmp_path)
    status, got = answer(capsys, "map", tmp_path / "rec", "--out", tmp_path / "a.pbstream")
    assert status == (BAD_INPUT if said else DONE) and re.search(said, got)
