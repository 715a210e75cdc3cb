"""Drives that were recorded elsewhere take the place of simulated ones."""

import json
import re
import shutil

import numpy as np
import pytest
import yaml

from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.eval.contest.entry import entries_of
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.files.scenarios import effective_configuration, read_scenario
from hippodrome.eval.methods.materials import gather, truth_of, why_unscored
from hippodrome.eval.results.model import read_results, result_of
from hippodrome.sim.record import RecordingPlan, prepare
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


def test_why_a_drive_cannot_be_scored_is_said_with_a_cure(run):
    recording = run.recording("mapping")
    assert why_unscored(recording) is None
    recording.manifest["truth_frame"] = "own"
    assert re.search("a frame of its own.*--truth-frame network", why_unscored(recording))
    assert truth_of(recording) is None
    recording = open_recording(recording.folder)
    recording.samples.poses_m[3] = np.nan
    assert re.search("is known for 100% of its steps only; import it with --truth", why_unscored(recording))


def test_our_own_export_comes_back_with_and_without_truth(run, tmp_path):
    """Trials need the truth and say so; an evaluation goes as far as it can, and the second drive is localized as before."""
    for role in ("mapping", "localization"):
        assert main(["export", str(run.recording(role).folder), "--to", "tum", "--out", str(tmp_path / f"{role}-tum")]) == 0
        (layout,) = (path for path in (tmp_path / f"{role}-tum").iterdir() if path.is_dir())
        if role == "mapping":
            (layout / "groundtruth.txt").unlink()
        assert main(["import", str(layout), "--truth-frame", "network", "--out", str(tmp_path / role)]) == 0
    (network,) = (run.out / "towns").glob("*.net.xml")
    path = tmp_path / "back.yaml"
    drives = {role: {"recording": role} for role in ("mapping", "localization")}
    path.write_text(yaml.safe_dump({"name": "back", "town": {"network": str(network)}, **drives}))
    scenario = read_scenario(path)
    with pytest.raises(HippodromeError, match="mapping: the truth of the drive is not known"):
        gather(scenario, tmp_path / "out")
    materials = gather(scenario, tmp_path / "out", truthless=True)
    kept = [entry for entry in entries_of(scenario) if entry.method.key in ("semi_metric", "topometric")]
    mapped, refined = perform(materials, kept).rows
    assert mapped.ape is None
    assert "not known" in mapped.unscored
    before = {row.method: row for row in result_of(read_results(run.out / "results.json"), "hamlet").rows}["topometric"]
    assert refined.localization.error_mean_m < before.localization.error_mean_m + 0.3  # no road is read: the camera is unknown


def test_a_recording_that_is_not_there_is_not_driven_anew(recorded, tmp_path):
    shutil.rmtree(tmp_path / "mapping")
    with pytest.raises(HippodromeError, match=r"mapping\.recording is no finished recording"):
        prepare(RecordingPlan(recorded, "mapping", tmp_path / "out"))
    assert not (tmp_path / "mapping").exists()


def test_a_drive_needs_a_tour_or_a_recording(tmp_path):
    path = tmp_path / "one.yaml"
    path.write_text("name: one\nmapping: {traffic: {vehicles: 2}}\n")
    with pytest.raises(HippodromeError, match=r"mapping\.tour"):
        read_scenario(path)
