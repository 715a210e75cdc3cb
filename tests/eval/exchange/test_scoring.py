"""``hippodrome score``: what is said of real truth, of estimates of every kind, and of what cannot be scored."""

import dataclasses
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.types import MatchStatus, Trajectory
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE, THRESHOLD_FAILED
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.proto.codec import save_map
from hippodrome.sim.georeference import GeoReference
from hippodrome.sim.recording import open_recording
from tests.proto.maps import random_map
from tests.sim.test_georeference import UTM32, net

OFFSET = (-454791.0, -5425352.39)


def rows(trajectory, shift_s=0.0):
    half = trajectory.poses[:, 2] / 2.0
    columns = [trajectory.t_s + shift_s, *trajectory.poses[:, :2].T, *np.zeros((3, len(half))), np.sin(half), np.cos(half)]
    return np.column_stack(columns)


def foreign(run, exported, folder, shift_s):
    """The drive as a TUM sequence of somebody else's, whose clock is ``shift_s`` ahead of ours; its truth."""
    shutil.copytree(exported("tum") / "hamlet-mapping", folder)
    for name, separator in (("odometry.csv", ","), ("rgb.txt", " ")):
        lines = []
        for line in (folder / name).read_text().splitlines():
            words = line.split(separator)
            if not line.startswith("#"):
                words[0] = repr(float(words[0]) + shift_s)
            lines.append(separator.join(words))
        (folder / name).write_text("\n".join(lines) + "\n")
    truth = run.mapping.ground_truth()
    np.savetxt(folder / "groundtruth.txt", rows(truth, shift_s), fmt="%.17g")
    return truth


def imported(folder, out, *options):
    assert main(["import", str(folder), "--from", "tum", "--out", str(out), *map(str, options)]) == DONE


def scored(capsys, *arguments):
    capsys.readouterr()
    status = main(["score", *map(str, arguments)])
    return status, capsys.readouterr()


@pytest.mark.parametrize("shift_s", [0.0, -0.1, 3.0, 1403636580.0])
def test_a_truth_against_itself_has_no_error_in_any_clock(run, exported, tmp_path, capsys, shift_s):
    foreign(run, exported, tmp_path / "seq", shift_s)
    imported(tmp_path / "seq", tmp_path / "in")
    status, said = scored(capsys, tmp_path / "seq" / "groundtruth.txt", tmp_path / "in")
    assert status == DONE
    figures = [line for line in said.out.splitlines() if not line.startswith("note")]
    assert len(figures) >= 2
    assert all(line.startswith("mean 0.000 m, median 0.000, p95 0.000, max 0.000, 60 of 60") for line in figures[:2])


def test_what_hippodrome_wrote_is_in_the_recordings_clock(run, exported, tmp_path, capsys):
    truth = foreign(run, exported, tmp_path / "seq", 100.0)
    imported(tmp_path / "seq", tmp_path / "in")
    write_tum(tmp_path / "localized.tum", truth)
    status, said = scored(capsys, tmp_path / "localized.tum", tmp_path / "in")
    assert status == DONE
    assert said.out.startswith("mean 0.000 m")


def test_sparse_truth_is_scored_at_its_own_times(run, exported, tmp_path, capsys):
    truth = foreign(run, exported, tmp_path / "seq", 0.0)
    t_s = np.arange(0.55, 5.9, 1.0)  # between the steps
    fixes = Trajectory(t_s, se2.interpolate(truth.t_s, truth.poses, t_s))
    np.savetxt(tmp_path / "fixes.tum", rows(fixes), fmt="%.17g")
    imported(tmp_path / "seq", tmp_path / "in", "--truth", tmp_path / "fixes.tum", "--truth-frame", "network")
    estimate = Trajectory(truth.t_s, truth.poses + np.array([0.3, 0.4, 0.0]))
    np.savetxt(tmp_path / "estimate.tum", rows(estimate), fmt="%.17g")
    status, said = scored(capsys, tmp_path / "estimate.tum", tmp_path / "in", "--truth-sigma", "2")
    assert status == DONE
    first = said.out.splitlines()[0]
    assert first.startswith(f"mean 0.500 m, median 0.500, p95 0.500, max 0.500, {len(t_s)} of {len(t_s)} samples")
    assert "at the truth's times, estimate linear in time within gaps <= 1 s" in first
    assert "uncertain by 2.00 m" in said.out
    assert "about 2.51 m" in said.out


