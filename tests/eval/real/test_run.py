"""One command from a drive and a map to a page: on a small drive of ours, and on a real one where it lies beside the checkout."""

import gzip
import json
import re
import shutil
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.real.drive import Drive
from hippodrome.eval.real.findings import find_wrong_roads
from hippodrome.eval.real.page import drive_page
from hippodrome.proto.codec import load_map
from hippodrome.sim.recording import open_recording
from tests.eval.real.test_findings import EAST, SIGMA_M, bump, drive_east, straight_road
from tests.sim.test_map_import import BLOCK

REAL = Path(__file__).parents[3].parent / "shared" / "real" / "kitti-03"
NOTHING = "nothing vouches for this map"


def write_drive(folder):
    """A drive of 160 m round one corner, in the TUM layout: too short for any network to vouch for."""
    (folder / "rgb").mkdir(parents=True)
    rng, pose = np.random.default_rng(1), np.zeros(3)
    odometry, truth, frames = [], [], []
    for step in range(200):
        t_s, yaw_rate = 0.1 * step, np.pi / 6 if 120 <= step < 150 else 0.0
        odometry.append(f"{t_s:.1f},8.0,{yaw_rate:.6f}\n")
        truth.append(f"{t_s:.1f} {pose[0]:.4f} {pose[1]:.4f} 0 0 0 {np.sin(pose[2] / 2):.9f} {np.cos(pose[2] / 2):.9f}\n")
        if step % 4 == 0:
            image = cv2.resize(rng.integers(0, 255, (8, 12, 3), np.uint8), (96, 64))
            cv2.imwrite(str(folder / "rgb" / f"{step}.png"), image)
            frames.append(f"{t_s:.1f} rgb/{step}.png\n")
        pose = se2.compose(pose, np.array([0.8, 0.0, 0.1 * yaw_rate]))
    for name, lines in (("odometry.csv", odometry), ("groundtruth.txt", truth), ("rgb.txt", frames)):
        (folder / name).write_text("".join(lines))
    return folder


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A recording that no road network can vouch for, and a map of a block of streets."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "block.osm").write_text(BLOCK)
    assert main(["import", str(write_drive(folder / "tum")), "--from", "tum", "--out", str(folder / "recording")]) == DONE
    return folder / "recording", folder / "block.osm"


@pytest.fixture(scope="module")
def finished(drive, tmp_path_factory):
    out = tmp_path_factory.mktemp("finished") / "out"
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(out)]) == DONE
    return out


def test_a_recording_and_an_osm_map_become_a_page(drive, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(out)]) == DONE
    said = capsys.readouterr().out.splitlines()
    assert said[-2].startswith(NOTHING) and "--start" in said[-2] and said[-1] == f"open {out / 'drive.html'}"
    assert next(line for line in said if re.match(r"\d/5 \w+: [\d.]+ s", line)).startswith("1/5 roads")
    assert {path.name.split("-")[0] for path in out.iterdir()} == {
        "semi.pbstream", "topo.pbstream", "refinement.json", "run.json", "drive.html", "findings.geojson", "block",
    }  # fmt: skip
    assert json.loads((out / "findings.geojson").read_text())["features"] == []


def test_the_page_needs_nothing_but_itself_and_says_what_to_do(finished):
    page = (finished / "drive.html").read_text()
    assert not re.search(r'(?:src|href)="(?!data:)', page) and "<script" not in page and "@import" not in page
    assert page.count("data:image/jpeg;base64,") >= 2
    assert NOTHING[1:] in page and "what to do next" in page and "--start" in page
    assert page.count('class="roads"') == 1 and "APE, position" in page


def test_what_is_done_is_not_done_again(drive, finished, capsys):
    before = {path.name: path.stat().st_mtime_ns for path in finished.glob("*.pbstream")}
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(finished)]) == DONE
    said = capsys.readouterr().out
    assert "2/5 map: done before" in said and "3/5 refine: done before" in said
    assert before == {path.name: path.stat().st_mtime_ns for path in finished.glob("*.pbstream")}


def test_a_run_that_was_killed_resumes(drive, finished, capsys):
    (finished / "refinement.json").unlink()
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(finished)]) == DONE
    said = capsys.readouterr().out
    assert "2/5 map: done before" in said and "3/5 refine ..." in said and (finished / "refinement.json").exists()


@pytest.mark.parametrize(("name", "text", "said"), [
    ("run.json", '{"stages": []}', "stages: must be names with values, as in {a: b}, not a list: not the record of a run"),
    ("run.json", '{"asked": {"MAP": 3}}', "asked.MAP: must be text"),
    ("run.json", '{"stages": {"map": {"seconds": 1}}}', "stages.map.said: must be given"),
    ("run.json", "[", "not the record of a run"),
    ("run.json", "9" * 5000, "not the record of a run"),
    ("refinement.json", "{", "not the breaks of a refinement; delete it, and the same command makes it anew"),
    ("refinement.json", '{"breaks": [{"first": 0, "last": 1, "status": "X", "cause": ""}]}', "'X' is no status of a match"),
    ("refinement.json", '{"breaks": [{"first": 0}]}', "breaks.0.last: must be given"),
])  # fmt: skip
def test_what_a_run_keeps_is_not_believed_blindly(drive, finished, tmp_path, capsys, name, text, said):
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    (out / name).write_text(text)
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(out)]) == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"{out / name}: " in line and said in line


def test_results_of_another_map_are_not_mixed_in(drive, finished, tmp_path, capsys):
    other = tmp_path / "other.osm"
    other.write_text(BLOCK.replace("residential", "primary"))
    assert main(["run", str(drive[0]), "--network", str(other), "--out", str(finished)]) == BAD_INPUT
    assert "was made with another MAP; choose a new --out" in capsys.readouterr().err
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--start", "1,2,3", "--out", str(finished)]) == BAD_INPUT
    assert "another --start" in capsys.readouterr().err


def test_options_of_the_import_are_no_options_of_a_recording(drive, tmp_path, capsys):
    arguments = ["run", str(drive[0]), "--network", str(drive[1]), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--fps", "10", "--truth", "gps.gpx"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "is a recording already, and --fps, --truth would say how to make one" in said and "`hippodrome score`" in said


def test_a_run_that_was_told_the_wrong_options_takes_the_right_ones_afterwards(drive, tmp_path, capsys):
    poses = tmp_path / "poses.txt"
    turned = np.radians(90.0) * np.clip((np.arange(160) - 100) / 12.0, 0.0, 1.0)
    x, z = np.cumsum(np.sin(turned)), np.cumsum(np.cos(turned))
    rows = zip(np.cos(turned), np.sin(turned), x, z, strict=True)
    poses.write_text("".join(f"{c} 0 {s} {x} 0 1 0 0 {-s} 0 {c} {z}\n" for c, s, x, z in rows))
    arguments = ["run", str(poses), "--network", str(drive[1]), "--out", str(tmp_path / "out")]
    assert main(arguments) == BAD_INPUT and "--fps N" in capsys.readouterr().err
    assert main([*arguments, "--fps", "10", "--units", "metres"]) == DONE
    assert json.loads((tmp_path / "out" / "run.json").read_text())["asked"].keys() == {"--fps", "--units", "MAP", "DRIVE"}
    assert main([*arguments, "--fps", "5"]) == BAD_INPUT
    assert "another --fps, --units; choose a new --out (the drive is imported already" in capsys.readouterr().err


def test_the_unit_said_at_import_reaches_the_refinement(tmp_path, drive, capsys):
    write_drive(tmp_path / "tum")
    recording, semi, topo = (str(tmp_path / name) for name in ("recording", "semi.pbstream", "topo.pbstream"))
    assert main(["import", str(tmp_path / "tum"), "--units", "metres", "--out", recording]) == DONE
    assert main(["map", recording, "--out", semi]) == DONE
    capsys.readouterr()
    assert main(["refine", semi, "--network", str(drive[1]), "--network-accuracy", "1", "--out", topo]) == DONE
    assert "unit of the odometry: 1 m, as was said when the drive was imported" in capsys.readouterr().out
    provenance = load_map(Path(topo))[1]
    assert "metres_per_unit=1.0" in provenance["refine"] and "survey_sigma_m=1.0" in provenance["refine"]


def test_a_start_in_another_place_is_refused(drive, finished, tmp_path, capsys):
    arguments = ["refine", str(finished / "semi.pbstream"), "--network", str(drive[1]), "--out", str(tmp_path / "topo.pbstream")]
    for start in ("geo:8.4,49.0", "3000,4000,90"):
        assert main([*arguments, "--start", start]) == BAD_INPUT
        assert "km from the nearest road" in capsys.readouterr().err


def test_a_start_in_degrees_is_not_taken_for_metres(drive, finished, tmp_path, capsys):
    arguments = ["refine", str(finished / "semi.pbstream"), "--network", str(drive[1]), "--out", str(tmp_path / "topo.pbstream")]
    for start in ("50.001,8.002,90", "50.4,8.3,0"):
        assert main([*arguments, "--start", start]) == BAD_INPUT
        said = capsys.readouterr().err
        assert "looks like latitude and longitude" in said
        assert f"geo:{start} with" in said


def test_a_folder_of_other_things_is_left_alone(drive, tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["run", str(drive[0]), "--network", str(drive[1]), "--out", str(tmp_path)]) == BAD_INPUT
    assert "holds other files than a run's" in capsys.readouterr().err


def test_a_foreign_layout_is_imported_first(drive, tmp_path, capsys):
    named = write_drive(tmp_path / "<b>drive")
    arguments = ["run", str(named), "--from", "tum", "--network", str(drive[1]), "--out", str(tmp_path / "out")]
    assert main(arguments) == DONE
    assert "2/6 import" in capsys.readouterr().out
    assert "<b>drive" not in (tmp_path / "out" / "drive.html").read_text()
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert set(record["stages"]) == {"roads", "import", "map", "refine", "score", "page"}


def test_the_page_shows_where_the_map_seems_wrong(drive):
    refinement, roads = drive_east(bump(5.0)), straight_road(EAST)
    page = drive_page(
        Drive(
            name="<i>monday", network="town.net.xml", recording=open_recording(drive[0]), cognitive_map=refinement.cognitive_map,
            roads=roads, breaks=(), findings=find_wrong_roads(refinement, roads, SIGMA_M), map_error_m=(0.5, 5.0), reference=None,
            scores=("mean 1.5 m, 9 of 9 samples: RPE, m; delta 1 sample", "mean 0.3 m, 9 of 9 samples: RPE, m; delta 20 m"),
            notes=(), stages={"map": 1.0},
        )
    )  # fmt: skip
    assert "over 50 m the road is drawn up to 5.0 m ± 0.8 north of where it was driven" in page and ">A</text>" in page
    assert "1 place" in page and "x 225 m, y 0 m" in page and "95 % within 5.0 m" in page and "all along this drive" in page
    assert "0.3 m</strong>" in page and "<i>monday" not in page


def test_refine_writes_findings_where_asked(drive, finished, tmp_path, capsys):
    wanted = ["--network", str(drive[1]), "--findings", str(tmp_path / "found.geojson"), "--out", str(tmp_path / "topo.pbstream")]
    assert main(["refine", str(finished / "semi.pbstream"), *wanted]) == DONE
    assert f"{tmp_path / 'found.geojson'}: 0 place(s) where the map seems wrong" in capsys.readouterr().out
    assert "WGS84 degrees" in json.loads((tmp_path / "found.geojson").read_text())["coordinates"]


def test_a_truth_that_comes_once_a_second_is_scored_and_shown(drive, tmp_path, capsys):
    folder = write_drive(tmp_path / "drive")
    rows = (folder / "groundtruth.txt").read_text().splitlines(keepends=True)
    (tmp_path / "seldom.tum").write_text("".join(rows[::10]))
    arguments = ["run", str(folder), "--truth", str(tmp_path / "seldom.tum"), "--network", str(drive[1])]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == DONE
    said = capsys.readouterr().out
    assert "came without truth" not in said and "APE, position" in said
    assert 'class="truth"' in (tmp_path / "out" / "drive.html").read_text()


def test_refine_converts_a_map_once_and_localize_says_what_was_refused(drive, finished, tmp_path, capsys):
    topo, semi = tmp_path / "topo.pbstream", finished / "semi.pbstream"
    for again in (False, True):
        out = tmp_path / "again.pbstream" if again else topo
        assert main(["refine", str(semi), "--network", str(drive[1]), "--out", str(out)]) == DONE
        said = capsys.readouterr().out
        (made,) = tmp_path.glob("block-*.net.xml.gz")
        assert f"its roads are in {made}" in said and NOTHING in said
        made.chmod(0o444)
    network = ["--network", str(drive[1])]
    assert main(["localize", str(topo), str(drive[0]), *network, "--out", str(tmp_path / "drive.tum")]) == DONE
    assert NOTHING in capsys.readouterr().out and len(list(tmp_path.glob("*.net.xml.gz"))) == 1


def kitti_sequence(folder):
    """KITTI 03 as its own layout has it, every second frame."""
    sequence, number = folder / "sequences" / "03", 0
    (sequence / "image_0").mkdir(parents=True)
    (folder / "poses").mkdir()
    with zipfile.ZipFile(REAL / "frames.zip") as packed:
        names = sorted(name for name in packed.namelist() if name.endswith(".jpg"))[::2]
        for number, name in enumerate(names):
            image = cv2.imdecode(np.frombuffer(packed.read(name), np.uint8), cv2.IMREAD_GRAYSCALE)
            cv2.imwrite(str(sequence / "image_0" / f"{number:06d}.png"), image)
    rows = gzip.decompress((REAL / "03.txt.gz").read_bytes()).decode().splitlines(keepends=True)
    (folder / "poses" / "03.txt").write_text("".join(rows[::2]))
    (sequence / "times.txt").write_text("".join(f"{0.2 * i:.6f}\n" for i in range(number + 1)))
    return sequence


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real drive KITTI 03 does not lie at {REAL}")
def test_a_real_drive_ends_with_a_page(tmp_path, capsys):
    arguments = [
        "run", str(kitti_sequence(tmp_path)), "--from", "kitti", "--odometry", "truth", "--size", "207x62",
        "--network", str(REAL / "k03-own-path.osm.gz"), "--out", str(tmp_path / "out"),
    ]  # fmt: skip
    assert main(arguments) == DONE
    said = capsys.readouterr().out.splitlines()
    assert said[-2].startswith((NOTHING, "roads vouch for"))
    page = (tmp_path / "out" / "drive.html").read_text()
    assert page.count("data:image/jpeg") == 6 and "truth, laid on the map by one rigid fit" in page and "APE, position" in page
