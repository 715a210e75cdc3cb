"""Whole inputs of every reader of ``hippodrome import`` and ``score``, small, for tests/broken.py to break."""

import json
from functools import partial

import cv2
import numpy as np

from tests.broken import Subject

COUNT = 12
T_S = 0.1 * np.arange(1, COUNT + 1)
PNG = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8))[1].tobytes()
ODOMETRY = "".join(f"{t:.3f},5.0,0.2\n" for t in T_S)
HEADER = "#t_s,speed,yaw_rate\n"
TUM = "".join(f"{t:.3f} {5 * t:.6f} {0.1 * t * t:.6f} 0 0 0 {np.sin(0.02 * t):.6f} {np.cos(0.02 * t):.6f}\n" for t in T_S)
KITTI = "".join(f"1 0 0 {-0.1 * t * t:.6f} 0 1 0 0 0 0 1 {5 * t:.6f}\n" for t in T_S)
FIXES = [(1.7e9 + t, 49.0 + 5 * t / 111e3, 8.4 + 0.1 * t * t / 72e3) for t in T_S]
YAML = "image_width: 24\nimage_height: 16\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [20.0, 0, 12, 0, 20, 8, 0, 0, 1]\n" \
       "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.01, 0, 0, 0, 0]\n"  # fmt: skip


def _files(folder, files):
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def _tum(folder, **more):
    rows = "".join(f"{t:.3f} rgb/{n}.png\n" for n, t in enumerate(T_S))
    images = {f"rgb/{n}.png": PNG for n in range(COUNT)}
    _files(folder, {"rgb.txt": rows, "groundtruth.txt": TUM, "odometry.csv": HEADER + ODOMETRY, **images, **more})


def _kitti(folder):
    here = "sequences/00"
    images = {f"{here}/image_2/{n:06d}.png": PNG for n in range(COUNT)}
    calib = "".join(f"P{n}: 20 0 12 0 0 20 8 0 0 0 1 0\n" for n in range(4))
    times = "".join(f"{t:.3f}\n" for t in T_S)
    origin = "0 0 1 5\n-1 0 0 6\n0 -1 0 0\n0 0 0 1\n"
    _files(folder, {f"{here}/times.txt": times, f"{here}/calib.txt": calib, f"{here}/odometry.csv": ODOMETRY,
                    f"{here}/origin.txt": origin, "poses/00.txt": KITTI, **images})  # fmt: skip


def _euroc(folder):
    stamps = [round(t * 1e9) for t in T_S]
    rows = "#timestamp [ns],filename\n" + "".join(f"{t},{t}.png\n" for t in stamps)
    odometry = "#timestamp [ns],speed,yaw\n" + "".join(f"{t},5.0,0.2\n" for t in stamps)
    truth = "#timestamp\n" + "".join(f"{t},{5e-9 * t},0,0,1,0,0,0,5,0,0,0,0,0,0,0,0\n" for t in stamps)
    images = {f"mav0/cam0/data/{t}.png": PNG for t in stamps}
    tables = {"mav0/odometry0/data.csv": odometry, "mav0/state_groundtruth_estimate0/data.csv": truth}
    camera = {"mav0/cam0/data.csv": rows, "mav0/cam0/sensor.yaml": "%YAML:1.0\nintrinsics: [20, 20, 12, 8]\n"}
    _files(folder, {**tables, **camera, **images})


def _kitti_raw(folder):
    stamps = "".join(f"2011-09-26 13:02:{25 + t:012.9f}\n" for t in T_S)
    row = ["0"] * 30
    images = {f"image_02/data/{n:010d}.png": PNG for n in range(COUNT)}
    oxts = {f"oxts/data/{n:010d}.txt": " ".join([f"{49 + 1e-5 * n}", "8.4", *row[2:8], "5.0", *row[9:22], "0.2", *row[23:]])
            for n in range(COUNT)}  # fmt: skip
    calib = {"calib_cam_to_cam.txt": "P_rect_02: 20 0 12 0 0 20 8 0 0 0 1 0\n"}
    _files(folder, {"image_02/timestamps.txt": stamps, "oxts/timestamps.txt": stamps, **images, **oxts, **calib})


