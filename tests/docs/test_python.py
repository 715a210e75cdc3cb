"""Every program of docs/python.md and of examples/ runs, as it stands there, on a recording made by the real simulator."""

import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hippodrome.eval.cli import main
from hippodrome.sim.scenario import Scenario

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/python.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
TOWN = re.search(r"^```yaml\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE).group(1)
LONGEST = 15  # lines of the whole chain, blank ones and the imports' two apart


@pytest.fixture(scope="module")
def out(run, tmp_path_factory):
    """A folder that looks as after the page's ``hippodrome render town.yaml --out out``."""
    folder = tmp_path_factory.mktemp("page")
    for role in ("mapping", "localization"):
        shutil.copytree(run.recording(role).folder, folder / "out/recordings" / f"town-{role}-0123")
    shutil.copytree(run.out / "towns", folder / "out/towns")
    return folder / "out"


def test_the_page_has_its_programs_and_the_whole_chain_is_short():
    assert len(BLOCKS) == 5
    code = [line for line in BLOCKS[0].splitlines() if line.strip() and not line.startswith(("from", "import"))]
    assert len(code) <= LONGEST


def test_the_scenario_of_the_page_is_one(tmp_path):
    (tmp_path / "town.yaml").write_text(TOWN)
    assert main(["scenario", "validate", str(tmp_path / "town.yaml")]) == 0
    assert Scenario.model_fields  # the page's keys are checked by the command above


def test_the_programs_of_the_page_run_one_after_the_other(out, monkeypatch, capsys):
    monkeypatch.chdir(out.parent)
    names: dict[str, object] = {}
    for block in BLOCKS:
        if "odometry, frames" in block:
            _add_own_data(names)
        exec(compile(block, "docs/python.md", "exec"), names)  # the page's own code
    printed = capsys.readouterr().out
    assert "m off in the mean" in printed
    assert "second drive localized after" in printed
    assert "APE, position, m" in printed
    assert (out.parent / "town.pbstream").exists()


def _add_own_data(names):
    """What a user would have read from files of their own."""
    observations = list(names["first"].observations())
    names["odometry"] = [(o.t_s, o.speed, o.yaw_rate_radps) for o in observations]
    names["frames"] = {o.t_s: o.frame for o in observations if o.frame is not None}


def test_the_example_of_the_whole_chain(out):
    printed = _ran("whole_chain.py", out)
    assert "map error:" in printed
    assert "localization error:" in printed


def test_the_example_of_own_frames(run, out, tmp_path):
    exported = tmp_path / "exported"
    assert main(["export", str(run.recording("mapping").folder), "--to", "tum", "--out", str(exported)]) == 0
    folder = next(path.parent for path in exported.rglob("rgb.txt"))
    printed = _ran("own_frames.py", folder, next((out / "towns").glob("*.net.xml")))
    assert "vertices lie on roads" in printed
    assert (folder / "topometric.pbstream").exists()


def test_the_example_of_scoring(run):
    folder = run.out / "hamlet"
    printed = _ran("score_trajectory.py", folder / "semi-metric.tum", folder / "ground-truth.tum")
    assert printed.count("APE") == 2 * 4
    assert "RPE" in printed


def test_every_example_is_run_here():
    assert {path.name for path in (ROOT / "examples").glob("*.py")} == {"whole_chain.py", "own_frames.py", "score_trajectory.py"}
    for path in (ROOT / "examples").glob("*.py"):
        assert callable(runpy.run_path(str(path))["main"])


def _ran(example, *arguments):
    command = [sys.executable, str(ROOT / "examples" / example), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout
