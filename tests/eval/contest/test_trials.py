"""Methods of others in the trials: Table II, robustness and stress, on a drive made by the real simulator."""

import shlex
import textwrap
from pathlib import Path

import pytest

from hippodrome.eval.contest.entry import parse_method, with_methods
from hippodrome.eval.contest.trials import localize_added
from hippodrome.eval.methods.materials import gather
from hippodrome.eval.trials.robustness.methods import left_out
from hippodrome.eval.trials.robustness.tables import yardsticks_markdown
from hippodrome.eval.trials.stress.cases import StressCase
from hippodrome.eval.trials.stress.run import StressTask, applicable
from hippodrome.eval.trials.stress.table import stress_markdown
from hippodrome.eval.trials.stress.trial import StressedDrive, run_method
from hippodrome.sim.scenario import Scenario, load_scenario

MODULE = """\
import math
from hippodrome.eval.methods.protocol import Answer, Needs

class Still:
    frame = "network"
    needs = Needs(camera=False, road_network=True, start_pose=True)
    def map(self, observations, given):
        assert given.roads.lane_count
        x, y, heading = given.start.x_m, given.start.y_m, given.start.heading_rad
        for one in observations:
            heading += one.yaw_rate_radps * one.dt_s
            x += one.speed * one.dt_s * math.cos(heading)
            y += one.speed * one.dt_s * math.sin(heading)
            yield one.t_s, x, y, heading
    def localize(self, observations, given):
        x, y, heading = given.mapped.trajectory.poses[0]
        for one in observations:
            yield Answer(one.t_s, x, y, heading)

class Broken(Still):
    def map(self, observations, given):
        raise RuntimeError("no map")

class Own(Still):
    frame = "own"
"""


@pytest.fixture
def scenario(run, tmp_path, monkeypatch):
    (tmp_path / "triers.py").write_text(textwrap.dedent(MODULE))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)

    def of(*names):
        return with_methods(load_scenario(run.scenario), [parse_method(f"{name}=triers:{name}") for name in names])

    return of


def test_every_sequence_of_table_two_has_its_row(scenario, run):
    found = localize_added(gather(scenario("Still", "Broken"), run.out), (40.0, 60.0, 1e6))
    assert [(one.row.method, one.row.number) for one in found] == [(m, n) for m in ("Still", "Broken") for n in (1, 2, 3)]
    still, broken = found[:3], found[3:]
    assert still[0].score.localized.all()
    assert still[1].score.total > still[0].score.total
    assert "long" in still[2].row.failure
    assert all("no map: crashed: RuntimeError: no map" in one.row.failure for one in broken)


def test_stress_reaches_the_self_motion_and_the_roads_of_methods_in_the_network_s_frame(scenario, run):
    named = scenario("Still", "Broken", "Own")
    entries = applicable(named)
    assert [entry.method.label for entry in entries] == ["Still", "Broken"]
    materials = gather(named, run.out)
    drive = StressedDrive(named, materials.mapping, materials.town, run.out / "towns")
    clean, harsh = (run_method(StressCase(level, noise=level), drive, entries[0], "again") for level in ("clean", "harsh"))
    assert clean.failure is None
    assert clean.ape_mean_m != harsh.ape_mean_m  # another self-motion was sensed
    failed = run_method(StressCase("paper"), drive, entries[1], "again")
    assert "no map" in failed.failure
    text = stress_markdown([clean, failed])
    assert "| Still: clean |" in text
    assert "- Broken: paper, hamlet" in text
    for entry in entries:
        entry.close()


@pytest.mark.parametrize("text", ["mine=my_module:Mine", "my own=exec:./run.sh {sequence} {out}", "fed=stream:python 'a b.py'"])
def test_the_command_that_reruns_a_row_has_the_method_with_it(text, tmp_path):
    added = parse_method(text)
    scenario = Scenario(name="town", methods={"kept": "my_module:Kept", added.name: added.spec})
    task = StressTask(scenario, (), tmp_path, Path("town.yaml"), frozenset([added.name]))
    words = shlex.split(task.rerun(StressCase("paper"), added.name))
    assert parse_method(words[words.index("--method") + 1]) == added
    assert "--method" not in task.rerun(StressCase("paper"), "kept")
    assert "--method" not in task.rerun(StressCase("paper"))


def test_a_method_that_failed_or_has_nothing_to_do_is_named_in_the_table_of_robustness():
    scenario = Scenario(name="town", methods={"mapper": {"command": "./run.sh {sequence} {out}"}})
    text = yardsticks_markdown([], {"broken": "no idea", **left_out(scenario)})
    assert "| broken | - |" in text
    assert "- broken: no idea" in text
    assert "- mapper: left out: it neither localizes nor describes views" in text


def test_false_closures_are_errors_of_our_own_map():
    assert StressCase("false closures 5 %", false_closures=0.05).ours_alone
    assert not StressCase("missing roads", missing_roads=2).ours_alone
