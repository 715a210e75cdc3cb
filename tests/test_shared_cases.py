"""Small inputs that once failed, as their reporters sent them: each gives its right value.

They lie beside the checkout, in ``../shared/cases``, and are no part of the project. Where they are not, these tests skip; tests
that write inputs of the same kinds themselves are named in docs/hostile-inputs.md.
"""

import re
import shutil
import tarfile
from pathlib import Path

import numpy as np
import pytest

from hippodrome.eval.cli import main
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.recording import open_recording
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec
from tests.subjects import net

CASES = Path(__file__).parents[1].parent / "shared" / "cases"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the shared cases are not beside the checkout")

# Input, how it is read ({0}: the input, {1}: a new path), and what is said; the command ends with 2.
REFUSED = [
    ("reli/recording-zipbomb.tar.xz", "map {0} --out {1}", "4294971233 bytes, the limit is"),
    ("reli/recording-pngbomb.tar.xz", "map {0} --out {1}", "30000 x 30000 pixels, the limit is"),
    ("reli/rec-dt-negative-hang.tar.xz", "map {0} --out {1}", "is not above zero"),
    ("reli/rec-frame-empty.tar.xz", "map {0} --out {1}", "frame 34 cannot be read"),
    ("reli/rec-samples-0d-array.tar.xz", "map {0} --out {1}", "yaw_rate_radps is float64"),
    ("reli/rec-zip-encrypted.tar.xz", "map {0} --out {1}", "is encrypted"),
    ("reli/rec-zip-method99.tar.xz", "map {0} --out {1}", "compression method is not supported"),
    ("reli/zstd-bomb.mcap", "import {0} --out {1}", "unpacks to 203914 or more"),
    ("reli/one-bit-flipped.mcap", "import {0} --out {1}", "checksum of a chunk does not hold"),
    ("reli/zstd-error.mcap", "import {0} --out {1}", "mcap recover"),
    ("reli/odometry-one-row-1e300.csv", "import {tum} --odometry {0} --out {1}", "row 60, 6.000 s: speed 1e[+]300"),
    ("reli/odometry-all-1e300.csv", "import {tum} --odometry {0} --out {1}", "row 1, 0.100 s: speed 1e[+]300"),
    ("reli/map-motion-huge.pbstream", "refine {0} --network {net} --out {1}", "damaged or hostile"),
    ("reli/map-empty-map.pbstream", "refine {0} --network {net} --mode paper --start 0,0,0 --out {1}", "record a longer drive"),
    ("reli/map-two-vertices.pbstream", "refine {0} --network {net} --out {1}", "map the drive anew"),
    ("reli/sigabrt-del-edge.function.net.xml", "scenario new x --from {0} --out {1}", "edge.*mend it in netedit"),
    ("reli/sigabrt-drop-connection.net.xml", "scenario new x --from {0} --out {1}", "SUMO cannot drive on it: sumo crashed"),
    ("reli/drop-junction.net.xml", "scenario new x --from {0} --out {1}", "junction '1,5' lies at"),
    ("reli/edge-from-unknown.net.xml", "scenario new x --from {0} --out {1}", "which the file does not describe"),
    ("reli/junction-1e308.net.xml", "scenario new x --from {0} --out {1}", "junction '3' lies at"),
    ("reli/nonsense-lane-speed-nan.net.xml", "scenario new x --from {0} --out {1}", "speed limit of nan"),
    ("reli/nonsense-lane-speed-negative.net.xml", "scenario new x --from {0} --out {1}", "speed limit of -1"),
    ("reli/nonsense-lane-width-negative.net.xml", "scenario new x --from {0} --out {1}", "width of -1e"),
    ("reli/netconvert-3GiB.xodr", "scenario new x --from {0} --out {1}", "geometry '149'"),
    ("reli/lol.osm", "scenario new x --from {0} --out {1}", "declares XML entities"),
    ("reli/int5000.yaml", "eval {0} --out {1}", "5000 characters"),
    ("reli/date.yaml", "eval {0} --out {1}", "no timestamp"),
    ("reli/nul.yaml", "eval {0} --out {1}", "not valid YAML"),
    ("reli/merge.yaml", "eval {0} --out {1}", "454008393 values, the limit is 100000"),
    ("reli/yaml-bool-tag.yaml", "eval {0} --out {1}", "no bool"),
    ("reli/yaml-float-tag.yaml", "eval {0} --out {1}", "no float"),
    ("reli/yaml-ts-tag.yaml", "eval {0} --out {1}", "no timestamp"),
    ("reli/nanbin.yaml", "eval {0} --out {1}", "bin_m: must be a finite number"),
    ("reli/results-int5000.json", "compare {0} {0}", "not a readable results file"),
    ("reli/results-int5000.json", "report {0}", "not a readable results file"),
    ("reli/baseline-int5000.json", "gate --power --baseline {0}", "not a readable baseline"),
    ("reli/kitti-origin-cut.tar.xz", "import {0}/sequences/01 --from kitti --out {1}", "expected a matrix of 4"),
    ("reli/svd.tum", "score {0} {rec}", "a position beyond"),
    ("traj/cam.tum", "import {tum} --odometry {0} --axes body --out {1}", "give --axes camera"),
    ("traj/wxyz.tum", "import {tum} --odometry {0} --out {1}", "order qx qy qz qw"),
    ("traj/gap.csv", "import {tum} --odometry {0} --out {1}", "row 41, 64.100 s, comes 60.1 s after"),
    ("traj/firstgap.csv", "import {tum} --odometry {0} --out {1}", "comes 60.1 s after"),
    ("traj/huge.csv", "import {tum} --odometry {0} --out {1}", "row 41, 4.100 s: speed 1e[+]300"),
    ("traj/ns.tum", "import {tum} --truth {0} --out {1}", "look like nanoseconds"),
    ("traj/unfinished.mcap", "import {0} --out {1}", "its writer was not closed"),
    ("traj/unsorted.tum", "score {0} {rec}", "sort the rows"),
    ("traj/unnorm2.tum", "score {0} {rec}", "not a unit quaternion"),
    ("nets/service-roads-only.osm", "scenario new x --from {0} --out {1}", "holds no roads for cars"),
]
# The same for what is taken, with 0, and what is said of it.
TAKEN = [
    ("reli/one-bit-flipped.original.mcap", "import {0} --out {1}", "165 frames"),
    ("reli/markup-A.json", "compare {0} {0}", r"x\[/b\]|stand still|nothing moved"),
    ("reli/escape-A.json", "compare {0} {0}", ""),
    (
        "reli/map-zip-longer.pbstream",
        "refine {0} --network {net} --out {1}",
        "nothing vouches .* refused all of its 129 vertices",
    ),
    ("traj/ns.csv", "import {tum} --odometry {0} --out {1}", "taken for nanoseconds"),
    ("traj/leadcomment.tum", "import {tum} --truth {0} --out {1}", "truth for 100%"),
    ("traj/bom.tum", "score {0} {rec}", "mean 0.000 m.* 120 of 120"),
    ("traj/leadcomment.tum", "score {0} {rec}", "mean 0.000 m.* 120 of 120"),
    ("traj/dup.tum", "score {0} {rec}", "1 row.s. with the time of the one before are left out"),
    ("traj/one.tum", "score {0} {rec}", "not scored: APE.*\n.*mean 0.000 m.*alignment start"),
    ("traj/still.tum", "score {0} {rec}", "not scored: APE.*\n.*mean 29.489 m.*alignment start"),
    ("traj/norepeat.mcap", "import {0} --out {1}", "120 frames"),
    ("traj/cut.mcap", "import {0} --out {1}", "the 207 messages before the cut are read"),
    ("traj/json.mcap", "import {0} --out {1}", "120 frames"),
    ("traj/bags/bgra8.bag", "import {0} --out {1}", "120 frames"),
    ("traj/bags/dup_odom.bag", "import {0} --out {1}", "1 message.s. that repeat the time"),
    ("traj/bags/twist_zero.bag", "import {0} --out {1}", "the poses are differentiated"),
    ("traj/bags/rear_first.bag", "import {0} --out {1}", "images of /cam_back/image .not of /cam_front/image.*--topic names"),
    ("nets/no-internal-links.net.xml", "scenario new x --from {0} --out {1}", "netconvert --no-internal-links=false -s"),
    ("nets/keep-left.osm", "scenario new x --from {0} --out {1}", "traffic keeps left, for 1 of its 1 roundabouts"),
    ("nets/keep-left.xodr", "scenario new x --from {0} --out {1}", "traffic keeps left.*rule=LHT"),
    ("nets/one-lane-both-ways.net.xml", "scenario new x --from {0} --out {1}", "A1B1.* and B1A1 share one lane"),
    ("nets/spiral-constant-curvature.xodr", "scenario new x --from {0} --out {1}", "2 spiral.s. of constant curvature"),
    ("nets/spiral-nearly-constant.xodr", "scenario new x --from {0} --out {1}", "2 spiral.s. of constant curvature"),
    ("nets/root-after-long-comment.net.xml", "scenario new x --from {0} --out {1}", "0.59 km"),
    ("nets/root-attributes-on-new-lines.net.xml", "scenario new x --from {0} --out {1}", "0.59 km"),
    ("nets/tls-offset-begin.net.xml", "scenario new x --from {0} --out {1}", "0.59 km"),
    ("nets/connector-edge.net.xml", "scenario new x --from {0} --out {1}", "0.59 km"),
    ("nets/loop.net.xml", "scenario new x --from {0} --out {1}", "0.59 km"),
    ("nets/osm_bbox.osm.xml.gz", "scenario new x --from {0} --out {1}", "5.21 km"),
]
# Networks that are driven: length, vehicles, seed, and whether traffic keeps left.
DRIVEN = [
    ("change-inside-junction.net.xml", 2500, 8, 1, False),
    ("one-road.net.xml", 400, 2, 1, False),
    ("one-lane-both-ways.net.xml", 3100, 7, 3, False),
    ("overpass.net.xml", 1000, 25, 1, False),
    ("lefthand-yes.net.xml", 300, 2, 1, True),
    ("connector-edge.net.xml", 300, 2, 1, False),
    ("tram-and-cycleway.net.xml", 300, 2, 1, False),
    ("keep-left.xodr", 300, 3, 1, True),
    ("keep-left.osm", 300, 3, 1, True),
    ("spiral-constant-curvature.xodr", 300, 3, 1, False),
]


