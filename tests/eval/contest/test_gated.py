"""The gate over methods of somebody new: a better, an equal and a worse one, by each of the three ways in."""

import sys

import pytest

from hippodrome.eval.contest.entry import entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.gate.baseline import baseline_of
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.statistics import MIN_PAIRS
from hippodrome.eval.results.model import Network, Results, ScenarioResult
from tests.eval.contest.entrants import MAPPER
from tests.eval.contest.test_newcomer import program

METHODS = ("class=toy:Mapper", "files=exec:./run.sh {sequence} {out}", f"fed=stream:{sys.executable} client.py")
BIASES_RADPS = {"committed": 0.02, "equal": 0.02, "better": 0.01, "worse": 0.04}  # that the toy adds to the yaw rate


@pytest.fixture
def baseline(materials, tmp_path, monkeypatch):
    """Runs the three toys with a bias, a drive for each seed, and gives their rows as a baseline."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)

    def run(bias_radps):
        results = []
        for seed in range(1, MIN_PAIRS + 1):
            bias = bias_radps * (1.0 + 0.1 * seed)
            biased = f"(one.yaw_rate_radps + {bias})"
            (tmp_path / "toy.py").write_text(MAPPER.replace("one.yaw_rate_radps", biased))
            (tmp_path / "run.sh").write_text(program("run.sh").replace("$3 * dt", f"($3 + {bias}) * dt"))
            (tmp_path / "client.py").write_text(program("client.py").replace("one.yaw_rate_radps", biased))
            (tmp_path / "run.sh").chmod(0o755)
            entries = entries_of(with_methods(materials.scenario, [parse_method(text) for text in METHODS]))[-3:]
            rows = tuple(perform(materials, entries).rows)
            network = Network(generator="grid", edges=1, km=1.0)
            one = ScenarioResult(name="circle", seed=seed, network=network, noise="none", frames=1, duration_s=60.0, rows=rows)
            results.append(Results(scenarios=(one,)))
        return baseline_of(results)

    return run


def test_the_verdict_is_right_for_each_way_in(baseline):
    runs = {name: baseline(bias_radps) for name, bias_radps in BIASES_RADPS.items()}
    verdicts = {name: compare(runs[name], runs["committed"]) for name in ("equal", "better", "worse")}
    assert (verdicts["equal"].passed, verdicts["better"].passed, verdicts["worse"].failed) == (True, True, True)
    assert not any(change.moved for change in verdicts["equal"].changes)
    for method in ("class", "files", "fed"):
        apes = {
            name: next(c for c in one.changes if (c.method, c.figure[:3]) == (method, "APE")) for name, one in verdicts.items()
        }
        assert apes["better"].ratio < 0.9
        assert not apes["better"].regressed
        assert apes["worse"].regressed
