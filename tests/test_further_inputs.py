"""Further inputs of each kind, beside those of tests/test_more_inputs.py; docs/hostile-inputs.md has the table."""

import gzip
import json
import os
import re
import shutil
import warnings
import zipfile

import cv2
import numpy as np
import pytest

from hippodrome.eval.results.model import write_results
from tests.eval.exchange import subjects
from tests.eval.exchange.subjects import COUNT, HEADER, ODOMETRY, PNG, TUM
from tests.eval.results.test_model import results
from tests.subjects import TINY, resealed
from tests.test_more_inputs import answer, arrays

DONE, BAD_INPUT = 0, 2
ROWS = TUM.splitlines()
TRAJECTORIES = {
    "bom-and-windows-lines": (b"\xef\xbb\xbf" + TUM.replace("\n", "\r\n").encode(), DONE, "APE"),
    "negative-zeros": (TUM.replace(" 0 0 0 ", " -0.0 -0 -0e5 ").encode(), DONE, "mean 0.8"),
    "subnormal-numbers": (TUM.replace(" 0 0 0 ", " 5e-324 1e-310 -5e-324 ").encode(), DONE, "mean 0.8"),
    "opposite-quaternions": ("\n".join(" ".join([*r.split()[:4], *(f"-{x}" for x in r.split()[4:])]) for r in ROWS)
                             .replace("--", "").encode(), DONE, "mean 0.8"),
    "beyond-all-floats": (TUM.replace(ROWS[3].split()[1], "1e400", 1).encode(), BAD_INPUT, "position is not finite"),
    "one-long-line": (" ".join(TUM.split()).encode(), BAD_INPUT, "96 columns"),
    "nul-bytes": (TUM.replace("\n", "\0\n").encode(), BAD_INPUT, "is no number"),
    "latin-1": (b"# caf\xe9\n" + TUM.encode(), BAD_INPUT, "cannot be read as text: not UTF-8 text .byte 5.; save it as UTF-8"),
    "hexadecimal": (TUM.replace("0.100 ", "0x1 ").encode(), BAD_INPUT, "is no number"),
    "packed": (gzip.compress(TUM.encode()), BAD_INPUT, "cannot be read as text: packed by gzip; unpack it"),
}  # fmt: skip
# Tables of self-motion, and what is said of them.
ODOMETRIES = {
    "one-column": ("t_s\n" + "".join(f"{row.split(',')[0]}\n" for row in ODOMETRY.splitlines()), "names no column"),
    "columns-exchanged": ("# t, yaw, speed\n" + ODOMETRY, "line 1: the header names its columns t, yaw, speed"),
    "unknown-turns": ("t_s,speed,yaw_rate [turns/h]\n" + ODOMETRY, "its unit 'turns_h' is not known"),
    "two-brackets": ("time,speed (OBD)(km/h),gyro_z\n" + ODOMETRY, "names no column"),
    "a-year-between": (HEADER + "0,5,0\n31536000,5,0\n", "comes 31536000.0 s after"),
    "a-million-million-a-second": (HEADER + "".join(f"{n * 1e-12:.15f},5,0\n" for n in range(1, 13)), "closer than any sensor"),
    "subnormal-speeds": (HEADER + ODOMETRY.replace("5.0", "5e-324"), "which no sensor tells from zero"),
    "semicolons-and-commas": ((HEADER + ODOMETRY).replace(",", ";").replace(".", ","), "numbers have a point, as 1.5"),
    "times-of-day": (HEADER + "12:00:01,5,0\n" + ODOMETRY, "times are seconds, not dates or times of day"),
}
FIXES = {
    "f.gpx": [(lambda text: re.sub("<time>.*?</time>", "", text), "12 track point.s. without a time"),
              (lambda text: text.replace("2023", "0000"), "neither seconds nor a date")],
    "f.nmea": [(lambda text: text.replace(",A\n", ",A*00\n"), "12 sentence.s. with a wrong checksum"),
               (lambda text: re.sub(r"A,49\d\d", "A,4999", text), "minutes of arc, a degree has 60")],
    "f.csv": [(lambda text: text.replace("49.", "4" * 200_000, 1), "field larger than field limit"),
              (lambda text: text.replace("49.", "\0", 1), "line 2: .* is not a number")],
}  # fmt: skip
SCENARIOS = {
    "letters-of-another-alphabet": (TINY.replace("seed:", "s\u0435ed:"), "unknown key; did you mean seed"),
    "a-space-of-no-width": (TINY.replace("seed:", "seed\u200b:"), "unknown key; did you mean seed"),
    "an-anchor-of-5000-digits": ("x: &a " + 5000 * "9" + "\n" + TINY.replace("seed: 3", "seed: *a"), "5000 characters"),
    "a-subnormal-rate": (TINY.replace("rate_hz: 5", "rate_hz: 5e-324"), "must be a number of at least 0.01"),
    "a-merge-with-itself": ("a: &a\n  <<: *a\n" + TINY, "an alias stands for what it is a part of"),
    "itself-as-network": (TINY.replace("{kind: grid, width_m: 150, height_m: 150, road_km: 1.2}", "{network: a.yaml}"),
                          "not a SUMO network"),
}  # fmt: skip
NAMES = [b"new\nline", b"esc\x1b[31m", b"bad\xff", b"per%cent {0}", b"it's: #x", b"- a", "\u202eright-to-left".encode()]


