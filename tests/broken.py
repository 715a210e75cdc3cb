"""Broken inputs, made of whole ones, and what may come of them: ``make fuzz``.

A reader joins by a ``Subject``: how its whole input is written, and the command that reads it. Every change (tests/changes.py) is
a function of a random generator, so a number says which input fell. ``python -m tests.broken --cases 3000 --seed 1`` breaks the
inputs of tests/subjects.py and tests/eval/exchange/subjects.py; ``--only NAME --case NUMBER`` breaks one of them once more.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.eval import cli
from hippodrome.eval.cli import main
from tests.changes import change

CHECKOUT: Final = Path(__file__).parents[1]
LONGEST_S: Final = 30  # of CPU time: a case that takes longer hangs
WAITING: Final = 4  # times as long by the clock, as programs that a case starts and others on the machine take time, too
LARGEST_KB: Final = 1 << 20  # of growth of the process, or of a program that it started, in one case
FAULTS: Final = ("traceback", "hang", "memory", "no sentence", "warning")
OURS: Final = tuple(str(CHECKOUT / part) + os.sep for part in (".ns", "core", "eval", "proto", "sim"))


class TooLong(BaseException):
    """The alarm. It is no ``Exception``, and no ``OSError`` as ``TimeoutError`` is: a command would make a sentence of it."""


@dataclass(frozen=True)
class Subject:
    """An input and its reader."""

    name: str
    write: Callable[[Path], None]  # the whole input into an empty folder
    command: Callable[[Path, Path], list[str]]  # of (folder of the input, path of the result)
    files: str = "**/*"  # which of the files are changed
    after: Callable[[np.random.Generator, Path], None] = lambda _rng, _folder: (
        None
    )  # done to the broken input: checksums, for one
    statuses: tuple[int, ...] = (0, 2)  # that the command may end with
    lines: int = 1  # how many the command may refuse with
    longest_s: int = LONGEST_S
    slow: bool = False  # left to campaigns: writing it takes minutes, or each case seconds


@dataclass(frozen=True)
class Outcome:
    """What came of a case: the name of what was wrong, or "" """

    fault: str
    detail: str
    accepted: bool


def run_case(subject: Subject, whole: Path, seed: int, place: Path) -> Outcome:
    """Break a copy of the whole input and have it read, in this process."""
    rng = np.random.default_rng([seed, *subject.name.encode()])
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(whole, place / "in")
    files: dict[str, list[Path]] = {}  # by ending, so that a hundred images do not hide the one list of them
    for path in sorted((place / "in").glob(subject.files)):
        if path.is_file():
            files.setdefault(path.suffix, []).append(path)
    said = []
    for _ in range(int(rng.integers(1, 3))):
        alike = list(files.values())[int(rng.integers(len(files)))]
        path = alike[int(rng.integers(len(alike)))]
        with contextlib.suppress(Exception):  # what is broken already may be none of its kind any more
            said.append(f"{path.name}: {change(rng, path)}")
    subject.after(rng, place / "in")
    return _run(subject, subject.command(place / "in", place / "out"), f"case {seed}: {'; '.join(said)}")


def _run(subject: Subject, command: list[str], said: str) -> Outcome:
    out, err, warned = io.StringIO(), io.StringIO(), list[warnings.WarningMessage]()
    before, began = _largest_kb(), time.process_time()
    alarms = (signal.SIGALRM, signal.SIGPROF)
    previous = [signal.signal(number, _too_long) for number in alarms]
    signal.setitimer(signal.ITIMER_PROF, subject.longest_s)
    signal.alarm(WAITING * subject.longest_s)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", RuntimeWarning)
            status = main(command)
    except SystemExit as error:
        status = int(error.code or 0)
    except TooLong:
        return Outcome("hang", said, False)
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        what = f"{type(error).__name__}: {str(error)[:120]} at {Path(place.filename).name}:{place.lineno}"
        return Outcome("traceback", f"{said}: {what}", False)
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        for number, handler in zip(alarms, previous, strict=True):
            signal.signal(number, handler)
    if ours := [one for one in warned if one.filename.startswith(OURS)]:  # the user would see it between our sentences
        where = f"{Path(ours[0].filename).name}:{ours[0].lineno}"
        return Outcome("warning", f"{said}: {ours[0].message} at {where}", False)
    if (took_s := time.process_time() - began) > subject.longest_s:
        return Outcome("hang", f"{said}: {took_s:.0f} s", False)
    if (grown := _largest_kb() - before) > LARGEST_KB:
        return Outcome("memory", f"{said}: {grown >> 10} MiB", False)
    lines = err.getvalue().strip().splitlines()
    if "Traceback" in err.getvalue() or "fault of hippodrome" in err.getvalue():
        return Outcome("traceback", f"{said}: {lines[-1][:300]}", False)
    if status not in subject.statuses or (status == 2 and not 1 <= len(lines) <= subject.lines):
        return Outcome("no sentence", f"{said}: status {status}, {len(lines)} lines: {' / '.join(lines)[:300]}", False)
    return Outcome("", "", status == 0)


def _largest_kb() -> int:
    """Largest memory so far, of this process and of the largest program that it ran, together."""
    return sum(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def _too_long(*_: Any) -> None:
    raise TooLong


def campaign(
    subjects: Sequence[Subject], cases: int, seed: int, folder: Path, most_s: float, tell: Any = None, even_time: bool = False
) -> list[Outcome]:
    """The outcomes of ``cases`` broken inputs; fewer where ``most_s`` are over before.

    The subjects take turns. With ``even_time`` the one that has had the least CPU time is next, so that cheap readers, of which
    most break in most ways, get most of the cases; the n-th case of a subject is the same either way.
    """
    found: list[Outcome] = []
    end_s, wholes = time.monotonic() + most_s, {subject.name: folder / f"whole-{subject.name}" for subject in subjects}
    for subject in subjects:
        wholes[subject.name].mkdir(parents=True)
        subject.write(wholes[subject.name])
    done, spent_s = dict.fromkeys(wholes, 0), dict.fromkeys(wholes, 0.0)
    for number in range(cases if subjects else 0):
        if time.monotonic() > end_s:
            break
        subject = min(subjects, key=lambda one: spent_s[one.name]) if even_time else subjects[number % len(subjects)]
        began = _cpu_s()
        one = run_case(subject, wholes[subject.name], seed * 1_000_000 + done[subject.name], folder / "case")
        spent_s[subject.name] += _cpu_s() - began
        done[subject.name] += 1
        found.append(replace(one, detail=f"{subject.name}: {one.detail}"))
        if tell is not None and one.fault:
            tell(found[-1])
    return found


def _cpu_s() -> float:
    """CPU time so far, of this process and of the programs that it waited for."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def _again(subject: Subject, case: int, folder: Path) -> None:
    """One case with all that it prints, and its traceback."""
    (folder / "whole").mkdir()
    subject.write(folder / "whole")
    os.environ["HIPPODROME_TRACEBACK"] = "1"
    kept = replace(subject, command=lambda source, out: print(shown := subject.command(source, out)) or shown)
    print(run_case(kept, folder / "whole", case, folder / "case"))
    print("status", main(subject.command(folder / "case" / "in", folder / "case" / "out2")))


