"""Drives come in as people have them: videos, folders of images, KITTI's layouts, tubs, and self-motion alone."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.readers.kitti_raw import read_kitti_raw
from hippodrome.eval.exchange.readers.layouts import LAYOUTS, recognised
from hippodrome.proto.codec import load_map
from hippodrome.sim.recording import open_recording

KITTI = Path(__file__).parents[3].parent / "shared/real/kitti"


def imported(source, out, *options):
    return main(["import", str(source), "--out", str(out), *map(str, options)])


def picture(number):
    """A smooth frame (24, 32, 3) whose brightness tells its number, which survives JPEG and video."""
    return np.full((24, 32, 3), 20 + 5 * number, np.uint8)


def save(folder, names):
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names):
        assert cv2.imwrite(str(folder / name), picture(number))


def odometry(path, count=30, rate_hz=10.0, begin_s=0.0):
    path.write_text("".join(f"{begin_s + number / rate_hz},5.0,{0.1 * np.sin(number)}\n" for number in range(count)))
    return path


def numbers(recording):
    """The numbers of the frames of a recording, by their brightness."""
    return [round((float(recording.frame(i).mean()) - 20) / 5) for i in range(recording.frame_count)]


def test_a_folder_of_images_in_natural_order(tmp_path):
    save(tmp_path / "seq", [f"img_{number}.{'png' if number % 2 else 'JPG'}" for number in range(12)])
    assert imported(tmp_path / "seq", tmp_path / "in", "--fps", 5, "--odometry", odometry(tmp_path / "o.csv")) == DONE
    back = open_recording(tmp_path / "in")
    assert numbers(back) == list(range(12))
    assert np.diff(back.samples.t_s[back.samples.frame_steps]) == pytest.approx(0.2)
    assert back.manifest["imported"]["format"] == "images"


def test_images_without_times_say_what_to_give(tmp_path, capsys):
    save(tmp_path / "seq", ["0.png", "1.png"])
    assert imported(tmp_path / "seq", tmp_path / "in", "--odometry", odometry(tmp_path / "o.csv")) == BAD_INPUT
    assert "--fps N" in capsys.readouterr().err


@pytest.fixture
def video(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (32, 24))
    for number in range(20):
        writer.write(picture(number))
    writer.release()
    return tmp_path / "v.avi"


@pytest.mark.parametrize(("options", "interval_s"), [((), 0.1), (("--fps", 20), 0.05)])
def test_a_video_by_its_own_stamps_or_a_rate(video, tmp_path, options, interval_s):
    assert imported(video, tmp_path / "in", "--odometry", odometry(tmp_path / "o.csv"), *options) == DONE
    back = open_recording(tmp_path / "in")
    assert numbers(back) == list(range(20))
    assert np.diff(back.samples.t_s[back.samples.frame_steps]) == pytest.approx(interval_s, abs=1e-4)


def test_a_video_that_is_none(tmp_path, capsys):
    (tmp_path / "v.mp4").write_bytes(b"hello")
    assert imported(tmp_path / "v.mp4", tmp_path / "in", "--odometry", odometry(tmp_path / "o.csv")) == BAD_INPUT
    assert "not a video that OpenCV can read" in capsys.readouterr().err.splitlines()[-1]


def test_a_photo_that_its_camera_turned(tmp_path):
    from PIL import Image

    (tmp_path / "seq").mkdir()
    for number in range(3):
        exif = Image.Exif()
        exif[0x0112] = 6
        Image.fromarray(picture(number)).save(tmp_path / "seq" / f"{number}.jpg", exif=exif)
    assert imported(tmp_path / "seq", tmp_path / "in", "--fps", 5, "--odometry", odometry(tmp_path / "o.csv")) == DONE
    assert open_recording(tmp_path / "in").frame(0).shape == (32, 24, 3)


@pytest.fixture
def kitti(tmp_path):
    """A KITTI sequence of JPEGs of which one is missing, with its poses: 0.5 m ahead a frame."""
    sequence = tmp_path / "kitti" / "sequences" / "07"
    save(sequence / "image_0", [f"{number:06d}.jpg" for number in range(12)])
    (sequence / "image_0" / "000004.jpg").unlink()
    (sequence / "times.txt").write_text("".join(f"{0.1 * number:e}\n" for number in range(12)))
    (tmp_path / "kitti" / "poses").mkdir()
    rows = (f"1 0 0 0 0 1 0 0 0 0 1 {0.5 * number}\n" for number in range(12))
    (tmp_path / "kitti" / "poses" / "07.txt").write_text("".join(rows))
    return sequence


def test_kitti_poses_are_self_motion_and_truth_and_a_missing_frame_is_counted(kitti, tmp_path, capsys):
    poses = kitti.parent.parent / "poses" / "07.txt"
    assert imported(kitti, tmp_path / "in", "--odometry", poses, "--truth", poses) == DONE
    assert "1 of 12 frames are missing" in capsys.readouterr().out
    back = open_recording(tmp_path / "in")
    assert numbers(back) == [1, 2, 3, 5, 6, 7, 8, 9, 10, 11]
    assert back.samples.speed == pytest.approx(5.0)
    assert np.ptp(back.samples.poses_m[:, 0]) == pytest.approx(5.0)


def test_kitti_poses_of_another_drive(kitti, tmp_path, capsys):
    (tmp_path / "short.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 5)
    assert imported(kitti, tmp_path / "in", "--odometry", tmp_path / "short.txt") == BAD_INPUT
    assert "5 poses for 12 times" in capsys.readouterr().err


@pytest.fixture
def raw(tmp_path):
    """A drive of KITTI's raw layout: 5 m/s, turning by 0.1 rad/s; image 3 and packet 5 are missing."""
    drive = tmp_path / "2011_09_26_drive_0001_sync"
    save(drive / "image_00" / "data", [f"{number:010d}.png" for number in range(12)])
    (drive / "image_00" / "data" / "0000000003.png").unlink()
    stamps = "".join(f"2011-09-26 13:02:{25 + 0.1 * number:012.9f}\n" for number in range(12))
    (drive / "oxts" / "data").mkdir(parents=True)
    for name in ("image_00", "oxts"):
        (drive / name / "timestamps.txt").write_text(stamps)
    for number in range(12):
        packet = np.zeros(30)
        packet[[0, 1, 8, 22]] = 49.0 + 1e-5 * number, 8.4, 5.0, 0.1
        (drive / "oxts" / "data" / f"{number:010d}.txt").write_text(" ".join(map(str, packet)))
    (drive / "oxts" / "data" / "0000000005.txt").unlink()
    return drive


