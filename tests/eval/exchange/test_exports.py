"""What the exports show: finished maps where they belong, transforms, calibrations, colours, clocks; and evo's own programs."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import DONE
from hippodrome.eval.exchange.drives.exported import gather_drives
from hippodrome.eval.exchange.drives.scene import colour_of, growth, own_frames
from hippodrome.eval.methods.method import METHODS
from hippodrome.proto.codec import load_map
from tests.eval.exchange.results import CAMERA


def mcap_messages(path):
    reader, decoder = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_protobuf.decoder")
    found = {}
    with path.open("rb") as stream:
        for one in reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages():
            found.setdefault(one.channel.topic, []).append((one.message.log_time, one.decoded_message))
    return found


def test_a_localization_drive_has_the_finished_map_where_the_mapping_drive_had_it(run, exported):
    mapping, localization = (mcap_messages(exported("mcap") / f"hamlet-{one}.mcap") for one in ("mapping", "localization"))
    for name in ("semi-metric", "topometric-default"):
        (grown, finished) = (drive[f"/map/{name}"] for drive in (mapping, localization))
        assert len(finished) == 1
        assert finished[0][0] == 0
        for inner in (grown, finished):
            assert len(inner[-1][1].entities[0].lines[0].points) == 12
        last, whole = grown[-1][1].entities[0], finished[0][1].entities[0]
        assert [(p.x, p.y) for p in whole.lines[0].points] == [(p.x, p.y) for p in last.lines[0].points]
        assert whole.frame_id == last.frame_id
    drives = {drive.name: drive for drive in gather_drives(run.root, None)}
    found = load_map(run.scenario / "semi-metric.pbstream")[0]
    truth = run.mapping.ground_truth()
    start = se2.interpolate(truth.t_s, truth.poses, found.t_s[:1])[0]
    frame = own_frames(drives["hamlet-localization"])["own/semi-metric"]
    assert se2.compose(frame, found.poses[0])[:2] == pytest.approx(start[:2], abs=1e-9)
    (where,) = [m for _, m in localization["/tf"] if m.child_frame_id == "own/semi-metric"]
    assert (where.translation.x, where.translation.y) == pytest.approx(tuple(frame[:2]))
    assert len(list(growth(drives["hamlet-localization"], "semi-metric"))) == 1


def test_methods_have_the_colours_of_the_figures(exported):
    colours = [colour_of(method.stem) for method in METHODS[:6]]
    assert len(set(colours)) == 6
    assert colour_of("topometric-default") == colour_of("topometric") == colour_of("topometric-localization")
    assert colour_of("topometric-tuned") == colour_of("topometric")
    messages = mcap_messages(exported("mcap") / "hamlet-mapping.mcap")
    for name in ("semi-metric", "topometric-default"):
        colour = messages[f"/map/{name}"][-1][1].entities[0].lines[0].color
        assert [round(255 * one) for one in (colour.r, colour.g, colour.b)] == list(colour_of(name))


def test_ros_bags_have_transforms_and_calibrations(run, exported):
    highlevel = pytest.importorskip("rosbags.highlevel")
    found = {}
    with highlevel.AnyReader([exported("rosbag2") / "hamlet-mapping"]) as bag:
        for connection, stamp, raw in bag.messages():
            found.setdefault(connection.topic, []).append((stamp, bag.deserialize(raw, connection.msgtype)))
        latched = next(one for one in bag.connections if one.topic == "/tf_static").ext.offered_qos_profiles
    assert "TRANSIENT_LOCAL" in str(latched)
    truth = run.mapping.ground_truth()
    moving = [message.transforms[0] for _, message in found["/tf"]]
    assert {(one.header.frame_id, one.child_frame_id) for one in moving} == {("network", "vehicle")}
    assert [(one.transform.translation.x, one.transform.translation.y) for one in moving] == [
        tuple(p) for p in truth.poses[:, :2]
    ]
    ((_, static),) = found["/tf_static"]
    tree = {one.child_frame_id: one for one in static.transforms}
    assert {"camera", "camera_right", "own/semi-metric", "own/dead-reckoning"} <= tree.keys()
    camera = tree["camera"].transform.translation
    assert (camera.x, camera.z) == (CAMERA.forward_m, CAMERA.height_m)
    for info, image in (
        ("/camera/camera_info", "/camera/image/compressed"),
        ("/camera_right/camera_info", "/camera_right/image/compressed"),
    ):
        assert [stamp for stamp, _ in found[info]] == [stamp for stamp, _ in found[image]]
        assert found[info][0][1].k[0] == pytest.approx(CAMERA.focal_px())
    assert found["/camera_right/camera_info"][0][1].p[3] == pytest.approx(-0.4 * CAMERA.focal_px())


def evo(program, *arguments):
    path = Path(sys.executable).parent / program
    if not path.exists():
        pytest.skip(f"{program} is not installed")
    done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("kind", ["tum", "kitti", "euroc"])
def test_evo_compares_what_was_exported_with_the_commands_of_the_page(exported, tmp_path, monkeypatch, kind):
    monkeypatch.setenv("HOME", str(tmp_path))  # evo keeps its settings there
    root = exported(kind)
    truth, estimate, format_ = {
        "tum": ("hamlet-mapping/groundtruth.txt", "hamlet-mapping/estimates/topometric.tum", "tum"),
        "kitti": ("poses/00.tum", "estimates/topometric/00.tum", "tum"),
        "euroc": (
            "hamlet-mapping/mav0/state_groundtruth_estimate0/data.csv",
            "hamlet-mapping/mav0/estimates/topometric.tum",
            "euroc",
        ),
    }[kind]
    said = evo("evo_ape", format_, root / truth, root / estimate, "--t_max_diff", "0.06")
    assert 0.0 < float(said.split("mean")[1].split()[0]) < 2.0


def test_evo_reads_our_bags(exported, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    bag = exported("rosbag2") / "hamlet-mapping"
    said = evo("evo_ape", "bag2", bag, "/ground_truth", "/estimate/topometric", "--t_max_diff", "0.06")
    assert 0.0 < float(said.split("mean")[1].split()[0]) < 2.0


def test_a_sweep_is_exported(run, tmp_path):
    cell = tmp_path / "sweep" / "cells" / "0a1b"
    cell.mkdir(parents=True)
    shutil.copytree(run.scenario, cell / "hamlet")
    for name in ("recordings", "towns"):
        shutil.copytree(run.root / name, tmp_path / "sweep" / name)
        (cell / name).symlink_to(Path("..", "..", name))
    assert main(["export", str(tmp_path / "sweep"), "--to", "tum", "--out", str(tmp_path / "out")]) == DONE
    about = json.loads((tmp_path / "out" / "about.json").read_text())
    assert [one["name"] for one in about["drives"]] == ["0a1b-hamlet-mapping", "0a1b-hamlet-localization"]
    assert (tmp_path / "out" / "0a1b-hamlet-mapping" / "estimates" / "topometric.tum").exists()


def test_an_imported_drive_keeps_its_clock(run, exported, tmp_path):
    """A TUM folder whose clock counts from 1970 comes out of MCAP files and bags with the stamps that went in."""
    source = tmp_path / "source"
    shutil.copytree(exported("tum") / "hamlet-mapping", source)
    shutil.rmtree(source / "estimates")
    for name, mark in (("rgb.txt", " "), ("groundtruth.txt", " "), ("odometry.csv", ",")):
        lines = [line for line in (source / name).read_text().splitlines() if not line.startswith("#")]
        rows = [line.split(mark) for line in lines]
        text = "\n".join(mark.join([f"{1.5e9 + float(row[0]):.6f}", *row[1:]]) for row in rows)
        (source / name).write_text(text + "\n")
    assert main(["import", str(source), "--out", str(tmp_path / "in")]) == DONE
    for kind in ("mcap", "rosbag2", "tum"):
        assert main(["export", str(tmp_path / "in"), "--to", kind, "--out", str(tmp_path / kind)]) == DONE
        about = json.loads((tmp_path / kind / "about.json").read_text())
        assert about["drives"][0]["time_origin_s"] == pytest.approx(1.5e9, abs=1e-6)
    expected = 1.5e9 + run.mapping.samples.t_s[run.mapping.samples.frame_steps]
    messages = mcap_messages(tmp_path / "mcap" / "in.mcap")
    for stamps in (
        [stamp for stamp, _ in messages["/camera"]],
        [m.timestamp.seconds * 10**9 + m.timestamp.nanos for _, m in messages["/camera"]],
    ):
        assert np.abs(np.array(stamps) / 1e9 - expected).max() < 1e-6
    assert all(m.entities[0].timestamp.seconds >= 1.5e9 for _, m in messages.get("/network", []))
    assert main(["import", str(tmp_path / "rosbag2" / "in"), "--out", str(tmp_path / "again")]) == DONE
    manifest = json.loads((tmp_path / "again" / "manifest.json").read_text())
    assert manifest["imported"]["time_origin_s"] == pytest.approx(1.5e9, abs=1e-6)