@pytest.mark.parametrize("name", TRAJECTORIES)
def test_trajectories(made, tmp_path, capsys, name):
    content, status, said = TRAJECTORIES[name]
    (tmp_path / "a.tum").write_bytes(content)
    got = answer(capsys, "score", tmp_path / "a.tum", made / "rec")
    assert got[0] == status and re.search(said, got[1]), got


@pytest.mark.parametrize("name", ODOMETRIES)
def test_tables_of_self_motion(tmp_path, capsys, name):
    content, said = ODOMETRIES[name]
    (tmp_path / "o.csv").write_text(content)
    status, got = answer(capsys, "import", tmp_path / "o.csv", "--out", tmp_path / "out")
    assert status == BAD_INPUT and re.search(said, got)


def test_an_unknown_unit_of_speed_is_said_since_the_map_has_metres_anyway(tmp_path, capsys):
    (tmp_path / "o.csv").write_text("t_s,speed [furlong],yaw_rate [rad/s]\n" + ODOMETRY)
    status, got = answer(capsys, "import", tmp_path / "o.csv", "--out", tmp_path / "out")
    assert status == DONE and "its unit 'furlong' is not known; the numbers are taken as they are" in got


@pytest.mark.parametrize(("name", "change", "said"), [(name, *one) for name, changes in FIXES.items() for one in changes])
def test_fixes(tmp_path, capsys, name, change, said):
    subjects._fixes(name)(tmp_path)
    path = tmp_path / name
    path.write_text(change(path.read_text()))
    status, got = answer(capsys, "import", tmp_path / "o.csv", "--from", "odometry", "--truth", path, "--out", tmp_path / "out")
    assert status == BAD_INPUT and re.search(said, got)


def test_accuracies_that_are_none_are_counted(tmp_path, capsys):
    subjects._fixes("f.csv")(tmp_path)
    path = tmp_path / "f.csv"
    path.write_text(path.read_text().replace(",2.5", ",-2.5"))
    status, got = answer(capsys, "import", tmp_path / "o.csv", "--from", "odometry", "--truth", path, "--out", tmp_path / "out")
    assert status == DONE and "12 fix(es) have an accuracy that is none (-2.5 m): taken as not known" in got


@pytest.mark.parametrize(("head", "row", "said"), [
    ("#yaw_rate,timestamp [ns],speed", "0.2,{0},5.0", ""),
    ("#timestamp [ns],speed [m/s],yaw_rate [deg/s]", "{0},5.0,11.459155902616466", ""),
    ("#timestamp [ns],yaw,speed", "{0},0.2,5.0", "name all three"),
])  # fmt: skip
def test_the_columns_of_euroc_are_those_of_its_header(tmp_path, capsys, head, row, said):
    subjects._euroc(tmp_path / "a")
    table = tmp_path / "a" / "mav0" / "odometry0" / "data.csv"
    stamps = [line.split(",")[0] for line in table.read_text().splitlines()[1:]]
    table.write_text("\n".join([head, *map(row.format, stamps)]) + "\n")
    status, got = answer(capsys, "import", tmp_path / "a", "--out", tmp_path / "out")
    assert status == (BAD_INPUT if said else DONE) and said in got
    if not said:
        with np.load(tmp_path / "out" / "samples.npz") as data:
            assert np.allclose(data["speed"], 5.0) and np.allclose(data["yaw_rate_radps"], 0.2)


