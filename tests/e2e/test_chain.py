"""The whole chain: a road network in, a scored topometric map out."""

import json

import numpy as np
import pytest

from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.types import EdgeKind
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.metrics.trajectory import ape
from hippodrome.eval.results.model import read_results, to_json, without_timings


def rows_of(out):
    (scenario,) = read_results(out / "results.json").scenarios
    return {row.method: row for row in scenario.rows}


def test_every_method_has_a_row_and_every_figure_a_definition(run):
    assert run.status == DONE
    rows = rows_of(run.out)
    rivals = {"dead reckoning", "RatSLAM", "semi-metric, no attractor"}
    assert set(rows) == {*rivals, "semi-metric", "topometric (paper)", "topometric"}
    for row in rows.values():
        assert row.failure is None
        assert "alignment" in row.ape.definition
        assert row.rpe.count > 0


def test_the_semi_metric_map_is_wrong_in_metres_and_the_topometric_one_is_not(run):
    rows = rows_of(run.out)
    assert rows["semi-metric"].ape.mean_m > 20.0
    assert rows["topometric (paper)"].ape.mean_m < 5.0
    assert rows["topometric"].ape.mean_m < 2.0


def test_a_second_drive_is_localized_from_an_unknown_start(run):
    for method in ("topometric (paper)", "topometric"):
        localization = rows_of(run.out)[method].localization
        assert localization.success
        assert localization.error_mean_m < 5.0


def test_the_contract_of_the_results_file(run):
    (scenario,) = json.loads((run.out / "results.json").read_text())["scenarios"]
    assert {"name", "seed", "network", "noise", "frames", "duration_s", "rows"} <= set(scenario)
    assert set(scenario["network"]) >= {"path", "generator", "edges", "km"}
    for row in scenario["rows"]:
        assert {"method", "ape", "rpe", "cpu_percent", "map_bytes", "vertices", "edges", "localization"} <= set(row)
        assert {"mean_m", "median_m", "p95_m", "max_m", "count", "definition"} <= set(row["ape"])
    localization = scenario["rows"][-1]["localization"]
    assert {"success", "error_mean_m", "initial_time_ms", "initial_distance_m", "false_fixes"} <= set(localization)


def test_the_figures_can_be_computed_again_from_the_files(run):
    folder = run.out / "hamlet"
    truth = read_tum(folder / "ground-truth.tum")
    again = ape(read_tum(folder / "topometric.tum"), truth)
    assert rows_of(run.out)["topometric"].ape.mean_m == pytest.approx(again.mean_m, abs=1e-5)


def test_the_same_seed_gives_the_same_bytes_with_one_worker(run, tmp_path):
    assert main(["eval", str(run.scenario), "--workers", "1", "--out", str(tmp_path)]) == DONE
    again, before = (without_timings(read_results(out / "results.json")) for out in (tmp_path, run.out))
    assert to_json(again) == to_json(before)
    files = {
        path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.suffix in {".zip", ".npz", ".pbstream", ".tum", ".xml"}
    }
    assert any(path.suffix == ".pbstream" for path in files)
    for path in files:
        assert (tmp_path / path).read_bytes() == (run.out / path).read_bytes(), path


def test_a_second_run_draws_nothing_again(run):
    chunks = {path: path.stat().st_mtime_ns for path in run.out.rglob("frames-*.zip")}
    assert chunks
    assert main(["render", str(run.scenario), "--workers", "1", "--out", str(run.out)]) == DONE
    assert {path: path.stat().st_mtime_ns for path in run.out.rglob("frames-*.zip")} == chunks


def test_closures_come_from_the_frames(run):
    """The same drive with frames of noise: nothing is recognised, so nothing closes."""
    recording, rng = run.recording("mapping"), np.random.default_rng(0)

    def blinded():
        for observation in recording.observations():
            noise = None if observation.frame is None else rng.integers(0, 256, observation.frame.shape, dtype=np.uint8)
            yield type(observation)(observation.t_s, observation.dt_s, observation.speed, observation.yaw_rate_radps, noise)

    seeing, _ = map_recording(recording.observations(), Mapper(MapperConfig()))
    blind, _ = map_recording(blinded(), Mapper(MapperConfig()))
    assert np.count_nonzero(seeing.edges.kind == EdgeKind.CLOSURE) >= 10
    assert np.count_nonzero(blind.edges.kind == EdgeKind.CLOSURE) == 0


def test_a_missed_threshold_is_exit_status_1(run, tmp_path, capsys):
    strict = tmp_path / "strict.yaml"
    strict.write_text(run.scenario.read_text() + "thresholds: {method: topometric, ape_mean_m: 0.001}\n")
    assert main(["eval", str(strict), "--workers", "2", "--out", str(run.out)]) == THRESHOLD_FAILED
    assert "hamlet: topometric: APE mean, m is" in capsys.readouterr().err


def test_the_stages_run_alone_on_files(run, tmp_path, capsys):
    mapping, drive = (run.recording(role).folder for role in ("mapping", "localization"))
    (network,) = (run.out / "towns").glob("*.net.xml")
    semi, topo, track = tmp_path / "semi.pbstream", tmp_path / "topo.pbstream", tmp_path / "drive.tum"
    assert main(["map", str(mapping), "--out", str(semi)]) == DONE
    assert main(["refine", str(semi), "--network", str(network), "--out", str(topo)]) == DONE
    assert main(["localize", str(topo), str(drive), "--network", str(network), "--out", str(track)]) == DONE
    error = ape(read_tum(track), read_tum(run.out / "hamlet" / "localization-ground-truth.tum"), min_coverage=0.1)
    assert error.mean_m < 5.0
    assert "never" not in capsys.readouterr().out