def test_fixes_on_earth_are_scored_in_the_networks_frame(run, exported, tmp_path, capsys):
    truth = foreign(run, exported, tmp_path / "seq", 0.0)
    network = net(tmp_path / "a.net.xml")
    places = GeoReference(UTM32, OFFSET, "a").to_lat_lon(truth.poses[::10])
    lines = [f"{t!r},{lat:.10f},{lon:.10f},1.5" for t, (lat, lon) in zip(truth.t_s[::10].tolist(), places, strict=True)]
    (tmp_path / "fixes.csv").write_text("t_s,lat,lon,sigma_m\n" + "\n".join(lines) + "\n")
    write_tum(tmp_path / "estimate.tum", Trajectory(truth.t_s, truth.poses + np.array([0.3, 0.4, 0.0])))
    options = ["--truth", tmp_path / "fixes.csv", "--network", network]
    status, said = scored(capsys, tmp_path / "estimate.tum", run.mapping.folder, *options)
    assert status == DONE
    assert said.out.startswith("mean 0.500 m")
    assert "alignment none" in said.out
    assert "not scored: RPE: fixes have no heading" in said.out
    assert "uncertain by 1.50 m" in said.out
    imported(tmp_path / "seq", tmp_path / "in", *options)
    again = scored(capsys, tmp_path / "estimate.tum", tmp_path / "in")[1]
    assert again.out.splitlines()[0] == said.out.splitlines()[0]


def test_truth_of_another_time_is_refused_with_the_cure(run, exported, tmp_path, capsys):
    foreign(run, exported, tmp_path / "seq", 0.0)
    (tmp_path / "fixes.csv").write_text("t_s,lat,lon\n1777000000,49,8\n1777000001,49.0001,8\n")
    estimate = tmp_path / "seq" / "groundtruth.txt"
    status, said = scored(capsys, estimate, run.mapping.folder, "--truth", tmp_path / "fixes.csv")
    assert (status, "--time-offset" in said.err) == (BAD_INPUT, True)
    arguments = ["--from", "tum", "--truth", tmp_path / "fixes.csv", "--out", tmp_path / "in"]
    assert main(["import", str(tmp_path / "seq"), *map(str, arguments)]) == BAD_INPUT
    assert "same clock" in capsys.readouterr().err
    assert not (tmp_path / "in").exists()


@pytest.mark.parametrize("count", [1, 60])
def test_one_pose_and_a_standing_vehicle_are_scored_where_that_is_possible(run, exported, tmp_path, capsys, count):
    truth = foreign(run, exported, tmp_path / "seq", 0.0)
    imported(tmp_path / "seq", tmp_path / "in")
    still = Trajectory(truth.t_s[-count:], np.tile([1.0, 2.0, 0.0], (count, 1)))
    np.savetxt(tmp_path / "still.tum", rows(still), fmt="%.17g")
    status, said = scored(capsys, tmp_path / "still.tum", tmp_path / "in")
    assert status == DONE
    assert said.out.startswith("not scored: APE, alignment SE(2): ")
    assert "alignment start" in said.out
    assert "alignment none" in said.out
    assert "use alignment" not in said.out


def test_limits_and_figures_as_a_file(run, tmp_path, capsys):
    estimate = run.scenario / "topometric.tum"
    status, said = scored(capsys, estimate, run.mapping.folder, "--json", tmp_path / "a.json", "--max-ape", "100")
    assert (status, "limit holds: mean APE" in said.out) == (DONE, True)
    figures = json.loads((tmp_path / "a.json").read_text())["figures"]
    assert f"mean {figures[0]['mean_m']:.3f} m" in said.out.splitlines()[0]
    for limit in ("--max-ape", "--max-rpe"):
        status, said = scored(capsys, estimate, run.mapping.folder, limit, "0.0001")
        assert (status, "limit missed" in said.out) == (THRESHOLD_FAILED, True)


