"""Every example of a method takes part, on a drive made by the real simulator."""

import sys
from pathlib import Path

import pytest

from hippodrome.eval.contest.entry import entries_of
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.methods.materials import gather
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import load_scenario

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples/methods"
RUN_ELSEWHERE = {"stream_client.py", "stream_client.cpp"}  # tests/eval/contest/test_streams.py
PART_OF_OTHERS = {"learning.py"}  # of vlad.py and dbow.py


@pytest.fixture
def row(run, monkeypatch):
    """The row of one method on the small town that all end-to-end tests share."""
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(ROOT)

    def of(**spec):
        scenario = load_scenario(run.scenario).model_copy(update={"methods": {"mine": MethodSpec.model_validate(spec)}})
        return perform(gather(scenario, run.out), [entries_of(scenario)[-1]]).rows[0]

    return of


def test_the_mapper_of_fifteen_lines(row):
    found = row(**{"class": "examples.methods.integrate:Integrator"})
    assert found.failure is None
    assert found.rpe.mean_m < 5.0
    body = (EXAMPLES / "integrate.py").read_text().partition("class ")[2]
    assert len(body.splitlines()) <= 15


def test_visual_odometry_sees_the_turns_of_the_drive(row):
    found = row(**{"class": "examples.methods.visual_odometry:VisualOdometry"})
    assert found.failure is None
    assert found.rpe.mean_m < 5.0
    assert found.ape_sim2.mean_m < 60.0  # the town is 190 m wide; a small camera turns less surely than a gyro


def test_a_descriptor_learned_elsewhere_tells_places_apart(row, run):
    words = str(run.recording("localization").folder)
    found = row(**{"class": "examples.methods.vlad:Vlad", "config": {"learn_on": [words], "frames": 40}})
    assert found.failure is None
    assert found.places.mapped > 20
    assert found.places.best_is_right > 0.5
    assert found.ape is None


def test_the_shell_script_over_the_euroc_layout(row):
    found = row(command=f"{EXAMPLES / 'euroc.sh'} {{sequence}} {{out}}", input="euroc")
    assert found.failure is None
    assert found.rpe.mean_m < 5.0


def test_the_client_of_the_stream_on_a_real_drive(row):
    found = row(stream=f"{sys.executable} {EXAMPLES / 'stream_client.py'}")
    assert found.failure is None
    assert found.latency_ms.median < 50.0


NOT_RUN = {
    "svo",
    "svo-requirements",
    "dbow",
}  # need packages that are no dependencies of ours; docs/methods.md has their results


def test_every_example_is_run():
    text = Path(__file__).read_text()
    assert all(path.stem in text for path in EXAMPLES.iterdir() if path.is_file() and path.stem not in NOT_RUN)
