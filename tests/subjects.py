"""Whole inputs of the readers beside ``hippodrome import``: maps, recordings, scenarios, networks, results, runs."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from hippodrome._files import sha256_of
from hippodrome.core import se2
from hippodrome.eval.cli import main
from hippodrome.eval.results.model import write_results
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.recording_checks import CHECKSUM, with_checksum
from hippodrome.sim.sumo_tools import run_tool
from tests.broken import Subject
from tests.eval.exchange.subjects import COUNT, ODOMETRY, PNG, TUM
from tests.eval.results.test_model import results
from tests.proto.maps import random_map, random_readings
from tests.sim.test_map_import import BLOCK

TINY = """\
name: tiny
seed: 3
town: {kind: grid, width_m: 150, height_m: 150, road_km: 1.2}
camera: {rate_hz: 5, width: 80, height: 60, supersample: 1}
mapping: {tour: {length_m: 450}, traffic: {vehicles: 2}}
localization: {tour: {length_m: 200}, traffic: {vehicles: 2}}
"""
MISSIONS = """\
missions:
  count: 3
  rows: [ours, truth]
  policies: {mine: "json:loads", other: "exec:./driver --fast"}
  answer_limit_s: 5.0
thresholds:
  drive: {row: truth, success_rate: 0.9, spl: 0.5, driving_score: 60, collisions_at_fault: 0, wrong_way: 0, false_arrivals: 0,
          red_lights: 1, rights_of_way: 2, outside_lane_share: 0.02, time_ratio: 1.5}
"""
XODR = """<OpenDRIVE>
<header revMajor="1" revMinor="4" name="a" north="0" south="0" east="0" west="0"/>
<road name="r" length="80" id="1" junction="-1">
<link/>
<planView>
<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry>
<geometry s="40" x="40" y="0" hdg="0" length="40"><arc curvature="0.02"/></geometry>
</planView>
<lanes><laneSection s="0">
<left><lane id="1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes>
</road>
</OpenDRIVE>
"""
PAPER = ("--mode", "paper", "--start", "4,-1.6,0")
MAPPED = 180  # steps of the drive whose recording, maps and run are broken


def _quiet(*command):
    from contextlib import redirect_stderr, redirect_stdout
    from io import StringIO

    with redirect_stdout(StringIO()), redirect_stderr(said := StringIO()):
        status = main([str(word) for word in command])
    assert status == 0, said.getvalue()


def net(folder):
    """A block of streets as a SUMO network, made by netgenerate."""
    run_tool(
        "netgenerate", "--grid", "--grid.number=3", "--grid.length=80", "--tls.guess", f"--output-file={folder / 'a.net.xml'}"
    )


def _net_packed(folder):
    import gzip

    net(folder)
    (folder / "a.net.xml.gz").write_bytes(gzip.compress((folder / "a.net.xml").read_bytes(), mtime=0))
    (folder / "a.net.xml").unlink()


def _drive(folder):
    """A drive along two sides of the block, in TUM's layout."""
    (folder / "rgb").mkdir(parents=True)
    rows, truth, odometry = [], [], []
    rng, pose = np.random.default_rng(2), np.array([4.0, -1.6, 0.0])
    for step in range(1, MAPPED + 1):
        t_s, yaw_rate = 0.2 * step, np.pi / 4 if 94 <= step < 104 else 0.0
        pose = se2.compose(pose, np.array([1.6, 0.0, 0.2 * yaw_rate]))
        odometry.append(f"{t_s:.2f},8.0,{yaw_rate:.6f}\n")
        truth.append(f"{t_s:.2f} {pose[0]:.3f} {pose[1]:.3f} 0 0 0 {np.sin(pose[2] / 2):.6f} {np.cos(pose[2] / 2):.6f}\n")
        if step % 2 == 0:
            cv2.imwrite(str(folder / "rgb" / f"{step}.png"), rng.integers(0, 256, (32, 48, 3), np.uint8))
            rows.append(f"{t_s:.2f} rgb/{step}.png\n")
    for name, lines in (("rgb.txt", rows), ("groundtruth.txt", truth), ("odometry.csv", odometry)):
        (folder / name).write_text("".join(lines))


