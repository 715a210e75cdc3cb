"""Results of two commits: each is cloned, set up and run on the same scenarios."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from hippodrome.core.types import HippodromeError

REPOSITORY: Final = Path(__file__).resolve().parents[2]
STRESS_CASES: Final = ("false closures 5 %", "missing roads", "another town", "scale jumps 10 %")
RUNS: Final[dict[str, tuple[str, ...]]] = {  # by the folder of its results: a command and its arguments, globs expanded
    "eval": ("eval", "scenarios/towns/*.yaml"),
    "paper": ("eval", "scenarios/paper.yaml"),
    "library": ("eval", "scenarios/library/boulevards.yaml"),
    "stress": ("stress", "scenarios/towns/rural.yaml", "--seeds", "1",
               *(word for case in STRESS_CASES for word in ("--case", case))),
    "robustness": ("robustness", "scenarios/towns/grid.yaml", "--conditions", "same", "fog-80m", "self-motion-visual",
                   "--sequences", "3"),
}  # fmt: skip
SCORED: Final = frozenset({0, 1})  # 1: a threshold failed, which is a result


@contextmanager
def results_of_commits(before: str, after: str, keep: Path | None, workers: int) -> Iterator[tuple[Path, Path]]:
    """The folders with the results of two commits, in ``keep`` or in a temporary folder. Raises HippodromeError."""
    commits = [_full_name(commit) for commit in (before, after)]
    with TemporaryDirectory(prefix="same-") as temporary:
        root = (keep or Path(temporary)).resolve()
        old, new = (_results(commit, root / commit[:12], workers) for commit in commits)
        yield old, new


def _full_name(commit: str) -> str:
    """The 40 hex digits of a commit."""
    asked = subprocess.run(
        ["git", "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}"], cwd=REPOSITORY, capture_output=True, text=True
    )
    if asked.returncode:
        raise HippodromeError(f"{commit}: no commit of {REPOSITORY}; `git log` lists them")
    return asked.stdout.strip()


def _results(commit: str, folder: Path, workers: int) -> Path:
    """Clone, set up, run everything; what an earlier call finished is kept."""
    clone, out = folder / "clone", folder / "results"
    if not clone.exists():
        _run(["git", "clone", "--quiet", "--no-checkout", str(REPOSITORY), str(clone)], REPOSITORY)
    _run(["git", "checkout", "--quiet", "--detach", commit], clone)
    _run(["make", "setup"], clone)
    for name, (command, *arguments) in RUNS.items():
        words = [word for argument in arguments for word in _expanded(argument, clone)]
        print(f"{commit[:12]}: hippodrome {command} {' '.join(words)}", file=sys.stderr, flush=True)
        _run([".venv/bin/hippodrome", command, *words, "--workers", str(workers), "--out", str(out / name)], clone, SCORED)
    return out


def _expanded(argument: str, folder: Path) -> list[str]:
    """The files that a glob names, relative to ``folder``; anything else as it is."""
    return [str(path.relative_to(folder)) for path in sorted(folder.glob(argument))] if "*" in argument else [argument]


def _run(command: Sequence[str], folder: Path, finished: frozenset[int] = frozenset({0})) -> None:
    ended = subprocess.run(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if ended.returncode not in finished:
        said = ended.stderr.strip()[-500:]
        raise HippodromeError(f"{folder}: `{' '.join(command)}` ended with status {ended.returncode}: {said}")