@pytest.fixture(scope="session")
def places(tmp_path_factory):
    """A network, a drive in TUM's layout, and the recording of that."""
    folder = tmp_path_factory.mktemp("places")
    net(folder)
    drive = CASES / "traj" / "tum_zero"
    assert main(["import", str(drive), "--out", str(folder / "rec")]) == 0
    return {"net": folder / "a.net.xml", "tum": drive, "rec": folder / "rec"}


def read(name, command, places, folder):
    """The exit status of a command over a case, which is unpacked if it is packed, or filed where results are looked for."""
    case = CASES / name
    if name.endswith(".tar.xz"):
        with tarfile.open(case) as archive:
            archive.extractall(folder, filter="data")
        (case,) = folder.iterdir()
    if "results" in name or "markup" in name or "escape" in name:
        shutil.copy(case, folder / "results.json")
        case = folder
    ending = ".yaml" if "scenario new" in command else ""
    words = command.format(case, folder.parent / f"{folder.name}-out{ending}", **places).split()
    return main(words)


@pytest.mark.parametrize(("name", "command", "says"), REFUSED)
def test_a_sentence_says_why(name, command, says, places, tmp_path, capsys):
    (folder := tmp_path / "case").mkdir()
    capsys.readouterr()
    assert read(name, command, places, folder) == 2
    said = capsys.readouterr().err
    assert len(said.strip().splitlines()) == 1
    assert re.search(says, said)


