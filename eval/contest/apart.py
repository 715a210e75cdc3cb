"""A Python class in a process of its own: handed its observations one by one, held to limits of time and memory, and measured.

The class runs in ``child.py``; what it returns comes back pickled, its state stays where it is. It is not kept from anything that
the user may read: it is trusted not to look for the truth.
"""

from __future__ import annotations

import functools
import io
import os
import pickle
import select
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from hippodrome._folders import temporary_folder
from hippodrome.core.types import FloatArray, Frame, Observation
from hippodrome.eval.contest.declared import Declared
from hippodrome.eval.contest.guard import Crashed
from hippodrome.eval.contest.sources import method_sha256
from hippodrome.eval.methods.protocol import Cost, Given, Localized, Mapped, MethodError
from hippodrome.eval.programs.limits import Limits
from hippodrome.eval.programs.process import POLL_S, Process, started
from hippodrome.eval.programs.references import search_here
from hippodrome.sim.method_spec import MethodSpec

CHILD: Final = "hippodrome.eval.contest.child"
DECLARE: Final = "declare"  # what the process is asked for before an object is made: what the class says of itself
IMPORT_LIMIT_S: Final = 120.0  # to import a class's module: the largest libraries take half a minute from a slow disk
LENGTH: Final = struct.Struct("<Q")  # before each message: its length in bytes
SCRIBBLED: Final = "it wrote to a file that it did not open, which is the harness's"
# Packages, and names of Python's own, whose objects answers may be made of.
KNOWN_PACKAGES: Final = frozenset({"hippodrome", "numpy", "collections", "pathlib"})
KNOWN_BUILTINS: Final = frozenset({"bytearray", "complex", "frozenset", "range", "set", "slice"})
AnswerT = TypeVar("AnswerT", Mapped, Localized)
LOOK_S: Final = 1.0  # between two looks at what memory it holds, and what it keeps on disk
CHUNK_BYTES: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class Made:
    """What the process makes its object of."""

    label: str
    spec: MethodSpec
    path: tuple[str, ...]  # where modules are looked for


@dataclass(frozen=True, slots=True)
class Sealed:
    """The state of a map, pickled: it goes from process to process, and what it is made of is not imported here."""

    pickled: bytes


@dataclass(frozen=True, slots=True)
class Kept:
    """Stands for the state of a map that stays in the method's own process."""


class _Reader(pickle.Unpickler):
    """Makes objects of types that the harness knows, so that no module of others is imported here."""

    def find_class(self, module: str, name: str) -> Any:
        if module.partition(".")[0] in KNOWN_PACKAGES or (module == "builtins" and name in KNOWN_BUILTINS):
            return super().find_class(module, name)
        raise MethodError(
            f"what it gave cannot be handed over: it holds a {module}.{name}; numbers, texts, lists and arrays are expected, and "
            "Mapped.state for all else"
        )


def _unpickled(message: bytes) -> tuple[str, Any]:
    """Kind and value of a message. Raises MethodError if it is none, or holds what the harness does not know."""
    try:
        kind, value = _Reader(io.BytesIO(message)).load()
    except MethodError:
        raise
    except Exception:  # bytes that are no pickle raise nearly anything
        raise MethodError(SCRIBBLED) from None
    return kind, value