def test_a_map_is_told_by_its_content_and_says_when_nothing_vouches_for_it(run, tmp_path, capsys):
    found = random_map(seed=1, vertices=12, edges=20, refined=True)
    refused = dataclasses.replace(
        found,
        t_s=run.mapping.samples.t_s[5:29:2].copy(),
        road_match=dataclasses.replace(found.road_match, status=np.full(12, MatchStatus.NO_ROUTE, np.uint8)),
    )
    save_map(tmp_path / "a.pb", refused, {})
    status, said = scored(capsys, tmp_path / "a.pb", run.mapping.folder)
    assert status == DONE
    assert said.out.startswith(f"note: {refusal_note(refused)}\n")
    assert "nothing vouches for this map" in said.out
    assert "no route" in said.out
    one = refused.road_match.status.copy()
    one[3] = MatchStatus.MATCHED
    assert refusal_note(dataclasses.replace(refused, road_match=dataclasses.replace(refused.road_match, status=one))) is None
    assert refusal_note(random_map(vertices=12, edges=20)) is None


def test_a_reader_that_has_seen_enough_ends_the_command_quietly():
    code = "from hippodrome.eval.cli import main; import sys; sys.exit(main(['scenario', 'schema']))"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == DONE


def test_the_truth_of_an_import_is_kept_as_it_came(run, exported, tmp_path):
    foreign(run, exported, tmp_path / "seq", 7.0)
    imported(tmp_path / "seq", tmp_path / "in")
    assert "truth.npz" in open_recording(tmp_path / "in").manifest["sha256"]


def test_a_localizer_s_poses_are_scored_in_full_with_a_column_that_says_which_it_stands_by(run, tmp_path, capsys):
    drive = run.mapping
    truth = drive.ground_truth()
    table = rows(truth)
    table[50:60, 1] += 50.0  # a false fix
    stands = (np.arange(len(table)) >= 20).astype(int)
    file, out = tmp_path / "localized.tum", tmp_path / "score.json"
    np.savetxt(file, np.column_stack([table, stands]), fmt=["%.9f"] * 8 + ["%d"])
    status, said = scored(capsys, file, drive.folder, "--localization", "--json", out, "--max-ape", 100)
    assert status == DONE
    found = json.loads(out.read_text())
    assert found["localized_column"]
    figures = found["localization"]
    assert figures["success"]
    assert figures["false_fixes"] == 1
    assert figures["initial_drive_s"] == pytest.approx(truth.t_s[20] - truth.t_s[0])
    assert figures["localized_share"] == pytest.approx(1.0 - 20 / len(table))
    assert figures["initial_time_ms"] is None
    assert "false fixes: 1" in said.out
    assert scored(capsys, file, drive.folder, "--localization", "--max-ape", 0.001)[0] == THRESHOLD_FAILED


def test_without_the_column_a_localizer_stands_by_all_poses_and_did_not_know_where_it_has_none(run, tmp_path, capsys):
    drive = run.mapping
    table = rows(drive.ground_truth())
    file, out = tmp_path / "localized.tum", tmp_path / "score.json"
    np.savetxt(file, table[len(table) // 2 :], fmt="%.9f")
    status, said = scored(capsys, file, drive.folder, "--localization", "--json", out)
    assert status == DONE
    assert "no column 'localized'" in said.out
    figures = json.loads(out.read_text())["localization"]
    assert figures["error_mean_m"] < 0.001
    assert figures["localized_share"] == pytest.approx(0.5, abs=0.02)
    file.write_text(file.read_text().replace("\n", " 2\n"))
    status, said = scored(capsys, file, drive.folder, "--localization")
    assert status == BAD_INPUT
    assert "line 1: '2' in the column 'localized'" in said.err