def test_kitti_raw(raw, tmp_path, capsys):
    assert imported(raw, tmp_path / "in") == DONE
    said = capsys.readouterr().out
    assert "1 of 12 frames are missing" in said
    assert "1 of 12 packets" in said
    back = open_recording(tmp_path / "in")
    assert back.samples.speed == pytest.approx(5.0)
    assert back.samples.yaw_rate_radps == pytest.approx(0.1)
    assert numbers(back) == [1, 2, 4, 5, 6, 7, 8, 9, 10, 11]


def test_kitti_raw_keeps_the_fixes(raw):
    fixes = read_kitti_raw(raw, "body").truth_lat_lon
    assert fixes.shape == (11, 3)
    assert fixes[0] == pytest.approx([1317042145.0, 49.0, 8.4])


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("image_00/timestamps.txt", "yesterday\n", "line 1: not a time like"),
        ("oxts/data/0000000002.txt", "1 2 3", "not the 30 numbers of an OXTS packet"),
        ("oxts/data/0000000002.txt", " ".join(["nan"] * 30), "packet 2 is not finite"),
    ],
)
def test_a_broken_kitti_raw(raw, tmp_path, capsys, file, text, complaint):
    (raw / file).write_text(text)
    assert imported(raw, tmp_path / "in") == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert complaint in line


def tub(folder, records):
    save(folder / "images", [f"{number}_cam.jpg" for number in range(len(records))])
    index = {"paths": ["catalog_0.catalog"], "current_index": len(records), "max_len": 1000, "deleted_indexes": [2]}
    (folder / "manifest.json").write_text('["cam/image_array"]\n["image_array"]\n{}\n{"created_at": 1}\n' + json.dumps(index))
    (folder / "catalog_0.catalog").write_text("".join(json.dumps(record) + "\n" for record in records))
    return folder


def records(**more):
    return [
        {"_index": number, "_timestamp_ms": 1600000000000 + 100 * number, "cam/image_array": f"{number}_cam.jpg", **more}
        for number in range(12)
    ]


def test_a_donkeycar_tub(tmp_path, capsys):
    source = tub(tmp_path / "tub", records(**{"enc/speed": 2.0, "imu/gyr_z": 0.2}))
    assert imported(source, tmp_path / "in") == DONE
    assert "1 record(s) deleted" in capsys.readouterr().out
    back = open_recording(tmp_path / "in")
    assert (back.samples.speed[0], back.samples.yaw_rate_radps[0]) == (2.0, 0.2)
    assert numbers(back) == [0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11]


def test_a_tub_without_self_motion_says_what_to_give(tmp_path, capsys):
    assert imported(tub(tmp_path / "tub", records()), tmp_path / "in") == BAD_INPUT
    assert "give --odometry FILE.csv" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd"])
def test_a_tub_that_leads_out_of_itself(tmp_path, capsys, name):
    source = tub(tmp_path / "tub", records())
    (source / "catalog_0.catalog").write_text(json.dumps({"_index": 0, "_timestamp_ms": 1, "cam/image_array": name}))
    assert imported(source, tmp_path / "in") == BAD_INPUT
    assert "outside of the folder" in capsys.readouterr().err