@pytest.mark.parametrize("topic", ["/odom", "/camera"])
def test_a_message_of_no_bytes_is_none(tmp_path, capsys, topic, monkeypatch):
    rows = [(name, message) for name, message in subjects._foxglove()]
    kind = next(type(message) for name, message in rows if name == topic)
    monkeypatch.setattr(subjects, "_foxglove", lambda: iter(
        [(name, kind() if name == topic and number == 6 + (topic == "/camera") * 2 else message)
         for number, (name, message) in enumerate(rows)]))  # fmt: skip
    subjects._mcap(tmp_path)
    status, got = answer(capsys, "import", tmp_path / "drive.mcap", "--out", tmp_path / "out")
    assert status == BAD_INPUT and "a message of no bytes" in got


def test_rows_of_a_bag_are_measured_before_they_are_read(tmp_path, capsys):
    import sqlite3
    from contextlib import closing

    subjects._ros(tmp_path, 2)
    with closing(sqlite3.connect(tmp_path / "drive" / "drive.db3")) as database:
        database.execute("UPDATE messages SET data = zeroblob(170000000) WHERE id = 3")
        database.commit()
    status, got = answer(capsys, "import", tmp_path / "drive", "--out", tmp_path / "out")
    assert status == BAD_INPUT and "message 3 is no message, or has more than" in got


def test_names_of_topics_do_not_command_the_terminal(tmp_path, capsys, monkeypatch):
    rows = [(f"{name}\x1b]0;x\x07\nevil", message) for name, message in subjects._foxglove()]
    monkeypatch.setattr(subjects, "_foxglove", lambda: iter(rows))
    subjects._mcap(tmp_path)
    status, got = answer(capsys, "import", tmp_path / "drive.mcap", "--out", tmp_path / "out")
    assert status == DONE and "\x1b" not in got and "\nevil" not in got