class Apart:
    """The functions of a class, carried out in one process, which begins with the first call and ends with ``close``."""

    def __init__(self, label: str, spec: MethodSpec) -> None:
        self._made = Made(label, spec, tuple(sys.path))
        self._limits = Limits.of(spec)
        self._stack = ExitStack()
        self._process: Process | None = None
        self._looked_s = 0.0

    def close(self) -> None:
        """End the process; a later call begins another."""
        self._process = None
        self._stack.close()

    def prepare(self) -> None:
        """Make the object, so that what it is asked for next is measured without that."""
        self._call("ready", None)

    def cpu_s(self) -> float:
        """CPU time that its process has taken so far."""
        return 0.0 if self._process is None else self._process.cpu_now_s()

    @property
    def peak_rss_bytes(self) -> int | None:
        """The most memory that its process held when it was looked at."""
        return None if self._process is None else self._process.peak_rss_bytes

    def _map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        self._watch(given.folder)
        made: tuple[Mapped, bool] = self._call("map", _sendable(given), observations)
        mapped, saves = made
        return replace(self._measured(mapped), save=self._save if saves else None)

    def _localize(self, observations: Iterator[Observation], given: Given) -> Localized:
        self._watch(given.folder)
        localized: Localized = self._call("localize", _sendable(given), observations)
        return self._measured(localized)

    def _watch(self, folder: Path) -> None:
        """Let the limit of what it keeps on disk count what comes into a folder that it is given."""
        (self._process or self._begin()).disk.watch(folder)

    def _measured(self, answer: AnswerT) -> AnswerT:
        """An answer with the memory that was seen here; what it says of its cost is looked at later."""
        cost = answer.cost
        return replace(answer, cost=replace(cost, peak_rss_bytes=self.peak_rss_bytes)) if isinstance(cost, Cost) else answer

    def _describe(self, frame: Frame) -> FloatArray:
        vector: FloatArray = self._call("describe", frame)
        return vector

    def _warm_up(self) -> None:
        self._call("warm_up", None)

    def _save(self, path: Path) -> int:
        size: int = self._call("save", path)
        return size

    def _call(self, name: str, argument: Any, observations: Iterator[Observation] | None = None) -> Any:
        """What the class's function returns; each call has the whole limit of time. Raises MethodError, Crashed."""
        try:
            message = pickle.dumps((name, argument), pickle.HIGHEST_PROTOCOL)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise MethodError(f"what it builds on cannot be handed to another process: {error}") from None
        process = self._process or self._begin()
        process.began_s = time.monotonic()
        self._send(process, message)
        while True:
            kind, value = _unpickled(self._received(process))
            if kind == "next":
                assert observations is not None
                self._send(process, pickle.dumps(next(observations, None), pickle.HIGHEST_PROTOCOL))
            elif kind == "done":
                process.look()
                return value
            elif kind == "crashed":
                raise Crashed(*value)
            else:
                raise MethodError(value)

    def _begin(self) -> Process:
        self._stack = ExitStack()
        folder = self._stack.enter_context(temporary_folder())
        command = [sys.executable, "-m", CHILD]
        self._process = self._stack.enter_context(started(command, folder, self._limits, fed=True))
        self._send(self._process, pickle.dumps(self._made, pickle.HIGHEST_PROTOCOL))
        return self._process

    def _send(self, process: Process, body: bytes) -> None:
        assert process.popen.stdin is not None
        sink, view, began_s = process.popen.stdin.fileno(), memoryview(LENGTH.pack(len(body)) + body), time.monotonic()
        os.set_blocking(sink, False)
        while view:
            try:
                view = view[os.write(sink, view) :]
            except BlockingIOError:
                select.select([], [sink], [], POLL_S)
                self._look(process, sink, began_s)
            except BrokenPipeError:
                raise self._ended(process) from None

    def _received(self, process: Process) -> bytes:
        """The next message. Raises MethodError if the process ends instead, or is past a limit."""
        assert process.popen.stdout is not None
        source, held, wanted, began_s = process.popen.stdout.fileno(), bytearray(), LENGTH.size, time.monotonic()
        head = True
        while len(held) < wanted:
            if select.select([source], [], [], POLL_S)[0]:
                data = os.read(source, min(wanted - len(held), CHUNK_BYTES))
                if not data:
                    raise self._ended(process)
                held += data
                if head and len(held) == wanted:
                    wanted, head = LENGTH.unpack(held)[0], False
                    if wanted > self._limits.memory_bytes:
                        raise MethodError(SCRIBBLED)
                    held.clear()
            self._look(process, source, began_s)
        return bytes(held)

    def _look(self, process: Process, end: int, began_s: float) -> None:
        """Raise MethodError if the process has ended, is past a limit, or closed the pipe ``end`` that is waited for."""
        now_s = time.monotonic()
        if now_s - self._looked_s > LOOK_S or process.left_s <= 0.0:
            self._looked_s = now_s
            if process.poll():
                raise self._ended(process)
            if now_s - began_s > LOOK_S and process.has_let_go(end):
                process.stop("it closed the pipe to the harness, which is its standard input or output")
                raise self._ended(process)

    def _ended(self, process: Process) -> MethodError:
        """Why there is no answer; the process is over."""
        end_s = time.monotonic() + 2.0
        while not process.poll() and time.monotonic() < end_s:
            time.sleep(POLL_S / 10.0)
        cause = process.failure() or "it ended its process with status 0 before it answered"
        self.close()
        return MethodError(cause)


def declaration_of(spec: MethodSpec, label: str) -> Declared:
    """What a class declares, asked in a process of its own, so that nothing of it is imported here.

    It is asked once for each state of its source.

    Raises:
        MethodError: There is no such class, it cannot be imported, or that takes longer than it may.
    """
    search_here()
    return _asked(label, spec, method_sha256(spec), tuple(sys.path))


@functools.cache
def _asked(label: str, spec: MethodSpec, _sha256: str, _path: tuple[str, ...]) -> Declared:
    limit_s = min(IMPORT_LIMIT_S, spec.time_limit_s)
    asked = Apart(label, spec.model_copy(update={"time_limit_s": limit_s}))
    try:
        declared: Declared = asked._call(DECLARE, None)
    except (MethodError, Crashed) as error:
        if str(error).startswith("method "):
            raise
        raise MethodError(f"method {spec.class_}: importing its module: {error}") from None
    finally:
        asked.close()
    return declared


# By the names that the protocol has them under: a class that lacks a function has a stand-in that lacks it, too.
FUNCTIONS: Final[dict[str, Callable[..., Any]]] = {
    "map": Apart._map,
    "localize": Apart._localize,
    "describe": Apart._describe,
    "warm_up": Apart._warm_up,
}


def apart(declared: Declared, label: str, spec: MethodSpec) -> Apart:
    """A stand-in for an object of a class, with those of the protocol's functions that the class has."""
    functions = {name: FUNCTIONS[name] for name in declared.functions}
    stand_in: Apart = type("Apart", (Apart,), functions)(label, spec)
    return stand_in


def _sendable(given: Given) -> Given:
    """What it is given, without functions, which stay here."""
    base, mapped = given.base, given.mapped
    return replace(
        given,
        base=None if base is None else replace(base, save=None),
        mapped=None if mapped is None else replace(mapped, save=None),
    )
