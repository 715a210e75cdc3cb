"""Each export read back by the format's own library gives the same poses and the same frames."""

import json
import zipfile

import numpy as np
import pytest
from evo.tools import file_interface

from hippodrome.core import se2
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.metrics.trajectory import ape, rpe
from hippodrome.sim.recording import frame_name
from hippodrome.sim.render.camera import camera_position_m, camera_to_world
from tests.eval.exchange.results import CAMERA

GL_TO_OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])  # y up, z backwards -> y down, z forward


def png(recording, number, side=""):
    with zipfile.ZipFile(recording.folder / "frames-0000.zip") as archive:
        return archive.read(frame_name(number, side))


def assert_planar(found, trajectory, atol=0.0):
    """An evo trajectory is ours: times exact, positions within ``atol``, headings to the rounding of the half angle."""
    assert np.allclose(found.timestamps, trajectory.t_s, rtol=0.0, atol=1e-9)
    assert np.allclose(found.positions_xyz[:, :2], trajectory.poses[:, :2], rtol=0.0, atol=atol)
    yaw = found.get_orientations_euler()[:, 2]
    assert np.abs(se2.wrap(yaw - trajectory.poses[:, 2])).max() < 1e-12


def test_tum(run, exported):
    here = exported("tum") / "hamlet-mapping"
    assert_planar(file_interface.read_tum_trajectory_file(here / "groundtruth.txt"), run.mapping.ground_truth())
    for name in ("topometric", "semi-metric"):
        read = file_interface.read_tum_trajectory_file(here / "estimates" / f"{name}.tum")
        assert_planar(read, read_tum(run.scenario / f"{name}.tum"))
    rows = [line.split() for line in (here / "rgb.txt").read_text().splitlines()[1:]]
    assert [float(t_s) for t_s, _ in rows] == run.mapping.samples.t_s[run.mapping.samples.frame_steps].tolist()
    assert all((here / name).read_bytes() == png(run.mapping, number) for number, (_, name) in enumerate(rows))


def test_euroc(run, exported):
    here = exported("euroc") / "hamlet-localization" / "mav0"
    truth = file_interface.read_euroc_csv_trajectory(here / "state_groundtruth_estimate0" / "data.csv")
    assert_planar(truth, run.localization.ground_truth())
    estimate = file_interface.read_euroc_csv_trajectory(here / "estimates" / "topometric-localization.csv")
    assert_planar(estimate, read_tum(run.scenario / "topometric-localization.tum"))
    for sensor, side in (("cam0", ""), ("cam1", "r")):
        rows = [line.split(",") for line in (here / sensor / "data.csv").read_text().splitlines()[1:]]
        assert rows[3] == ["800000000", "800000000.png"]
        assert all(
            (here / sensor / "data" / name).read_bytes() == png(run.localization, i, side) for i, (_, name) in enumerate(rows)
        )


def test_kitti(run, exported):
    root = exported("kitti")
    read = np.array(file_interface.read_kitti_poses_file(root / "poses" / "00.txt").poses_se3)
    steps = run.mapping.samples.frame_steps
    poses = run.mapping.samples.poses_m[steps]
    cameras = np.array([camera_to_world(*camera_position_m(CAMERA, pose)) @ GL_TO_OPTICAL for pose in poses])
    assert np.abs(np.linalg.inv(cameras[0]) @ cameras - read).max() < 1e-12  # the renderer's own idea of where the camera is
    here = root / "sequences" / "00"
    assert np.loadtxt(here / "times.txt").tolist() == run.mapping.samples.t_s[steps].tolist()
    for folder, side in (("image_2", ""), ("image_3", "r")):
        assert all((here / folder / f"{i:06d}.png").read_bytes() == png(run.mapping, i, side) for i in range(30))
    calibration = {line.split(":")[0]: np.array(line.split()[1:], float).reshape(3, 4) for line in (here / "calib.txt").open()}
    assert calibration["P3"][0, 3] == pytest.approx(-CAMERA.focal_px() * 0.4)


def test_evo_results_are_our_scores(run, exported):
    here, truth = exported("evo") / "hamlet-mapping", run.mapping.ground_truth()
    for method, alignment in (("topometric", "none"), ("semi-metric", "start")):
        trajectory = read_tum(run.scenario / f"{method}.tum")
        result = file_interface.load_res_file(here / f"{method}-ape.zip", load_trajectories=True)
        assert np.abs(result.np_arrays["error_array"] - ape(trajectory, truth, alignment).errors_m).max() < 1e-9
        assert set(result.trajectories) == {"ground-truth", method}
        result = file_interface.load_res_file(here / f"{method}-rpe.zip")
        assert np.abs(result.np_arrays["error_array"] - rpe(trajectory, truth, 20.0).errors_m).max() < 1e-9