def _tub(folder):
    records = [{"_index": n, "_timestamp_ms": round(1e3 * t), "cam/image_array": f"{n}.png", "enc/speed": 5.0, "imu/gyr_z": 0.2}
               for n, t in enumerate(T_S)]  # fmt: skip
    catalog = "".join(json.dumps(one) + "\n" for one in records)
    manifest = "\n".join(["[]", "[]", "{}", "{}", json.dumps({"paths": ["catalog_0.catalog"], "deleted_indexes": [3]})]) + "\n"
    _files(folder, {"manifest.json": manifest, "catalog_0.catalog": catalog, **{f"images/{n}.png": PNG for n in range(COUNT)}})


def _mcap(folder, encoding="protobuf", compression="NONE", crcs=False):
    from google.protobuf.json_format import MessageToDict
    from mcap.writer import CompressionType, Writer

    with (folder / "drive.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType[compression], enable_crcs=crcs, chunk_size=2000)
        writer.start("x", "y")
        channels = {}
        for topic, message in _foxglove():
            name = message.DESCRIPTOR.full_name
            if topic not in channels:
                schema = writer.register_schema(name, "protobuf" if encoding == "protobuf" else "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, encoding, schema)
            as_json = json.dumps(MessageToDict(message, preserving_proto_field_name=True)).encode()
            stamp = message.timestamp.seconds * 10**9 + message.timestamp.nanos
            data = message.SerializeToString() if encoding == "protobuf" else as_json
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()


def _foxglove():
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
    from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
    from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
    from google.protobuf.timestamp_pb2 import Timestamp

    for t in T_S:
        time = Timestamp(seconds=int(t), nanos=round((t % 1) * 1e9))
        yield "/camera", CompressedImage(timestamp=time, data=PNG, format="png")
        yield "/raw", RawImage(timestamp=time, width=16, height=16, step=48, encoding="rgb8", data=bytes(768))
        odometry, truth = Odometry(timestamp=time), PoseInFrame(timestamp=time)
        odometry.linear_velocity.x, odometry.angular_velocity.z = 5.0, 0.2
        truth.pose.position.x, truth.pose.orientation.w = 5 * t, 1.0
        yield "/odom", odometry
        yield "/ground_truth", truth


def _ros(folder, version):
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    types, zeros = store.types, np.zeros(36)
    plugin = StoragePlugin.MCAP if version == 3 else StoragePlugin.SQLITE3
    writer = Writer1(folder / "drive.bag") if version == 1 else Writer2(folder / "drive", version=8, storage_plugin=plugin)
    with writer as bag:
        known = {}
        for number, t in enumerate(T_S):
            stamp = round(t * 1e9) + 10**15
            time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            head = types["std_msgs/msg/Header"](*([number] if version == 1 else []), time, "base")
            vector = types["geometry_msgs/msg/Vector3"]
            twist = types["geometry_msgs/msg/Twist"](vector(5.0, 0.0, 0.0), vector(0.0, 0.0, 0.2))
            pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](5.0 * t, 0.0, 0.0),
                                                   types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))  # fmt: skip
            for topic, kind, message in (
                ("/camera", "sensor_msgs/msg/CompressedImage", (head, "png", np.frombuffer(PNG, np.uint8))),
                ("/odom", "nav_msgs/msg/Odometry", (head, "base", types["geometry_msgs/msg/PoseWithCovariance"](pose, zeros),
                                                    types["geometry_msgs/msg/TwistWithCovariance"](twist, zeros))),
            ):  # fmt: skip
                if topic not in known:
                    known[topic] = bag.add_connection(topic, kind, typestore=store)
                value = types[kind](*message)
                bag.write(
                    known[topic], stamp, store.serialize_ros1(value, kind) if version == 1 else store.serialize_cdr(value, kind)
                )