@pytest.mark.parametrize(("name", "change", "said"), [
    ("1x100000", lambda folder: (folder / "3.png").write_bytes(cv2.imencode(".png", np.zeros((100_000, 1), np.uint8))[1]),
     "1 x 100000 pixels"),
    ("cut", lambda folder: (folder / "3.png").write_bytes(PNG[: len(PNG) // 2]), "not an image|not a whole PNG"),
    ("a-part-of-2-GiB", lambda folder: (folder / "3.png").write_bytes(PNG[:33] + b"\x7f\xff\xff\xff" + PNG[37:]),
     "its part IDAT claims 2147483647 bytes"),
    ("empty", lambda folder: (folder / "3.png").write_bytes(b""), "not an image of a known kind .0 bytes"),
    ("folder", lambda folder: ((folder / "3.png").unlink(), (folder / "3.png").mkdir()), "Is a directory"),
])  # fmt: skip
def test_images(tmp_path, capsys, name, change, said):
    (tmp_path / "i").mkdir()
    for number in range(COUNT):
        (tmp_path / "i" / f"{number}.png").write_bytes(PNG)
    (tmp_path / "o.csv").write_text(HEADER + ODOMETRY)
    change(tmp_path / "i")
    words = ("--fps", "10", "--odometry", tmp_path / "o.csv", "--out", tmp_path / "out")
    status, got = answer(capsys, "import", tmp_path / "i", *words)
    assert status == BAD_INPUT and re.search(said, got)


@pytest.mark.parametrize(("count", "share", "said"), [(0, 1.0, "no frame in it"), (12, 0.5, "of the 12 frames that its header")])
def test_videos(tmp_path, capsys, count, share, said):
    writer = cv2.VideoWriter(str(tmp_path / "a.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (48, 32))
    rng = np.random.default_rng(0)
    for _ in range(count):
        writer.write(rng.integers(0, 256, (32, 48, 3), np.uint8))
    writer.release()
    (tmp_path / "o.csv").write_text(HEADER + ODOMETRY)
    content = (tmp_path / "a.avi").read_bytes()
    (tmp_path / "a.avi").write_bytes(content[: int(share * len(content))])
    _, got = answer(capsys, "import", tmp_path / "a.avi", "--odometry", tmp_path / "o.csv", "--out", tmp_path / "out")
    assert said in got


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios(tmp_path, capsys, name):
    content, said = SCENARIOS[name]
    (tmp_path / "a.yaml").write_text(content)
    status, got = answer(capsys, "scenario", "validate", tmp_path / "a.yaml")
    assert status == BAD_INPUT and re.search(said, got)


@pytest.mark.parametrize("name", NAMES)
def test_scenarios_name_any_file_as_yaml_can_read_it(made, tmp_path, capsys, name):
    network = os.fsencode(tmp_path) + b"/" + name + b".net.xml"
    shutil.copy(made / "a.net.xml", network)
    status, got = answer(capsys, "scenario", "new", "t", "--from", os.fsdecode(network), "--out", tmp_path / "t.yaml")
    assert status == DONE, got
    status, got = answer(capsys, "scenario", "validate", tmp_path / "t.yaml")
    assert status == DONE and "\x1b" not in got and "\u202e" not in got


def two_of_a_name(folder):
    with zipfile.ZipFile(folder / "frames-0000.zip", "a") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        archive.writestr(archive.namelist()[3], PNG)


RECORDINGS = {
    "two-members-of-a-name": (two_of_a_name, "two of its members have the same name"),
    "an-archive-of-words": (lambda folder: (folder / "frames-0000.zip").write_text("hello"), "not a zip file"),
    "bytes-after-the-archive": (lambda folder: (folder / "frames-0000.zip").open("ab").write(b"x" * 70_000), "not a zip file"),
    "objects": (arrays(speed=lambda speed: np.array([None] * len(speed), dtype=object)), "allow_pickle"),
    "dates": (arrays(t_s=lambda t_s: (t_s * 1e9).astype("datetime64[ns]")), "t_s is datetime64"),
    "complex-numbers": (arrays(speed=lambda speed: speed.astype(complex)), "speed is complex128"),
    "subnormal-speeds": (arrays(speed=lambda speed: 0 * speed + 5e-324), "which no sensor tells from zero"),
    "negative-zeros": (arrays(speed=lambda speed: -0.0 * speed), "no view"),
}


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings(made, tmp_path, capsys, name):
    shutil.copytree(made / "rec", tmp_path / "rec")
    change, said = RECORDINGS[name]
    change(tmp_path / "rec")
    resealed(np.random.default_rng(0), tmp_path)
    status, got = answer(capsys, "map", tmp_path / "rec", "--out", tmp_path / "a.pbstream")
    assert status == BAD_INPUT and re.search(said, got), got


@pytest.mark.parametrize(("value", "said"), [("1e400", "a finite number"), ("1e" + 5000 * "9", "a finite number")])
def test_figures_of_a_huge_exponent(tmp_path, capsys, value, said):
    write_results(tmp_path / "a" / "results.json", results())
    path = tmp_path / "a" / "results.json"
    path.write_text(re.sub(r'("mean_m": ?)[-0-9.e]+', rf"\g<1>{value}", path.read_text()))
    for command in (("compare", tmp_path / "a", tmp_path / "a"), ("report", tmp_path / "a")):
        status, got = answer(capsys, *command)
        assert status == BAD_INPUT and said in got


def test_half_a_character_is_a_sentence(tmp_path, capsys):
    write_results(tmp_path / "a" / "results.json", results())
    path = tmp_path / "a" / "results.json"
    data = json.loads(path.read_text())
    data["scenarios"][0]["name"] = "\ud800"
    path.write_text(json.dumps(data))
    for command in (("report", tmp_path / "a"), ("board", tmp_path / "a", "--out", tmp_path / "b.html")):
        status, got = answer(capsys, *command)
        assert status == BAD_INPUT and "cannot be written in utf-8" in got
    assert not (tmp_path / "b.html").exists()
