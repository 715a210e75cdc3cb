"""How far a run is: lines where there is no terminal, and a file in its folder that ``hippodrome serve`` shows meanwhile."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from hippodrome._files import read_bounded, write_atomically

PROGRESS: Final = ".progress.json"  # in the folder of a run that is under way, or that did not end well
MAX_BYTES: Final = 100_000  # of such a file: a few stages take a few hundred
EVERY_S: Final = 0.5  # between two writings of it at least


class Stage(BaseModel):
    """One stage that has begun."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str
    done: int
    total: int
    seconds: float


class Progress(BaseModel):
    """The content of the file: the stages that have begun, and the names of all in their order, as far as they are known."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    plan: tuple[str, ...]
    stages: tuple[Stage, ...]


@dataclass(slots=True)
class Teller:
    """Says what a run is at, how long it took so far and what is next."""

    wanted: bool  # whether to print lines
    plan: tuple[str, ...] = ()  # names of all stages, in their order
    folder: Path | None = None  # where to keep the file; None: nowhere
    stages: list[Stage] = field(default_factory=list)
    _began_s: float = 0.0
    _quarters: int = 0  # of the stage that lines were printed about: one that is refused at once says nothing but why
    _kept_s: float = 0.0

    def begin(self, name: str, total: int) -> None:
        """A stage begins; one without tasks was done before."""
        self._began_s, self._quarters = time.monotonic(), 0
        self.stages.append(Stage(name=name, done=0, total=total, seconds=0.0))
        self._keep(at_once=True)
        if total == 0 and self.wanted and self.plan:
            print(f"{name}: nothing to do{self._next(name)}", file=sys.stderr, flush=True)

    def say(self, done: int, total: int) -> None:
        """So many tasks of the stage are done; prints a line when another quarter is."""
        name, seconds = self.stages[-1].name, time.monotonic() - self._began_s
        self.stages[-1] = Stage(name=name, done=done, total=total, seconds=round(seconds, 1))
        self._keep(at_once=done == total)
        quarters = 4 * done // max(total, 1)
        if self.wanted and quarters > self._quarters:
            self._quarters = quarters
            following = self._next(name) if done == total else ""
            print(f"{name}: {done} of {total} done, {seconds:.0f} s{following}", file=sys.stderr, flush=True)

    def end(self) -> None:
        """The run is over and went well: the file has done its work."""
        if self.folder is not None:
            with suppress(OSError):
                (self.folder / PROGRESS).unlink(missing_ok=True)

    def _next(self, name: str) -> str:
        later = self.plan[self.plan.index(name) + 1 :] if name in self.plan else ()
        return f"; next: {later[0]}" if later else ""

    def _keep(self, at_once: bool) -> None:
        now_s = time.monotonic()
        if self.folder is None or not (at_once or now_s - self._kept_s >= EVERY_S):
            return
        self._kept_s = now_s
        content = Progress(plan=self.plan, stages=tuple(self.stages))
        with suppress(OSError):  # the run itself says what is wrong with its folder
            write_atomically(self.folder / PROGRESS, content.model_dump_json().encode())


def read_progress(folder: Path) -> Progress | None:
    """How far the run in a folder is; None where none is under way, or where its file cannot be read just now."""
    try:
        return Progress.model_validate_json(read_bounded(folder / PROGRESS, MAX_BYTES))
    except (OSError, ValidationError):
        return None
