"""A tiny town from its mapping drive to a mission's figures; what is done is kept, and made anew it has the same bytes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.eval.drive.run import DriveRequest, drive
from hippodrome.sim.render.probe import require_gl

TOWN = """
name: hamlet
seed: 4
town: {kind: grid, width_m: 130, height_m: 130, road_km: 0.8}
camera: {rate_hz: 5}
noise: paper
mapping:
  tour: {length_m: 500}
  traffic: {vehicles: 0}
localization:
  tour: {length_m: 300}
  traffic: {vehicles: 2}
"""


@pytest.fixture
def request_of(tmp_path):
    require_gl()
    scenario = tmp_path / "hamlet.yaml"
    scenario.write_text(TOWN)
    return DriveRequest([scenario], None, None, 1, ["truth"], 1, tmp_path / "out")


def test_a_mission_is_driven_kept_and_made_anew_with_the_same_bytes(request_of, capsys):
    drive(request_of)
    assert "hamlet" in capsys.readouterr().out
    out = request_of.out
    results = json.loads((out / "results.json").read_text())
    row = results["scenarios"][0]["rows"][0]["drive"]
    assert row["missions"] == 1 and row["realtime_factor"] > 0.0
    assert {"seed", "start", "goal", "end", "cause"} <= set(row["missions_detail"][0])
    assert row["missions_detail"][0]["cause"] == "arrived", row["missions_detail"][0]
    assert row["false_arrivals"] == 0 and row["wrong_way"] == 0
    assert "<svg" in (out / "drive.html").read_text()
    (file,) = (out / "hamlet" / "missions").glob("*.json")
    first, trace, written = (
        json.loads(file.read_text())["figures"],
        np.load(file.with_suffix(".npz"))["trace"],
        file.stat().st_mtime_ns,
    )
    drive(request_of)
    assert file.stat().st_mtime_ns == written
    file.unlink()
    drive(replace(request_of, film=True))
    assert file.with_suffix(".webp").stat().st_size > 10_000
    assert json.loads(file.read_text())["figures"] == first
    assert np.array_equal(np.load(file.with_suffix(".npz"))["trace"], trace, equal_nan=True)