def recording(folder):
    """The recording of that drive."""
    _drive(folder / "tum")
    _quiet("import", folder / "tum", "--out", folder / "rec")
    shutil.rmtree(folder / "tum")


def _rec_and_net(folder):
    recording(folder)
    net(folder)


def _map(folder):
    _rec_and_net(folder)
    _quiet("map", folder / "rec", "--out", folder / "a.pbstream")


def _map_read(folder):
    """The map with what the camera read of the lane at each visit."""
    _map(folder)
    cognitive_map, provenance = load_map(folder / "a.pbstream")
    read = random_readings(np.random.default_rng(4), len(cognitive_map.visits.t_s))
    save_map(folder / "a.pbstream", replace(cognitive_map, visits=replace(cognitive_map.visits, lane=read)), provenance)


def _refined(folder):
    _map(folder)
    _quiet("refine", folder / "a.pbstream", "--network", folder / "a.net.xml", "--mode", "paper", "--start", "4,-1.6,0",
           "--out", folder / "b.pbstream")  # fmt: skip


def _run(folder):
    _rec_and_net(folder)
    _quiet("run", folder / "rec", "--network", folder / "a.net.xml", "--start", "4,-1.6,0", "--out", folder / "run")


def resealed(rng, folder):
    """Seven of ten times the checksums of what was broken are made right again: somebody did it on purpose."""
    for path in sorted(folder.rglob("manifest.json")):
        try:
            manifest = json.loads(path.read_text())
            files = manifest["sha256"]
            if rng.random() < 0.7:
                manifest["sha256"] = {name: sha256_of(path.parent / name) if (path.parent / name).is_file() else digest
                                      for name, digest in files.items()}  # fmt: skip
                manifest.pop(CHECKSUM, None)
                path.write_text(json.dumps(with_checksum(manifest)))
        except (ValueError, KeyError, TypeError, AttributeError, OSError):
            continue


def _results(folder):
    for name in ("a", "b"):
        write_results(folder / name / "results.json", results(0.5 if name == "a" else 0.7))


def _baseline(folder):
    shutil.copy(Path(__file__).parents[1] / "scenarios" / "baseline.json", folder)


def _finished(folder):
    """A whole evaluation of the tiny town."""
    (folder / "tiny.yaml").write_text(TINY)
    _quiet("eval", folder / "tiny.yaml", "--workers", 1, "--out", folder / "out")
    for path in [*folder.glob("out/*/*.png"), *folder.glob("out/*/*.jpg"), folder / "out" / "report.html"]:
        path.unlink()


