"""Entries: the methods that take part in an evaluation, ours and others, each ready to be run."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from hippodrome.eval.contest.apart import Apart, apart, declaration_of
from hippodrome.eval.contest.declared import Declared, declared_by
from hippodrome.eval.contest.loading import load_class, made_of, require_config
from hippodrome.eval.methods.method import ALIGNMENTS, METHODS, Method, stem_of
from hippodrome.eval.methods.ours import DeadReckoning, SemiMetric, Topometric, TopometricPaper
from hippodrome.eval.methods.protocol import Describes, Localizes, Maps, MethodError, Needs
from hippodrome.eval.programs.containment import can_contain
from hippodrome.eval.programs.program import ProgramLocalizer, ProgramMapper
from hippodrome.eval.programs.stream import StreamLocalizer, StreamMapper
from hippodrome.eval.results.model import Declaration
from hippodrome.eval.rivals.orbslam3.method import OrbSlam3
from hippodrome.eval.rivals.rows import NoAttractor, RatSlamMethod
from hippodrome.sim.key_words import faults_of
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.value_words import CLASS, METHOD_NAME, PATTERNS

# In the order of the tables. They are made and run as everybody's methods are.
BUILT_IN: Final[tuple[type[Any], ...]] = (DeadReckoning, SemiMetric, RatSlamMethod, NoAttractor, TopometricPaper, Topometric)
# Ours as well, that take part only where they are asked for, by their labels.
OFFERED: Final = {OrbSlam3.label: f"{OrbSlam3.__module__}:{OrbSlam3.__qualname__}"}
TRUTHS: Final = ("ground-truth.tum", "localization-ground-truth.tum")  # files beside those of the methods
GROUP: Final = "hippodrome.methods"  # of entry points, by which an installed package makes its methods known


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """A method that takes part: what it is called, what it is given, and the object that does the work."""

    method: Method
    runner: Any  # an object with map, localize or describe
    needs: Needs
    builds_on: str | None = None  # key of the method on whose map it builds
    source: str = "hippodrome"  # where it comes from, for the report
    apart: bool = False  # whether it runs in a process of its own

    def close(self) -> None:
        """End the process of its own, if it has one that still runs."""
        if isinstance(self.runner, Apart):
            self.runner.close()

    @property
    def declaration(self) -> Declaration:
        """What its row says of it."""
        base = f"the map of {self.builds_on}, " if self.builds_on is not None and self.source != "hippodrome" else ""
        return Declaration(
            frame=self.method.frame, given=base + self.needs.in_words(), source=self.source, isolated=self.apart and can_contain()
        )

    @property
    def does(self) -> tuple[str, ...]:
        """Which of ``map``, ``localize`` and ``describe`` it can."""
        protocols = {"map": Maps, "localize": Localizes, "describe": Describes}
        return tuple(name for name, protocol in protocols.items() if isinstance(self.runner, protocol))


@dataclass(frozen=True, slots=True)
class Added:
    """A method that the command line adds to every scenario."""

    name: str | None
    spec: MethodSpec


def parse_method(text: str) -> Added:
    """What ``--method`` names: a class, ``exec:COMMAND``, ``stream:COMMAND`` or an installed method, each after ``NAME=`` or not.

    Raises:
        ValueError: It is none of these; the message says what is expected.
    """
    name, source = _named(text)
    kind, _, rest = source.partition(":")
    if not rest:
        name, source = name or source, _installed(source)
    try:
        spec = MethodSpec.model_validate(source)
    except ValidationError as error:
        raise ValueError(f"'{text}': {faults_of(error, source)[0].words}") from None
    return Added(name or (_program_name(rest) if kind in ("exec", "stream") else None), spec)


def _named(text: str) -> tuple[str | None, str]:
    """Name and source of ``NAME=SOURCE``; None: it has no name. Raises ValueError if what stands for a name is none."""
    before, equals, source = text.partition("=")
    if not equals or ":" in before:  # the = is a part of a command
        return None, text
    if re.fullmatch(METHOD_NAME.strip("^$"), before) is None:
        raise ValueError(f"'{text}': '{before}' is no name of a method: {PATTERNS[METHOD_NAME]}")
    return before, source


def _installed(name: str) -> str:
    """The class of a method that comes with hippodrome, or that an installed package makes known. Raises ValueError."""
    installed = [*OFFERED.items(), *((point.name, point.value) for point in entry_points(group=GROUP))]
    found = sorted({value.partition("[")[0].replace(" ", "") for other, value in installed if other == name})
    if not found:
        names = ", ".join(sorted({other for other, _ in installed}))
        raise ValueError(f"'{name}' is neither module:Class, exec:COMMAND nor stream:COMMAND, nor an installed method ({names})")
    if len(found) > 1:
        raise ValueError(f"'{name}' is the name of several installed methods; name one by its class: {', '.join(found)}")
    if not re.fullmatch(CLASS.strip("^$"), found[0]):
        raise ValueError(f"'{name}': its package makes '{found[0]}' known as a method, which is no my_package.my_module:MyClass")
    return found[0]


def as_option(name: str, spec: MethodSpec) -> str:
    """The option by which the command line adds a method that it has added before."""
    what = spec.class_ or (f"exec:{spec.command}" if spec.command is not None else f"stream:{spec.stream}")
    return f"--method {shlex.quote(f'{name}={what}')}"


def with_methods(scenario: Scenario, added: Sequence[Added]) -> Scenario:
    """The scenario with methods added to its own, as if they stood in its file. Raises MethodError if two have one name."""
    methods = dict(scenario.methods)
    for one in added:
        name = one.name
        if name is None:
            assert one.spec.class_ is not None
            name = _card(declaration_of(one.spec, one.spec.class_.rpartition(":")[2]).label, "own").label
        if name in methods:
            raise MethodError(f"method {name}: there is one of this name already; give it another, NAME=...")
        methods[name] = one.spec
    return scenario.model_copy(update={"methods": methods})


def entries_of(scenario: Scenario) -> list[Entry]:
    """All entries of one scenario: ours, then those that it names.

    Raises:
        MethodError: A method cannot be loaded, or two have one name.
    """
    ours = [_ours(cls, cls.card, made_of(cls, {}, scenario, cls.card.label)) for cls in BUILT_IN]
    theirs = [_foreign(name, spec) for name, spec in scenario.methods.items()]
    entries = [*ours, *theirs]
    _require_names(entries)
    return entries


def _ours(cls: type[Any], method: Method, runner: Any) -> Entry:
    """The entry of a method that comes with hippodrome."""
    return _entry_of(declared_by(cls, method.label), method, runner, "hippodrome")


def _foreign(name: str, spec: MethodSpec) -> Entry:
    """The entry of a method that a scenario or the command line names."""
    if spec.class_ is None:
        return _program(name, spec)
    if spec.class_ in OFFERED.values():  # what it does is done by a process of its own
        cls = load_class(spec.class_)
        method = _card(name, str(spec.frame or cls.frame))
        require_config(cls, spec.config, name)
        return replace(_ours(cls, method, made_of(cls, spec.config, None, name)), apart=True)
    declared = declaration_of(spec, name)
    method = _card(name, spec.frame or declared.frame)
    return _entry_of(declared, method, apart(declared, name, spec), spec.class_)


def _program(name: str, spec: MethodSpec) -> Entry:
    """The entry of a program, in a process of its own."""
    command = spec.command or spec.stream or ""
    mapper, localizer = (StreamMapper, StreamLocalizer) if spec.stream else (ProgramMapper, ProgramLocalizer)
    runner = localizer(spec) if spec.localize else mapper(spec)
    needs = _needs(spec)
    source = f"{'stream' if spec.stream else 'exec'}:{command}"
    return Entry(_card(name, spec.frame or "own"), runner, needs, None, source, apart=True)


def _needs(spec: MethodSpec) -> Needs:
    """What a scenario says that a program needs."""
    named = {name: True for name in spec.needs if "x" not in name}
    sizes = [tuple(map(int, name.split("x"))) for name in spec.needs if "x" in name]
    size_px = (max(width for width, _ in sizes), max(height for _, height in sizes)) if sizes else None
    return Needs(**named, size_px=size_px)


def _card(label: str, frame: str) -> Method:
    if not re.fullmatch(METHOD_NAME.strip("^$"), label):
        raise MethodError(f"method '{label}': this cannot be its name: letters, digits, blanks and . _ + ( ) , - up to 40")
    if frame not in ALIGNMENTS:
        raise MethodError(f"method {label}: frame '{frame}' is unknown; use one of {', '.join(ALIGNMENTS)}")
    stem = stem_of(label)
    return Method(stem, label, frame, stem, map_file=f"{stem}.pbstream")


def _entry_of(declared: Declared, method: Method, runner: Any, source: str) -> Entry:
    entry = Entry(method, runner, declared.needs, declared.builds_on, source)
    if not entry.does:
        raise MethodError(f"method {method.label}: it has none of the functions map, localize and describe")
    return entry


def _require_names(entries: Iterable[Entry]) -> None:
    """Raise MethodError if two entries have one name, or files of one name, or a name that ORB-SLAM3 has, or build on nothing."""
    entries, taken, files = list(entries), set[str](), dict.fromkeys(TRUTHS, "the truth")
    reserved = {method.stem for method in METHODS} - {cls.card.stem for cls in BUILT_IN}
    for entry in entries:
        method, another = entry.method, "give it another name, NAME=..."
        if taken & {method.stem, method.key} or (method.stem in reserved and not isinstance(entry.runner, OrbSlam3)):
            raise MethodError(f"method {method.label}: there is one of this name already; {another}")
        taken |= {method.stem, method.key}
        own = {f"{method.stem}.tum", f"{method.stem}-localization.tum", *filter(None, [method.map_file])}
        if same := sorted(own & set(files)):
            raise MethodError(f"method {method.label}: its file {same[0]} would be that of {files[same[0]]}; {another}")
        files |= dict.fromkeys(own, f"'{method.label}'")
    keys = [entry.method.key for entry in entries]
    for entry in entries:
        if entry.builds_on is not None and entry.builds_on not in keys:
            raise MethodError(f"method {entry.method.label}: it builds on '{entry.builds_on}'; there are {', '.join(keys)}")


def _program_name(command: str) -> str:
    """A name for a program that was given none: that of its file."""
    words = command.split()
    return re.sub(r"[^A-Za-z0-9._+-]", "-", Path(words[0]).stem if words else "program").lstrip("-._+")[:40] or "program"
