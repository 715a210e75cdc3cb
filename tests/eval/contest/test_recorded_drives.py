"""Drives that were recorded elsewhere take the place of simulated ones."""

import json
import shutil

import numpy as np
import pytest
import yaml

from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import entries_of
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.files.scenarios import effective_configuration, read_scenario
from hippodrome.eval.methods.materials import _require_truth, gather
from hippodrome.eval.results.model import read_results, result_of
from hippodrome.sim.recording import open_recording


@pytest.fixture
def recorded(run, tmp_path):
    """A scenario of the small town's two recordings, as if they had been imported."""
    for role in ("mapping", "localization"):
        shutil.copytree(run.recording(role).folder, tmp_path / role)
        manifest = json.loads((tmp_path / role / "manifest.json").read_text())
        manifest.pop("tour")
        manifest.pop("manifest_sha256")  # as recordings of earlier versions, which have none
        (tmp_path / role / "manifest.json").write_text(json.dumps(manifest))
    written = yaml.safe_load(run.scenario.read_text())
    drives = {role: {"recording": role} for role in ("mapping", "localization")}
    path = tmp_path / "recorded.yaml"
    path.write_text(yaml.safe_dump({**written, "name": "recorded", **drives}))
    return read_scenario(path)


def test_a_recording_is_evaluated_like_a_simulated_drive(recorded, run, tmp_path):
    materials = gather(recorded, tmp_path / "out")
    assert materials.mapping.folder == tmp_path / "mapping"
    kept = [entry for entry in entries_of(recorded) if entry.method.key in ("dead_reckoning", "semi_metric")]
    rows = perform(materials, kept).rows
    before = {row.method: row.ape.mean_m for row in result_of(read_results(run.out / "results.json"), "hamlet").rows}
    assert [row.ape.mean_m for row in rows] == pytest.approx([before[row.method] for row in rows], abs=1e-6)
    assert effective_configuration(recorded)["mapping"]["recording"] == "mapping"
    assert "recording" not in effective_configuration(read_scenario(run.scenario))["mapping"]  # baselines go on comparing


def test_a_drive_without_truth_or_in_another_frame_is_refused_with_a_cure(run):
    recording = run.recording("mapping")
    recording.manifest["truth_frame"] = "own"
    with pytest.raises(HippodromeError, match=r"a frame of its own.*--truth-frame network"):
        _require_truth(recording)
    recording = open_recording(recording.folder)
    recording.samples.poses_m[3] = np.nan
    with pytest.raises(HippodromeError, match="not known everywhere"):
        _require_truth(recording)


def test_a_drive_needs_a_tour_or_a_recording(tmp_path):
    path = tmp_path / "one.yaml"
    path.write_text("name: one\nmapping: {traffic: {vehicles: 2}}\n")
    with pytest.raises(HippodromeError, match=r"mapping\.tour"):
        read_scenario(path)
