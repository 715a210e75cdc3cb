"""The process in which a class of ``apart.py`` runs: requests on standard input, answers on what was standard output.

What the class prints goes to standard error, which the harness keeps in a file.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import IO, Any

import numpy as np

from hippodrome.core.types import FloatArray, Frame, HippodromeError, Observation
from hippodrome.eval.contest.apart import DECLARE, LENGTH, Kept, Made, Sealed
from hippodrome.eval.contest.declared import Declared, looked_at, require_as_declared
from hippodrome.eval.contest.guard import left_by
from hippodrome.eval.contest.loading import load_class, made_of
from hippodrome.eval.methods.feed import Feed
from hippodrome.eval.methods.protocol import Cost, Given, Localized, Mapped, MethodError, as_answers, as_estimate, as_mapped
from hippodrome.eval.programs.references import crash_of, printable


class Over(BaseException):
    """The harness has closed the pipe. It is no Exception, so that no method takes it for one of its own."""


class Served:
    """One object of a class, and the map that it made."""

    def __init__(self, made: Made, source: IO[bytes], sink: IO[bytes]) -> None:
        assert made.spec.class_ is not None
        self._label, self._source, self._sink = made.label, source, sink
        cls = load_class(made.spec.class_)
        self._runner = made_of(cls, made.spec.config, None, made.label)
        require_as_declared(self._runner, cls, made.spec, made.label)
        self._mapped: Mapped | None = None

    def map(self, given: Given) -> tuple[Mapped, bool]:
        """Its map of the observations that it is handed, without what can only live here, and whether it can be saved."""
        feed, began = Feed(self._observations()), process_time()
        self._mapped = as_mapped(self._runner.map(iter(feed), _unsealed(given)), self._label)
        feed.settle()
        cost = self._mapped.cost or Cost(process_time() - began - feed.decoding_s, None, feed.step_s)
        return replace(self._mapped, state=_sealed(self._mapped.state), save=None, cost=cost), self._mapped.save is not None

    def localize(self, given: Given) -> Localized:
        """Its answers to the observations that it is handed."""
        feed, began = Feed(self._observations()), process_time()
        opened = _unsealed(given)
        mapped = self._mapped if self._mapped is not None else opened.mapped
        found = self._runner.localize(iter(feed), replace(opened, mapped=mapped))
        answers = [as_estimate(one, self._label) for one in as_answers(found, self._label)]
        if isinstance(found, Localized):
            return replace(found, answers=answers)
        feed.settle()
        return Localized(answers, Cost(process_time() - began - feed.decoding_s, None, feed.step_cpu_s))

    def describe(self, frame: Frame) -> FloatArray:
        """Its vector of a frame."""
        vector: FloatArray = np.asarray(self._runner.describe(frame))
        return vector

    def ready(self, _: None) -> None:
        """The object is there: it was made for this call, if not before."""

    def warm_up(self, _: None) -> None:
        """Whatever it does before it is timed."""
        self._runner.warm_up()

    def save(self, path: Path) -> int:
        """Its map in a file; the size in bytes."""
        assert self._mapped is not None
        assert self._mapped.save is not None
        size = self._mapped.save(path)
        if not isinstance(size, int) or size < 0:
            raise MethodError(f"{self._label}: save() gave {size!r:.40}; the size of the file in bytes is expected")
        return size

    def _observations(self) -> Iterator[Observation]:
        while True:
            answer(self._sink, "next", None)
            observation = request(self._source)
            if observation is None:
                return
            yield observation


def request(source: IO[bytes]) -> Any:
    """The next message of the harness. Raises Over when there is none any more."""
    head = source.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise Over
    return pickle.loads(source.read(LENGTH.unpack(head)[0]))


def answer(sink: IO[bytes], kind: str, value: Any) -> None:
    """Send one message to the harness."""
    try:
        body = pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        cause = printable(f"what it gave cannot be handed over: {type(error).__name__}: {error}")
        body = pickle.dumps(("refused", cause), pickle.HIGHEST_PROTOCOL)
    sink.write(LENGTH.pack(len(body)) + body)
    sink.flush()


def main() -> None:
    """Serve requests until the harness closes the pipe."""
    source, sink = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a method that prints does not break the messages, nor does one that reads
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    served: Served | None = None
    try:
        made: Made = request(source)
        sys.path[:] = made.path
        while True:
            name, argument = request(source)
            try:
                if name == DECLARE:
                    value = _declared(made)
                else:
                    served = served or Served(made, source, sink)
                    value = getattr(served, name)(argument)
            except Over:
                raise
            except HippodromeError as error:
                answer(sink, "refused", str(error))
            except SystemExit as error:
                answer(sink, "refused", left_by(error))
            except BaseException as error:
                answer(sink, "crashed", crash_of(error))
            else:
                answer(sink, "done", value)
    except Over:
        return


def _declared(made: Made) -> Declared:
    """What the class declares; no object is made of it."""
    assert made.spec.class_ is not None
    return looked_at(made.spec.class_, made.spec.config, made.label)


def _sealed(state: Any) -> Any:
    """A map's state as it leaves the process, or what says that it stays. Objects of ours, as refinements, are no secret."""
    if state is None or type(state).__module__.partition(".")[0] == "hippodrome":
        return state
    try:
        return Sealed(pickle.dumps(state, pickle.HIGHEST_PROTOCOL))
    except Exception:
        return Kept()


def _unsealed(given: Given) -> Given:
    """What is given, with the states of maps that other processes sealed."""
    return replace(given, base=_opened(given.base), mapped=_opened(given.mapped))


def _opened(mapped: Mapped | None) -> Mapped | None:
    if mapped is None or not isinstance(mapped.state, Sealed):
        return mapped
    return replace(mapped, state=pickle.loads(mapped.state.pickled))


if __name__ == "__main__":
    main()
