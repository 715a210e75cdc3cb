"""Named pipes, devices and links to themselves in the place of each file that is read: a sentence, and nobody waits."""

import os
import shutil

import pytest

from tests.eval.exchange import subjects
from tests.subjects import net, recording
from tests.test_more_inputs import answer

# Layout, what is imported of it, and the files that it has.
LAYOUTS = {
    "tum": (subjects._tum, "", ("rgb.txt", "groundtruth.txt", "odometry.csv", "rgb/3.png")),
    "euroc": (subjects._euroc, "", ("mav0/cam0/data.csv", "mav0/cam0/sensor.yaml", "mav0/odometry0/data.csv",
                                    "mav0/state_groundtruth_estimate0/data.csv")),
    "kitti": (subjects._kitti, "sequences/00", ("sequences/00/times.txt", "sequences/00/calib.txt", "poses/00.txt",
                                                "sequences/00/origin.txt")),
    "kitti-raw": (subjects._kitti_raw, "", ("image_02/timestamps.txt", "calib_cam_to_cam.txt", "oxts/data/0000000003.txt")),
    "donkeycar": (subjects._tub, "", ("manifest.json", "catalog_0.catalog")),
    "bag": (lambda folder: subjects._ros(folder, 2), "drive", ("drive/metadata.yaml", "drive/drive.db3")),
}  # fmt: skip
LAID = [(layout, name) for layout, (_, _, names) in LAYOUTS.items() for name in names]
# Name of a file, and the command that reads it; {0}: the file, {1}: a new path, {2}: a folder with a drive, a recording, a net.
ALONE = [
    ("a.tum", "score {0} {2}/rec"), ("a.pbstream", "score {0} {2}/rec"), ("a.bag", "import {0} --out {1}"),
    ("a.mcap", "import {0} --out {1}"), ("a.mp4", "import {0} --out {1}"), ("a.csv", "import {0} --out {1}"),
    ("a.csv", "import {2}/tum --odometry {0} --out {1}"), ("a.gpx", "import {2}/tum --truth {0} --out {1}"),
    ("a.nmea", "import {2}/tum --truth {0} --out {1}"), ("a.csv", "import {2}/tum --truth {0} --out {1}"),
    ("a.yaml", "import {2}/tum --calibration {0} --out {1}"), ("a.yaml", "scenario validate {0}"),
    ("a.net.xml", "scenario new t --from {0} --out {1}.yaml"), ("a.osm.gz", "scenario new t --from {0} --out {1}.yaml"),
    ("a.pbstream", "refine {0} --network {2}/a.net.xml --out {1}"), ("b.json", "gate --power --baseline {0}"),
]  # fmt: skip
KINDS = {
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "loop": lambda path: path.symlink_to(path),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    recording(folder)
    net(folder)
    (folder / "tum").mkdir()
    subjects._tum(folder / "tum")
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_is_none_is_refused(made, tmp_path, capsys, kind):
    for number, (name, command) in enumerate(ALONE):
        (place := tmp_path / str(number)).mkdir()
        KINDS[kind](place / name)
        status, said = answer(capsys, *command.format(place / name, tmp_path / "out", made).split())
        assert status == 2 and str(place / name) in said, command


@pytest.mark.parametrize(("layout", "name"), LAID)
def test_so_is_one_inside_of_a_drive(tmp_path, capsys, layout, name):
    write, inner, _ = LAYOUTS[layout]
    write(tmp_path)
    for kind in ("pipe", "device"):
        (tmp_path / name).unlink()
        KINDS[kind](tmp_path / name)
        status, said = answer(capsys, "import", tmp_path / inner, "--out", tmp_path / "out")
        assert status == 2 and "not a regular file" in said


@pytest.mark.parametrize("name", ["manifest.json", "samples.npz", "frames-0000.zip"])
def test_so_is_one_inside_of_a_recording(made, tmp_path, capsys, name):
    for kind, make in KINDS.items():
        shutil.copytree(made / "rec", tmp_path / kind)
        (tmp_path / kind / name).unlink()
        make(tmp_path / kind / name)
        status, said = answer(capsys, "map", tmp_path / kind, "--out", tmp_path / "a.pbstream")
        assert status == 2 and name in said