def _main() -> int:
    from tests.eval.exchange.subjects import SUBJECTS
    from tests.subjects import MORE

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000, help="how many in all (default: 1000)")
    parser.add_argument("--seed", type=int, default=0, help="of the random changes (default: 0)")
    parser.add_argument("--seconds", type=float, default=3600.0, help="after these nothing new is begun (default: 3600)")
    parser.add_argument(
        "--even-time", action="store_true", help="as much CPU time for each reader instead of as many cases: many more cases"
    )
    parser.add_argument("--only", default="", help="names of subjects that begin so, with commas (default: all)")
    parser.add_argument("--case", type=int, help="break one input of the subject --only as in this case, and show what happens")
    parser.add_argument("--keep", type=Path, help="folder for the inputs; an empty one (default: one that is removed)")
    options = parser.parse_args()
    cli.make_parser = lru_cache(maxsize=1)(cli.make_parser)  # making it anew takes as long as a case
    subjects = [one for one in (*MORE, *SUBJECTS) if one.name.startswith(tuple(options.only.split(",")))]
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        os.environ["TMPDIR"] = tempfile.tempdir = str(folder)
        if options.case is not None:
            _again(subjects[0], options.case, folder)
            return 0
        print(f"{options.cases} cases of {len(subjects)} readers, seed {options.seed}; limits: {LONGEST_S} s of CPU and "
              f"{LARGEST_KB >> 10} MiB a case, {options.seconds:g} s in all", flush=True)  # fmt: skip
        found = campaign(subjects, options.cases, options.seed, folder, options.seconds,
                         lambda one: print(f"{one.fault}: {one.detail}", flush=True), options.even_time)  # fmt: skip
    for subject in subjects:
        own = [one for one in found if one.detail.startswith(f"{subject.name}: ")]
        print(f"{subject.name:<18} {len(own):5d} cases {sum(one.accepted for one in own):5d} accepted "
              f"{sum(bool(one.fault) for one in own):3d} fell")  # fmt: skip
    faults = {name: sum(one.fault == name for one in found) for name in FAULTS}
    print(f"{len(found)} broken inputs, seed {options.seed}: {sum(one.accepted for one in found)} accepted, "
          + ", ".join(f"{count} {name}" for name, count in faults.items()))  # fmt: skip
    return 1 if any(faults.values()) else 0


if __name__ == "__main__":
    sys.exit(_main())
