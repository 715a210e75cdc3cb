"""Drives without truth are run all the same: what only the truth can tell is missing, with the reason."""

import textwrap

import numpy as np
import pytest

from hippodrome.eval.contest.entry import entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.results.evidence import write_trajectories

MODULE = """\
from hippodrome.eval.methods.protocol import Answer, Needs

class Mapper:
    def map(self, observations, given):
        for i, one in enumerate(observations):
            yield one.t_s, float(i), 0.0, 0.0

class Localizer(Mapper):
    frame = "network"
    def localize(self, observations, given):
        for i, one in enumerate(observations):
            yield Answer(one.t_s, 0.0, 0.0, 0.0, localized=i % 2 == 1)

class Metric(Localizer):
    frame = "metric"

class Started(Mapper):
    needs = Needs(start_pose=True)

class Descriptor:
    def describe(self, frame):
        return frame[0, 0]
"""


@pytest.fixture
def row(materials, tmp_path, monkeypatch):
    (tmp_path / "blind.py").write_text(textwrap.dedent(MODULE))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    materials.mapping = type(materials.drive)(tmp_path / "recordings/one")

    def of(name, *, mapping, drive):
        for recording, known in ((materials.mapping, mapping), (materials.drive, drive)):
            if not known:
                recording.samples.poses_m[:] = np.nan
        entry = entries_of(with_methods(materials.scenario, [parse_method(f"mine=blind:{name}")]))[-1]
        found = perform(materials, [entry])
        return found.rows[0], found

    return of


def test_a_map_of_a_drive_without_truth_has_its_costs_and_no_errors(row, materials):
    found, performance = row("Mapper", mapping=False, drive=False)
    assert found.failure is None
    assert "the truth of the drive is not known; import it with --truth" in found.unscored
    assert found.ape is found.ape_sim2 is found.rpe is None
    assert found.cpu_percent > 0.0
    assert found.latency_ms.median > 0.0
    assert found.peak_rss_bytes > 1e6
    (one,) = performance.unscored
    write_trajectories(materials, performance.unscored)
    assert {path.name for path in materials.folder.glob("*.tum")} == {"mine.tum"}
    assert len(one.trajectory.t_s) == 600


def test_a_second_drive_without_truth_says_for_how_much_it_was_localized(row):
    found, _ = row("Localizer", mapping=True, drive=False)
    assert found.ape is not None
    assert found.unscored.startswith("localization: the truth of the drive is not known")
    assert found.localization.localized_share == 0.5
    assert found.localization.error_mean_m is found.localization.success is None


def test_a_second_drive_with_truth_is_scored_in_a_map_without(row):
    found, _ = row("Localizer", mapping=False, drive=True)
    assert found.ape is None
    assert found.localization.success is not None


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Metric", "a frame of its own, and only the truth of the mapping drive"),
        ("Started", "nobody knows where a drive without"),
    ],
)
def test_what_cannot_be_without_truth_is_said(row, name, cause):
    found, _ = row(name, mapping=False, drive=True)
    assert cause in found.failure


def test_places_need_the_truth(row):
    found, _ = row("Descriptor", mapping=True, drive=False)
    assert found.failure is found.places is None
    assert "not known" in found.unscored
