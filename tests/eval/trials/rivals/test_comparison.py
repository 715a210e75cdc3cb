"""The tracker joins the figures and the report's map; localization is compared on a sequence that all finished."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from hippodrome.core.types import Trajectory
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.eval.methods.method import ORBSLAM3_FINAL, ORBSLAM3_LIVE
from hippodrome.eval.metrics.localization import FALSE_FIX_M
from hippodrome.eval.report.evidence import MapEvidence, read_map_evidence
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow
from hippodrome.eval.trials.rivals import comparison
from hippodrome.eval.trials.rivals.comparison import draw_comparison, draw_sequences
from hippodrome.eval.trials.rivals.kept import Run
from hippodrome.eval.trials.rivals.spread import tum_path
from hippodrome.eval.trials.rivals.stage import Tracked

LIVE, FINAL = ORBSLAM3_LIVE.label, ORBSLAM3_FINAL.label
T_S = 0.1 * np.arange(400)
TRUTH = Trajectory(T_S, np.column_stack([50.0 * np.cos(T_S / 8), 50.0 * np.sin(T_S / 8), T_S / 8 + np.pi / 2]))


@pytest.fixture
def folder(tmp_path):
    """What an evaluation left of one method, and a run of the tracker, centimetres off in a frame turned by 180 deg."""
    noise = np.random.default_rng(1).normal(0.0, 0.01, TRUTH.poses.shape)
    write_tum(tmp_path / "topometric.tum", Trajectory(TRUTH.t_s[::10], (TRUTH.poses + 5.0 * noise)[::10]))
    turned = TRUTH.poses * np.array([-1.0, -1.0, 1.0]) + np.array([0.0, 0.0, np.pi]) + noise
    for run, which in (("run-0", "live"), ("run-1", "final")):  # each row shows its own median run
        write_tum(tmp_path / run / f"body-{which}.tum", Trajectory(TRUTH.t_s[::7], turned[::7]))
    path = {"t_s": [0.0, 1.0], "x_m": [0.0, 1.0], "y_m": [0.0, 0.0]}
    evidence = MapEvidence.model_validate({
        "roads": [], "truth": path,
        "methods": [{"name": name, **path, "error_m": [0.0, 0.0], "worst": []} for name in ("a", LIVE)],
        "drives": [], "thumbnails": {"t_s": [0.0], "columns": 1, "width": 4, "height": 3}, "start": (0.0, 0.0, 0.0),
        "recordings": {}, "network": "n",
    })  # fmt: skip
    (tmp_path / "map.json").write_text(evidence.model_dump_json())
    return tmp_path


def materials(folder):
    roads = SimpleNamespace(
        lane_count=1, lane_points_m=lambda lane: np.array([[0.0, 0.0], [50.0, 0.0]]), is_internal=np.array([False]),
        lane_lengths_m=lambda: np.array([50.0]), points_m=np.array([[0.0, 0.0], [50.0, 0.0]]),
    )  # fmt: skip
    mapping = SimpleNamespace(ground_truth=lambda: TRUTH)
    return SimpleNamespace(folder=folder, mapping=mapping, roads=roads, scenario=SimpleNamespace(name="ring"))


def test_the_tracker_is_in_every_figure_and_in_the_map(folder):
    draw_comparison(materials(folder), Tracked([], Run(folder / "run-0"), Run(folder / "run-1")))
    for name in ("errors", "violins", "maps", "ORB-SLAM3-final-ape"):
        assert cv2.imread(str(folder / f"{name}.png")).std() > 1.0
    layers = {layer.name: layer for layer in read_map_evidence(folder / "map.json").methods}
    assert list(layers) == ["a", LIVE, FINAL]
    assert len(layers[LIVE].t_s) == len(TRUTH.t_s[::7])
    assert max(layers[FINAL].error_m) < 0.1  # the best rigid fit takes the turn away


def test_without_a_tracker_nothing_is_drawn_anew(folder):
    before = sorted(folder.iterdir())
    draw_comparison(materials(folder), Tracked([]))
    assert sorted(folder.iterdir()) == before


def test_the_longest_sequence_that_all_finished_is_shown(folder, monkeypatch):
    shown = {}
    monkeypatch.setattr(comparison, "draw_localization_comparison", lambda path, scores, title, _: shown.update({title: scores}))
    score = SimpleNamespace(errors_m=np.array([FALSE_FIX_M]))
    rows = [("ours", 1, 170.0, score), ("ours", 2, 300.0, score), ("ours", 3, 800.0, score)]
    rows += [("theirs", 1, 170.0, score), ("theirs", 2, 300.0, score), ("theirs", 3, 800.0, None)]
    found = [LocalizedSequence(SequenceRow(method=method, number=i, length_m=m), one) for method, i, m, one in rows]
    draw_sequences(materials(folder), found)
    ((title, scores),) = shown.items()
    assert "sequence 2, 300 m" in title
    assert list(scores) == ["ours", "theirs"]


def test_the_scored_samples_of_a_run_have_a_path():
    assert tum_path(Run(Path("run-1")), "live") == Path("run-1/body-live.tum")