def _fixes(name):
    rows = "".join(f"{t:.2f},{lat:.8f},{lon:.8f},2.5\n" for t, lat, lon in FIXES)
    at = [f'<trkpt lat="{lat}" lon="{lon}"><time>2023-11-14T22:13:{20 + n:02d}Z</time><hdop>1.1</hdop></trkpt>'
          for n, (_, lat, lon) in enumerate(FIXES)]  # fmt: skip
    line = {"type": "Feature", "properties": {"coordTimes": [t for t, *_ in FIXES]},
            "geometry": {"type": "LineString", "coordinates": [[lon, lat] for _, lat, lon in FIXES]}}  # fmt: skip
    nmea = "".join(f"$GPRMC,{221320 + n}.00,A,49{lat % 1 * 60:09.6f},N,008{lon % 1 * 60:09.6f},E,9.7,0,141123,,,A\n"
                   for n, (_, lat, lon) in enumerate(FIXES))  # fmt: skip
    content = {"f.csv": "t_s,lat,lon,sigma_m\n" + rows, "f.gpx": f"<gpx><trk><trkseg>{chr(10).join(at)}</trkseg></trk></gpx>",
               "f.geojson": json.dumps({"type": "FeatureCollection", "features": [line]}), "f.nmea": nmea}[name]  # fmt: skip

    def write(folder):
        odometry = "".join(f"{t:.3f},5.0,0.2\n" for t, *_ in [*FIXES, *((FIXES[-1][0] + n, 0, 0) for n in range(1, 5))])
        _files(folder, {name: content, "o.csv": odometry})

    return write


def _import(source="", *options):
    return lambda folder, out: ["import", str(folder / source), "--out", str(out), *(o.format(folder) for o in options)]


def _scored(folder, out):
    """A trajectory against a recording that is made once beside the first case."""
    from hippodrome.eval.cli import main

    recording = out.parent.parent / "recording-to-score"
    if not recording.exists():
        whole = out.parent.parent / "to-record"
        whole.mkdir()
        _tum(whole)
        assert main(["import", str(whole), "--out", str(recording)]) == 0
    return ["score", str(folder / "a.tum"), str(recording)]


SUBJECTS = (
    Subject("tum", _tum, _import()),
    Subject("kitti", _kitti, _import("sequences/00")),
    Subject("euroc", _euroc, _import()),
    Subject("kitti-raw", _kitti_raw, _import()),
    Subject("tub", _tub, _import()),
    Subject("images", lambda folder: _files(folder, {**{f"i/{n}.png": PNG for n in range(COUNT)}, "o.csv": ODOMETRY}),
            _import("i", "--fps", "10", "--odometry", "{0}/o.csv")),
    Subject("odometry-csv", lambda folder: _files(folder, {"o.csv": "time [s],speed_kmh,gyro_z (deg/s)\n" + ODOMETRY}),
            _import("o.csv")),
    Subject("odometry-tum", lambda folder: _files(folder, {"o.tum": TUM}), _import("o.tum", "--from", "odometry")),
    Subject("odometry-kitti", lambda folder: _files(folder, {"o.txt": KITTI}),
            _import("o.txt", "--from", "odometry", "--fps", "10")),
    Subject("calibration", lambda folder: _tum(folder, **{"c.yaml": YAML}), _import("", "--calibration", "{0}/c.yaml"), "c.yaml"),
    Subject("mcap", _mcap, _import("drive.mcap")),
    Subject("mcap-zstd", partial(_mcap, compression="ZSTD", crcs=True), _import("drive.mcap")),
    Subject("mcap-json", partial(_mcap, encoding="json"), _import("drive.mcap")),
    Subject("bag-1", partial(_ros, version=1), _import("drive.bag")),
    Subject("bag-2", partial(_ros, version=2), _import("drive")),
    Subject("bag-2-mcap", partial(_ros, version=3), _import("drive")),
    *(Subject(f"fixes-{name[2:]}", _fixes(name), _import("o.csv", "--from", "odometry", "--truth", f"{{0}}/{name}"), name)
      for name in ("f.csv", "f.gpx", "f.geojson", "f.nmea")),
    Subject("score", lambda folder: _files(folder, {"a.tum": TUM}), _scored),
)  # fmt: skip
