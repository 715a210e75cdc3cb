"""The example workflow for GitHub Actions."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[3]


def test_the_workflow_calls_targets_that_exist():
    workflow = yaml.safe_load((ROOT / "docs" / "gate-github.yml").read_text(encoding="utf-8"))
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    called = [step["run"].split() for step in workflow["jobs"]["gate"]["steps"] if "run" in step]
    assert called == [["make", "gate"]]
    assert {words[1] for words in called} <= targets