@pytest.mark.parametrize(("name", "command", "says"), TAKEN)
def test_what_is_right_is_read(name, command, says, places, tmp_path, capsys):
    (folder := tmp_path / "case").mkdir()
    capsys.readouterr()
    assert read(name, command, places, folder) == 0
    said = "".join(capsys.readouterr())
    assert re.search(says, said) and "\x1b" not in said


@pytest.mark.parametrize("name", ["tum_at0", "tum_late", "tum_epoch", "tum_zero"])
def test_a_truth_against_itself_has_no_error(name, tmp_path, capsys):
    assert main(["import", str(CASES / "traj" / name), "--out", str(tmp_path / "rec")]) == 0
    capsys.readouterr()
    assert main(["score", str(CASES / "traj" / name / "groundtruth.txt"), str(tmp_path / "rec")]) == 0
    assert capsys.readouterr().out.count("mean 0.000 m, median 0.000, p95 0.000, max 0.000, 120 of 120") == 3


def test_poses_of_a_camera_are_the_motion_of_the_vehicle(tmp_path):
    traj = CASES / "traj"
    words = ["--odometry", str(traj / "cam.tum"), "--axes", "camera", "--out", str(tmp_path / "rec")]
    assert main(["import", str(traj / "tum_zero"), *words]) == 0
    steps = list(open_recording(tmp_path / "rec").self_motion())
    assert np.allclose([step.speed for step in steps], 5.0, atol=0.01)
    assert max(abs(step.yaw_rate_radps) for step in steps) == pytest.approx(0.3, abs=0.01)


def test_a_truth_of_one_pose_a_second_is_scored_at_its_times(tmp_path, capsys):
    traj = CASES / "traj"
    assert main(["import", str(traj / "tum_zero"), "--truth", str(traj / "gt1hz.tum"), "--out", str(tmp_path / "rec")]) == 0
    assert main(["score", str(traj / "ok.tum"), str(tmp_path / "rec")]) == 0
    assert "mean 0.000 m, median 0.000, p95 0.000, max 0.000, 12 of 12" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "length_m", "vehicles", "seed", "left_hand"), DRIVEN)
def test_a_network_is_driven(name, length_m, vehicles, seed, left_hand, tmp_path):
    town = build_town(TownSpec(network=CASES / "nets" / name), seed, tmp_path)
    assert town.left_hand == left_hand
    drive = simulate_drive(town, TourSpec(length_m=length_m), TrafficSpec(vehicles=vehicles), EgoSpec(), seed)
    driven_m = np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum()
    assert driven_m == pytest.approx(length_m, rel=0.03, abs=20)