def test_mcap(run, exported):
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_protobuf.decoder")
    messages = {}
    with (exported("mcap") / "hamlet-mapping.mcap").open("rb") as stream:
        for found in reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages():
            messages.setdefault(found.channel.topic, []).append(
                (found.message.log_time, found.schema.name, found.decoded_message)
            )
    samples = run.mapping.samples
    assert [message.data for _, _, message in messages["/camera"]] == [png(run.mapping, i) for i in range(30)]
    assert [message.data for _, _, message in messages["/camera_right"]] == [png(run.mapping, i, "r") for i in range(30)]
    for topic, trajectory, frame in (
        ("/ground_truth", run.mapping.ground_truth(), "network"),
        ("/estimate/topometric", read_tum(run.scenario / "topometric.tum"), "network"),
        ("/estimate/semi-metric", read_tum(run.scenario / "semi-metric.tum"), "own/semi-metric"),
    ):
        assert {(kind, message.frame_id) for _, kind, message in messages[topic]} == {("foxglove.PoseInFrame", frame)}
        assert [stamp for stamp, _, _ in messages[topic]] == np.round(trajectory.t_s * 1e9).astype(int).tolist()
        positions = [(message.pose.position.x, message.pose.position.y) for _, _, message in messages[topic]]
        assert positions == [tuple(pose) for pose in trajectory.poses[:, :2].tolist()]
        half = [np.arctan2(m.pose.orientation.z, m.pose.orientation.w) for _, _, m in messages[topic]]
        assert np.abs(se2.wrap(2.0 * np.array(half) - trajectory.poses[:, 2])).max() < 1e-12
    sensed = [(m.linear_velocity.x, m.angular_velocity.z) for _, _, m in messages["/self_motion"]]
    assert sensed == list(zip(samples.speed.tolist(), samples.yaw_rate_radps.tolist(), strict=True))
    assert len(messages["/network"][0][2].entities[0].lines) > 10
    grown = [len(message.entities[0].lines[0].points) for _, _, message in messages["/map/topometric-default"]]
    assert grown == sorted(grown)
    assert grown[-1] == 12
    transforms = {(m.parent_frame_id, m.child_frame_id) for _, _, m in messages["/tf"]}
    assert transforms >= {("network", "vehicle"), ("vehicle", "camera"), ("network", "own/semi-metric")}


def test_the_same_mcap_bytes_again(run, exported, tmp_path):
    assert main(["export", str(run.root), "--to", "mcap", "--out", str(tmp_path / "again")]) == 0
    name = "hamlet-mapping.mcap"
    assert (tmp_path / "again" / name).read_bytes() == (exported("mcap") / name).read_bytes()


def test_rerun(run, exported):
    chunk = pytest.importorskip("rerun.chunk")
    tables = {}
    for found in chunk.RrdReader(exported("rerun") / "hamlet-mapping.rrd").stream().to_chunks():
        batch = found.to_record_batch()
        for name in batch.schema.names:
            tables.setdefault((found.entity_path, name), []).extend(batch.column(name).to_pylist())
    blobs = tables["/network/vehicle/camera", "EncodedImage:blob"]
    order = np.argsort([t.total_seconds() for t in tables["/network/vehicle/camera", "drive"]])
    assert [bytes(blobs[i][0]) for i in order if blobs[i]] == [png(run.mapping, i) for i in range(30)]
    for entity, trajectory in (
        ("/network/vehicle", run.mapping.ground_truth()),
        ("/network/estimate/topometric", read_tum(run.scenario / "topometric.tum")),
        ("/network/own/semi-metric/estimate/semi-metric", read_tum(run.scenario / "semi-metric.tum")),
    ):
        t_s = [t.total_seconds() for t in tables[entity, "drive"]]
        assert np.allclose(t_s, trajectory.t_s, rtol=0.0, atol=1e-6)
        places = np.array([row[0] for row in tables[entity, "Transform3D:translation"]])
        assert np.array_equal(places[:, :2], trajectory.poses[:, :2].astype(np.float32))  # the format's precision
    assert len(tables["/network/lanes", "LineStrips3D:strips"][0]) > 10


def test_rosbag2(run, exported):
    highlevel = pytest.importorskip("rosbags.highlevel")
    with highlevel.AnyReader([exported("rosbag2") / "hamlet-mapping"]) as bag:
        messages = {}
        for connection, stamp, raw in bag.messages():
            messages.setdefault(connection.topic, []).append((stamp, bag.deserialize(raw, connection.msgtype)))
        read = file_interface.read_bag_trajectory(bag.readers[0], "/ground_truth")
    assert_planar(read, run.mapping.ground_truth())
    assert [bytes(message.data) for _, message in messages["/camera/image/compressed"]] == [
        png(run.mapping, i) for i in range(30)
    ]
    speeds = [message.twist.twist.linear.x for _, message in messages["/odometry"]]
    assert speeds == run.mapping.samples.speed.tolist()


def test_about_says_what_is_where(exported):
    about = json.loads((exported("tum") / "about.json").read_text())
    assert [drive["name"] for drive in about["drives"]] == ["hamlet-mapping", "hamlet-localization"]
    assert about["drives"][0]["estimates"] == {"semi-metric": "own", "topometric": "network", "dead-reckoning": "own"}
    assert about["drives"][0]["roads"]


def test_a_recording_alone(run, tmp_path):
    assert main(["export", str(run.mapping.folder), "--to", "tum", "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "hamlet-mapping-0123" / "estimates" / "dead-reckoning.tum").exists()


def test_nothing_is_overwritten_and_nothing_half_done_stays(run, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "precious").write_text("x")
    assert main(["export", str(run.root), "--to", "tum", "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert "exists already" in capsys.readouterr().err
    assert main(["export", str(tmp_path), "--to", "tum", "--out", str(tmp_path / "new")]) == BAD_INPUT
    assert "neither a recording" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_missing_package_is_named_with_its_extra(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mcap_protobuf.writer", None)
    monkeypatch.delitem(__import__("sys").modules, "hippodrome.eval.exchange.formats.mcap_file", raising=False)
    assert main(["export", str(run.root), "--to", "mcap", "--out", str(tmp_path / "new")]) == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "pip install 'hippodrome[exchange]'" in line