def _video(folder):
    writer = cv2.VideoWriter(str(folder / "a.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (48, 32))
    rng = np.random.default_rng(0)
    for _ in range(COUNT):
        writer.write(rng.integers(0, 256, (32, 48, 3), np.uint8))
    writer.release()
    (folder / "o.csv").write_text(ODOMETRY)


def _yaml(folder):
    (folder / "a.yaml").write_text(TINY + "noise: harsh\nrefine: {mode: paper, route: {search: {bin_m: 5.0}}}\n")


def _yaml_missions(folder):
    (folder / "a.yaml").write_text(TINY + MISSIONS)


def _driven(folder):
    """A mission of the tiny town, driven and kept."""
    (folder / "tiny.yaml").write_text(TINY)
    _quiet("drive", folder / "tiny.yaml", "--missions", 1, "--rows", "truth", "--workers", 1, "--out", folder / "out")


def _drive_on(folder, out):
    shutil.copytree(folder / "out", out)
    words = ["--missions", "1", "--rows", "truth", "--workers", "1", "--out", str(out)]
    return ["drive", str(folder / "tiny.yaml"), *words]


def _written(name, text):
    return lambda folder: (folder / name).write_text(text)


def _new(name, *more):
    return lambda folder, out: ["scenario", "new", "town", "--from", str(folder / name), "--out", f"{out}.yaml", *more]


def _on(command, *words):
    """A command whose words may name the folder of the input."""
    return lambda folder, out: [*command.split(), *(word.format(folder) for word in words), "--out", str(out)]


def _run_again(folder, out):
    shutil.copytree(folder / "run", out)
    return ["run", str(folder / "rec"), "--network", str(folder / "a.net.xml"), "--start", "4,-1.6,0", "--out", str(out)]


def _preview(folder, out):
    return ["scenario", "preview", str(folder / "tiny.yaml"), "--out", str(out)]


def _net_to_drive(folder):
    net(folder)
    (folder / "tiny.yaml").write_text(
        TINY.replace("{kind: grid, width_m: 150, height_m: 150, road_km: 1.2}", "{network: a.net.xml}")
    )


MORE = (
    Subject("yaml", _yaml, lambda folder, _: ["scenario", "validate", str(folder / "a.yaml")], lines=99),
    Subject("yaml-missions", _yaml_missions, lambda folder, _: ["scenario", "validate", str(folder / "a.yaml")], lines=99),
    Subject("drive-kept", _driven, _drive_on, "out/tiny/**/*.*", statuses=(0, 1, 2), lines=99,
            longest_s=240, slow=True),
    Subject("map-refine", _map, _on("refine", "{0}/a.pbstream", "--network", "{0}/a.net.xml"), "a.pbstream"),
    Subject("map-paper", _map, _on("refine", "{0}/a.pbstream", "--network", "{0}/a.net.xml", *PAPER), "a.pbstream"),
    Subject("map-read", _map_read, _on("refine", "{0}/a.pbstream", "--network", "{0}/a.net.xml", *PAPER), "a.pbstream"),
    Subject("map-score", _refined, lambda folder, _: ["score", str(folder / "b.pbstream"), str(folder / "rec")], "b.pbstream"),
    Subject("map-localize", _refined, _on("localize", "{0}/b.pbstream", "{0}/rec"), "b.pbstream"),
    Subject("map-random", lambda folder: (save_map(folder / "a.pbstream", random_map(), {}), net(folder)),
            _on("refine", "{0}/a.pbstream", "--network", "{0}/a.net.xml"), "a.pbstream"),
    Subject("recording-map", recording, _on("map", "{0}/rec"), after=resealed),
    Subject("recording-score", lambda folder: (recording(folder), (folder / "a.tum").write_text(TUM)),
            lambda folder, _: ["score", str(folder / "a.tum"), str(folder / "rec")], "rec/*", resealed),
    Subject("network-refine", _map, _on("refine", "{0}/a.pbstream", "--network", "{0}/a.net.xml"), "a.net.xml"),
    Subject("network-new", net, _new("a.net.xml"), slow=True),
    Subject("network-packed", _net_packed, _new("a.net.xml.gz"), slow=True),
    Subject("network-drive", _net_to_drive, _preview, "a.net.xml", longest_s=120, slow=True),
    Subject("osm", _written("a.osm", BLOCK), _new("a.osm"), slow=True),
    Subject("opendrive", _written("a.xodr", XODR), _new("a.xodr"), slow=True),
    Subject("results-compare", _results, lambda folder, _: ["compare", str(folder / "a"), str(folder / "b")]),
    Subject("results-report", _results, lambda folder, _: ["report", str(folder / "a")], "a/*"),
    Subject("baseline", _baseline, lambda folder, _: ["gate", "--power", "--baseline", str(folder / "baseline.json")], slow=True),
    Subject("run", _run, _run_again, "run/*.json"),
    Subject("run-recording", _run, _run_again, "rec/*", resealed, slow=True),
    Subject("export-mcap", _finished, _on("export", "{0}/out", "--to", "mcap"), "out/**/*.*", resealed, slow=True),
    Subject("export-tum", _finished, _on("export", "{0}/out", "--to", "tum"), "out/**/*.*", resealed, slow=True),
    Subject("finished-report", _finished, lambda folder, _: ["report", str(folder / "out")], "out/*/*.*", slow=True),
    Subject("video", _video, _on("import", "{0}/a.avi", "--odometry", "{0}/o.csv"), "a.avi"),
    Subject("one-image", lambda folder: ((folder / "i").mkdir(), (folder / "i" / "0.png").write_bytes(PNG),
                                         (folder / "i" / "1.png").write_bytes(PNG), (folder / "o.csv").write_text(ODOMETRY)),
            _on("import", "{0}/i", "--fps", "10", "--odometry", "{0}/o.csv"), "i/*"),
)  # fmt: skip
