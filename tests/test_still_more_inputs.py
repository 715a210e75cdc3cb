"""Ten inputs more of logs, stored maps, baselines and layouts of data sets; docs/hostile-inputs.md has the table."""

import gzip
import json
import re
import sqlite3
import struct
from contextlib import closing

import pytest

from hippodrome.eval.gate.baseline import baseline_of, write_baseline
from tests.eval.exchange import subjects
from tests.eval.exchange.subjects import TUM
from tests.eval.results.test_model import results
from tests.test_more_inputs import answer

DONE, BAD_INPUT = 0, 2
MAGIC = b"\x89MCAP0\r\n"


def binary(name, change):
    """A change of a file in a folder, which hits something."""

    def changed(folder):
        before = (folder / name).read_bytes()
        (folder / name).write_bytes(after := change(before))
        assert after != before

    return changed


def text(name, change):
    return binary(name, lambda content: change(content.decode()).encode())


def sql(words):
    def changed(folder):
        with closing(sqlite3.connect(folder / "drive" / "drive.db3")) as database:
            database.execute(words)
            database.commit()

    return changed


def record(opcode, length, body=b""):
    return struct.pack("<BQ", opcode, length) + body


MCAP = {
    "empty": (binary("drive.mcap", lambda _: b""), BAD_INPUT, "it begins with b''"),
    "magic-alone": (binary("drive.mcap", lambda _: MAGIC), BAD_INPUT, "its writer was not closed"),
    "magic-of-version-1": (binary("drive.mcap", lambda data: data.replace(b"MCAP0", b"MCAP1")), BAD_INPUT, "not an MCAP file"),
    "a-record-of-2-to-the-63": (
        binary("drive.mcap", lambda data: MAGIC + record(5, 2**63) + data[8:]),
        BAD_INPUT,
        "damaged at byte 8",
    ),
    "an-opcode-of-nobody": (binary("drive.mcap", lambda data: MAGIC + record(200, 3, b"abc") + data[8:]), DONE, "12 frames"),
    "bytes-after-the-end": (binary("drive.mcap", lambda data: data + b"hello"), BAD_INPUT, "5 bytes after its end"),
    "twice-in-one-file": (binary("drive.mcap", lambda data: data + data), BAD_INPUT, "bytes after its end.*two files in one"),
    "lines-of-windows": (binary("drive.mcap", lambda data: data.replace(b"\r\n", b"\n")), BAD_INPUT, "not an MCAP file"),
    "a-table-named-mcap": (binary("drive.mcap", lambda _: b"t,speed,yaw_rate\n0,1,2\n"), BAD_INPUT, "not an MCAP file"),
    "packed-with-gzip": (binary("drive.mcap", lambda data: gzip.compress(data)), BAD_INPUT, "not an MCAP file"),
}
BAGS = {
    "no-messages": (sql("DELETE FROM messages"), BAD_INPUT, "0 row.s. of self-motion"),
    "times-below-zero": (sql("UPDATE messages SET timestamp = -timestamp"), BAD_INPUT, "earlier than one before it"),
    "all-at-one-time": (sql("UPDATE messages SET timestamp = 5"), DONE, "12 frames"),  # headers have the sensor's time
    "messages-of-nobody": (
        sql("UPDATE messages SET topic_id = 77 WHERE id = 3"),
        BAD_INPUT,
        "1 message.s. of topics that it does not describe",
    ),
    "a-kind-of-nobody": (sql("UPDATE topics SET type = 'a/msg/B' WHERE name = '/odom'"), BAD_INPUT, "0 row.s. of self-motion"),
    "a-topic-twice": (sql("UPDATE topics SET name = '/camera'"), BAD_INPUT, "0 row.s. of self-motion"),
    "words-for-messages": (sql("UPDATE messages SET data = 'hello'"), BAD_INPUT, "message 1 is no message"),
    "half-a-database": (binary("drive/drive.db3", lambda data: data[: len(data) // 2]), BAD_INPUT, "not a readable ROS bag"),
    "a-list-of-other-files": (
        text("drive/metadata.yaml", lambda words: words.replace("drive.db3", "other.db3")),
        BAD_INPUT,
        "files are missing",
    ),
    "a-storage-of-nobody": (text("drive/metadata.yaml", lambda words: words.replace("sqlite3", "papyrus")), BAD_INPUT, "papyrus"),
}
HERE = "sequences/00/"
KITTI = {
    "times-backwards": (
        text(HERE + "times.txt", lambda words: "\n".join(reversed(words.split())) + "\n"),
        BAD_INPUT,
        "does not increase",
    ),
    "times-in-words": (
        text(HERE + "times.txt", lambda words: words.replace("0.300", "three")),
        BAD_INPUT,
        "line 3: not a number in 'three'",
    ),
    "times-of-nan": (
        text(HERE + "times.txt", lambda words: words.replace("0.300", "nan")),
        BAD_INPUT,
        "data row 3 is not finite",
    ),
    "a-time-too-few": (text(HERE + "times.txt", lambda words: words[:-6]), BAD_INPUT, "12 poses for 11 times"),
    "a-focal-length-of-zero": (
        text(HERE + "calib.txt", lambda words: words.replace(": 20 0", ": 0 0")),
        BAD_INPUT,
        "a focal length of 0 pixels",
    ),
    "no-calibration-in-it": (text(HERE + "calib.txt", lambda _: "hello\n"), DONE, "12 frames"),
    "an-origin-of-nan": (text(HERE + "origin.txt", lambda words: words.replace("5", "nan")), BAD_INPUT, "is not finite"),
    "an-origin-that-shears": (
        text(HERE + "origin.txt", lambda words: words.replace("0 0 1 5", "0 9 1 5")),
        BAD_INPUT,
        "is no rotation",
    ),
    "poses-of-eleven-columns": (
        text("poses/00.txt", lambda words: words.replace(" 0 1 0 ", " 0 1 ", 1)),
        BAD_INPUT,
        "11 columns, expected 12",
    ),
    "poses-of-one-row": (text("poses/00.txt", lambda words: words.splitlines()[0] + "\n"), BAD_INPUT, "1 poses for 12 times"),
}
FIELDS = {
    "nan": (
        lambda row: row["figures"]["APE mean (m)"].update(value=float("nan")),
        BAD_INPUT,
        "APE mean .m.*must be a finite number",
    ),
    "no-figures": (lambda row: row.update(figures={}), BAD_INPUT, "has no APE mean"),
    "a-figure-below-zero": (
        lambda row: row["figures"]["APE mean (m)"].update(value=-1.0),
        BAD_INPUT,
        "APE mean .m. is -1, which no error is",
    ),
    "a-figure-of-zero": (lambda row: row["figures"]["APE mean (m)"].update(value=0.0), DONE, "same|no worse"),
    "a-subnormal-figure": (lambda row: row["figures"]["APE mean (m)"].update(value=5e-324), DONE, "no worse"),
    "a-huge-figure": (
        lambda row: row["figures"]["APE mean (m)"].update(value=1e308),
        BAD_INPUT,
        r"is 1e\+308, which no error is",
    ),
    "words-for-a-seed": (lambda row: row.update(seed="three"), BAD_INPUT, "seed: must be a whole number"),
    "a-seed-of-a-half": (lambda row: row.update(seed=0.5), BAD_INPUT, "seed: must be a whole number"),
    "a-key-of-nobody": (lambda row: row.update(nobody=1), BAD_INPUT, "nobody: unknown key"),
    "a-method-of-terminal-commands": (lambda row: row.update(method="\x1b]0;x\x07[red]"), DONE, "no worse"),
}
MAPS = {
    "empty": (lambda _: b"", BAD_INPUT, "not a hippodrome map"),
    "a-magic-number-alone": (lambda data: data[:8], BAD_INPUT, "truncated inside the format version"),
    "half": (lambda data: data[: len(data) // 2], BAD_INPUT, "record 1 lacks"),
    "a-byte-short": (lambda data: data[:-1], BAD_INPUT, "truncated inside the checksum"),
    "a-byte-more": (lambda data: data + b"x", BAD_INPUT, "1 bytes after the end of the map"),
    "twice": (lambda data: data + data, BAD_INPUT, "bytes after the end of the map"),
    "one-bit": (lambda data: data[:2000] + bytes([data[2000] ^ 4]) + data[2001:], BAD_INPUT, "checksum differs"),
    "packed-with-gzip": (lambda data: gzip.compress(data), BAD_INPUT, "not a hippodrome map"),
    "lines-of-windows": (lambda data: data.replace(b"\n", b"\r\n"), BAD_INPUT, "not a hippodrome map"),
    "a-trajectory-named-pbstream": (lambda _: TUM.encode(), BAD_INPUT, "not a hippodrome map"),
}


def three_seeds():
    """The same results with three seeds: the fewest pairs that the gate can tell anything from."""
    one = results()
    seeds = ([scenario.model_copy(update={"seed": seed}) for scenario in one.scenarios] for seed in (1, 2, 3))
    return baseline_of([one.model_copy(update={"scenarios": scenarios}) for scenarios in seeds])


def held(got, status, said):
    assert got[0] == status and re.search(said, got[1]), got


@pytest.mark.parametrize("name", MCAP)
def test_mcap_files(tmp_path, capsys, name):
    subjects._mcap(tmp_path)
    change, *wanted = MCAP[name]
    change(tmp_path)
    held(answer(capsys, "import", tmp_path / "drive.mcap", "--out", tmp_path / "out"), *wanted)


@pytest.mark.parametrize("name", BAGS)
def test_bags(tmp_path, capsys, name):
    subjects._ros(tmp_path, 2)
    change, *wanted = BAGS[name]
    change(tmp_path)
    held(answer(capsys, "import", tmp_path / "drive", "--out", tmp_path / "out"), *wanted)


@pytest.mark.parametrize("name", KITTI)
def test_the_layout_of_kitti(tmp_path, capsys, name):
    subjects._kitti(tmp_path)
    change, *wanted = KITTI[name]
    change(tmp_path)
    held(answer(capsys, "import", tmp_path / "sequences/00", "--from", "kitti", "--out", tmp_path / "out"), *wanted)


@pytest.mark.parametrize("name", FIELDS)
def test_baselines(tmp_path, capsys, name):
    path = tmp_path / "base.json"
    write_baseline(path, three_seeds())
    data = json.loads(path.read_text())
    change, *wanted = FIELDS[name]
    for row in data["cells"]:
        if row["figures"]:
            change(row)
            method = row["method"]
    path.write_text(json.dumps(data))
    held(answer(capsys, "gate", "--power", method, "--baseline", path), *wanted)


@pytest.fixture(scope="module")
def mapped(made):
    from hippodrome.eval.cli import main

    assert main(["map", str(made / "rec"), "--out", str(made / "a.pbstream")]) == 0
    return made


@pytest.mark.parametrize("name", MAPS)
def test_stored_maps(mapped, tmp_path, capsys, name):
    change, *wanted = MAPS[name]
    (tmp_path / "a.pbstream").write_bytes(change((mapped / "a.pbstream").read_bytes()))
    words = ("--network", mapped / "a.net.xml", "--out", tmp_path / "b.pbstream")
    held(answer(capsys, "refine", tmp_path / "a.pbstream", *words), *wanted)
