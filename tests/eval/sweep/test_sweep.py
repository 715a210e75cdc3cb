"""The same results from local processes and from a Dask cluster that loses a worker; nothing is run twice."""

import json
import os
import signal
import threading
import time

import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.results.model import read_results, to_json, without_timings
from hippodrome.eval.sweep.cell import CellResult

TINY = """\
name: tiny
town: {kind: grid, width_m: 150, height_m: 150, road_km: 0.8}
camera: {width: 32, height: 24, supersample: 1, rate_hz: 2}
odometry_rate_hz: 4
mapping: {tour: {length_m: 500}, traffic: {vehicles: 0}}
localization: {tour: {length_m: 120}, traffic: {vehicles: 0}}
"""
GRID = ("--set", "localizer.mode=default,kalman")  # two cells that share their drives


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "tiny.yaml"
    path.write_text(TINY)
    return path


@pytest.fixture(scope="module")
def local(scenario, tmp_path_factory):
    out = tmp_path_factory.mktemp("local")
    assert main(["sweep", str(scenario), *GRID, "--workers", "1", "--out", str(out)]) == DONE
    return out


def kill_once(pids, out):
    """Kill a worker as soon as the first drive is recorded: others are under way."""
    while not list(out.glob("recordings/*/manifest.json")):
        time.sleep(0.05)
    os.kill(pids[0], signal.SIGKILL)


def test_a_cluster_that_loses_a_worker_gives_the_same_results(scenario, local, tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs="CRITICAL"
    )
    with cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        assert len(set(pids)) == 2
        assert os.getpid() not in pids
        killer = threading.Thread(target=kill_once, args=(pids, tmp_path), daemon=True)
        killer.start()
        assert main(["sweep", str(scenario), *GRID, "--scheduler", cluster.scheduler_address, "--out", str(tmp_path)]) == DONE
        killer.join(timeout=1.0)
        assert not killer.is_alive()
    ours, theirs = (to_json(without_timings(read_results(out / "results.json"))) for out in (local, tmp_path))
    assert len(json.loads(ours)["scenarios"]) == 2
    assert ours == theirs


def test_the_samples_are_those_behind_the_figures(local):
    cells = [CellResult.model_validate_json(path.read_text()) for path in local.glob("cells/*/cell.json")]
    assert len(cells) == 2
    assert len(list(local.glob("recordings/tiny-*"))) == 2
    for cell in cells:
        for row in cell.result.rows:
            if row.ape is not None:
                errors_m = cell.samples[row.method]["ape"].errors_m
                assert sum(errors_m) / len(errors_m) == pytest.approx(row.ape.mean_m, abs=2e-6)
            if row.localization is not None and row.localization.error_mean_m is not None:
                errors_m = cell.samples[row.method]["localization"].errors_m
                assert sum(errors_m) / len(errors_m) == pytest.approx(row.localization.error_mean_m, abs=2e-6)


def test_finished_cells_are_kept_and_a_damaged_one_is_named(scenario, local, capsys):
    capsys.readouterr()
    assert main(["sweep", str(scenario), *GRID, "--workers", "1", "--out", str(local)]) == DONE
    assert "2 cell(s): 2 kept, 0 run, 0 failed" in capsys.readouterr().out
    damaged = next(local.glob("cells/*/cell.json"))
    damaged.write_text("{")
    assert main(["sweep", str(scenario), *GRID, "--workers", "1", "--out", str(local)]) == BAD_INPUT
    assert f"{damaged}: not a cell's result" in capsys.readouterr().err