def test_a_tub_whose_names_no_file_can_have(tmp_path, capsys):
    source = tub(tmp_path / "tub", records())
    (source / "catalog_0.catalog").write_text(json.dumps({"_index": 0, "_timestamp_ms": 1, "cam/image_array": "a\0.jpg"}))
    assert imported(source, tmp_path / "in") == BAD_INPUT
    assert "zero byte" in capsys.readouterr().err


def test_an_old_tub(tmp_path):
    save(tmp_path / "tub", [f"{number}_cam.jpg" for number in range(12)])
    for number in range(12):
        record = {"milliseconds": 100 * number, "cam/image_array": f"{number}_cam.jpg"}
        (tmp_path / "tub" / f"record_{number}.json").write_text(json.dumps(record))
    assert imported(tmp_path / "tub", tmp_path / "in", "--odometry", odometry(tmp_path / "o.csv")) == DONE
    assert numbers(open_recording(tmp_path / "in")) == list(range(12))


def test_what_is_not_recognised_is_told_what_there_is(tmp_path):
    with pytest.raises(ExchangeError, match="no layout is recognised") as told:
        recognised(tmp_path)
    assert all(layout.name in str(told.value) and layout.holds in str(told.value) for layout in LAYOUTS)
    with pytest.raises(ExchangeError, match="no such file or folder"):
        recognised(tmp_path / "none")


def test_our_own_exports_are_recognised(exported):
    for name, source in (("tum", "hamlet-mapping"), ("euroc", "hamlet-mapping"), ("kitti", "sequences/00")):
        assert recognised(exported(name) / source) == name
    assert recognised(exported("rosbag2") / "hamlet-mapping") == "rosbag"


def test_a_drive_without_frames_becomes_a_map_without_views(tmp_path, capsys):
    (tmp_path / "drive.csv").write_text("t_s,speed,yaw_rate\n" + "".join(f"{0.1 * i},5,0.05\n" for i in range(1, 300)))
    assert imported(tmp_path / "drive.csv", tmp_path / "in") == DONE
    assert "no frames" in capsys.readouterr().out
    assert main(["map", str(tmp_path / "in"), "--out", str(tmp_path / "m.pbstream")]) == DONE
    found, _ = load_map(tmp_path / "m.pbstream")
    assert len(found.view_cells.templates) == 0
    assert (found.view_cell == -1).all()
    assert 40 < len(found.t_s) < 60
    assert main(["export", str(tmp_path / "in"), "--to", "tum", "--out", str(tmp_path / "out")]) == DONE


def test_poses_without_times_say_what_to_give(kitti, tmp_path, capsys):
    poses = kitti.parent.parent / "poses" / "07.txt"
    assert imported(poses, tmp_path / "in") == BAD_INPUT
    assert "--fps N" in capsys.readouterr().err
    assert imported(poses, tmp_path / "in", "--fps", 10) == DONE
    assert open_recording(tmp_path / "in").samples.speed == pytest.approx(5.0)


def test_a_real_trajectory_alone_becomes_a_map(tmp_path):
    import gzip

    if not KITTI.is_dir():
        pytest.skip(f"no {KITTI}")
    (tmp_path / "09.txt").write_bytes(gzip.decompress((KITTI / "09.txt.gz").read_bytes()))
    assert imported(tmp_path / "09.txt", tmp_path / "in", "--fps", 9.643) == DONE
    assert main(["map", str(tmp_path / "in"), "--out", str(tmp_path / "m.pbstream")]) == DONE
    assert 250 < len(load_map(tmp_path / "m.pbstream")[0].t_s) < 300


def test_visual_self_motion_needs_a_focal_length_and_warns(tmp_path, capsys):
    save(tmp_path / "seq", [f"{number}.png" for number in range(5)])
    visual = (tmp_path / "seq", tmp_path / "in", "--fps", 10, "--odometry", "visual")
    assert imported(*visual) == BAD_INPUT
    assert "--calibration FILE" in capsys.readouterr().err
    (tmp_path / "K.txt").write_text("20 0 15.5\n0 20 11.5\n0 0 1\n")
    assert imported(*visual, "--calibration", tmp_path / "K.txt") == DONE
    assert "warning: self-motion from the frames alone" in capsys.readouterr().out
    assert open_recording(tmp_path / "in").frame_count == 4


def test_nothing_but_our_errors(tmp_path):
    for name in ("a.mp4", "b.bag", "c.csv", "d.txt", "e.tum", "f.mcap"):
        (tmp_path / name).write_bytes(b"\x00\xff\x01")
        assert imported(tmp_path / name, tmp_path / "in") == BAD_INPUT
    assert issubclass(ExchangeError, HippodromeError)
