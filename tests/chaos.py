"""Commands that are killed or meet a fault of the machine, and pairs of them in one folder: ``make chaos``.

Each kill has a number, which with the seed says what is hit, by which signal and when. The same command then runs once more: it
has to end well, with the same results as a run that nobody disturbed, and nothing may be left: no process after ``ORPHAN_S``, no
temporary folder, no unfinished file. A signal that comes after all is over meets nobody; it is told and not counted.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from tests.disturbed import LONGEST_S, USUAL, Attempt, Chaos
from tests.machine_faults import can_mount, fault_of, suffered

SIGNALS: Final = ("SIGTERM", "SIGHUP", "SIGINT", "SIGKILL")
TARGETS: Final = ("main", "worker", "all")
LONGEST_DELAY_S: Final = 6.0  # between the beginnings of a pair
FAULTS: Final = {"traceback": "tracebacks or wrong words", "hang": "hangs", "orphan": "with orphans", "leftover": "leftovers",
                 "changed": "lost or changed", "ended": "ended otherwise"}  # fmt: skip
Disturbed: TypeAlias = tuple[str, Callable[[], list[str] | None]]  # what is done, in words; what was wrong, None if it met nobody


def attempt_of(seed: int, number: int, dask: bool, baselines: bool = False) -> Attempt:
    """The attempt of this number; the same for the same seed.

    Every command is hit at every target by every signal before one of these comes again; six times it is a worker of a cluster.
    """
    commands = (*USUAL, "baselines") if baselines else USUAL
    kinds = [(command, target, name) for command in commands for target in TARGETS for name in SIGNALS]
    kinds += 3 * [("sweep", "dask", "SIGTERM"), ("sweep", "dask", "SIGKILL")] if dask else []
    order = np.random.default_rng([seed, number // len(kinds), 2]).permutation(len(kinds))
    command, target, name = kinds[order[number % len(kinds)]]
    return Attempt(command, target, name, float(np.random.default_rng([seed, number]).uniform(0.05, 1.0)))


def kills(chaos: Chaos, seed: int, first: int, dask: bool, baselines: bool, only: str | None = None) -> Iterator[Disturbed]:
    """Kills without end, of one command if ``only`` names it."""
    while True:
        attempt, name = attempt_of(seed, first, dask, baselines), f"kill-{first}"
        if only in (None, attempt.command):
            what = f"{name}: {attempt.command}, {attempt.number} to {attempt.target} at {attempt.share:.0%}"
            yield what, partial(chaos.killed, name, attempt)
        first += 1


def faults(chaos: Chaos, seed: int, first: int) -> Iterator[Disturbed]:
    """Faults of the machine without end."""
    while True:
        fault, name = fault_of(seed, first), f"fault-{first}"
        yield f"{name}: {fault.command}, {fault.kind} at {fault.share:.0%}", partial(suffered, chaos, name, fault)
        first += 1


def pairs(chaos: Chaos, seed: int, first: int) -> Iterator[Disturbed]:
    """Pairs of runs in one folder without end."""
    while True:
        command, name = USUAL[first % 2], f"pair-{first}"
        delay_s = float(np.random.default_rng([seed, first, 1]).uniform(0.0, LONGEST_DELAY_S))
        yield f"{name}: two of {command}, {delay_s:.1f} s apart", partial(chaos.pair, name, command, delay_s)
        first += 1


def carried_out(plans: Iterator[Disturbed], wanted: int, end_s: float, tally: Counter[str]) -> int:
    """Disturb ``wanted`` runs, or fewer if the time ends before, and print and count what was wrong; how many met somebody."""
    met = tried = 0
    while met < wanted and tried < 2 * wanted and time.monotonic() < end_s:
        what, disturb = next(plans)
        began, found = time.monotonic(), disturb()
        tried, met = tried + 1, met + (found is not None)
        lines = ["it met nobody: all was over before"] if found is None else found or ["ok"]
        print(f"{what} ({time.monotonic() - began:.0f} s)", *lines, sep="\n  ", flush=True)
        tally.update({fault.partition(":")[0] for fault in found or ()})
        tally.update({"fell": bool(found), "nobody": found is None})
    return met


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20, help="how many commands are killed (default: 20)")
    parser.add_argument("--pairs", type=int, default=4, help="how many pairs run in one folder (default: 4)")
    parser.add_argument("--faults", type=int, default=5, help="how many runs meet a fault of the machine (default: 5)")
    parser.add_argument("--seed", type=int, default=0, help="of what is hit, by what, and when (default: 0)")
    parser.add_argument("--first", type=int, default=0, help="number of the first of each, to see one case again (default: 0)")
    parser.add_argument(
        "--baselines", action="store_true", help="hit the command that runs ORB-SLAM3, too; installs it if need be"
    )
    parser.add_argument("--only", choices=(*USUAL, "baselines"), help="kill this command alone (default: all)")
    parser.add_argument("--seconds", type=float, default=3600.0, help="after these nothing new is begun (default: 3600)")
    return parser.parse_args()


def _has_dask() -> bool:
    try:
        import distributed  # noqa: F401
    except ImportError:
        print("no kill of a Dask worker: pip install 'hippodrome[dask]'")
        return False
    return True


def _main() -> int:
    options, dask, mounts = _options(), _has_dask(), can_mount()
    if not mounts and options.faults:
        print("no fault of the machine: this system lets nobody but root mount a file system")
    print(f"{options.kills} kills, {options.faults} faults of the machine and {options.pairs} pairs, seed {options.seed}; "
          f"limits: {LONGEST_S} s a command, {options.seconds:g} s in all", flush=True)  # fmt: skip
    tally, end_s, seed, first = Counter[str](), time.monotonic() + options.seconds, options.seed, options.first
    with tempfile.TemporaryDirectory() as folder:
        chaos = Chaos(Path(folder))
        done = [
            carried_out(kills(chaos, seed, first, dask, options.baselines, options.only), options.kills, end_s, tally),
            carried_out(pairs(chaos, seed, first), options.pairs, end_s, tally),
            carried_out(faults(chaos, seed, first), options.faults if mounts else 0, end_s, tally),
        ]
        took = ", ".join(f"{command} {seconds:.0f} s" for command, seconds in chaos.took_s.items())
    print(f"{sum(done)} disturbed runs ({done[0]} kills, {done[1]} pairs, {done[2]} faults), seed {seed}: {tally['fell']} fell; "
          + ", ".join(f"{tally[kind]} {words}" for kind, words in FAULTS.items())
          + f"; {tally['nobody']} signals met nobody; {chaos.compared:,} files compared; undisturbed: {took}")  # fmt: skip
    return 1 if tally["fell"] else 0


if __name__ == "__main__":
    sys.exit(_main())
