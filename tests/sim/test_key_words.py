"""What is wrong with a value is said in the words of its author, whatever the value is: pydantic's own reach nobody."""

import enum
import math
import re
import typing
from datetime import date, datetime, timedelta
from pathlib import Path
from uuid import UUID

import pytest
import yaml
from pydantic import AnyUrl, AwareDatetime, BaseModel, Field, ValidationError
from pydantic_core import ErrorDetails, core_schema

from hippodrome.eval.authoring.errors import file_errors
from hippodrome.eval.gate.baseline import Baseline
from hippodrome.eval.results.model import Results
from hippodrome.sim.key_names import names_at, path_meant, unread_key
from hippodrome.sim.key_words import faults_of, first_fault, place_of
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import SelfMotionNoise
from hippodrome.sim.spec import Spec
from hippodrome.sim.value_words import wanted_of, words_of

STOCK = re.compile(r"Input should|validation error|type=|input_value|errors\.pydantic|Value error|Assertion failed|"
                   r"Field required|valid (integer|number|string|boolean|dictionary|list|tuple)|"
                   r"instance of|<class|Extra inputs|Field\(")  # fmt: skip
# One of each kind of value that YAML has, and the sizes and words that people write in place of others.
WRONG = {
    "null": None, "true": True, "whole": 7, "negative": -3, "huge": 10**400, "fraction": 2.5,
    "nan": math.nan, "infinity": math.inf,
    "text": "five", "empty text": "", "date": date(2024, 5, 17), "moment": datetime(2024, 5, 17, 13, 45), "binary": b"\x00\xff",
    "set": {1, 2}, "list": [1, [2]], "empty list": [], "words": ["a", "b"], "keys": {"a": 1}, "empty keys": {},
    "key that is a number": {1: 2}, "long": "x" * 1000, "two lines": "a\nb\x1b[31m",
}  # fmt: skip


class Colour(enum.Enum):
    RED = "red"


class Inner(BaseModel):
    length_m: float = 1.0


class Many(BaseModel):
    """Settings of a stranger's class: most kinds of values that pydantic has."""

    inner: Inner = Inner()
    inners: list[Inner] = []
    colour: Colour = Colour.RED
    day: date | None = None
    moment: datetime | None = None
    aware: AwareDatetime | None = None
    span: timedelta | None = None
    address: AnyUrl | None = None
    number: UUID | None = None
    pair: tuple[int, str] = (1, "a")
    some: typing.Annotated[list[int], Field(min_length=2, max_length=3)] = [1, 2]
    word: typing.Annotated[str, Field(min_length=2, max_length=4)] = "abc"
    even: typing.Annotated[int, Field(multiple_of=2)] = 2
    apart: set[int] = set()
    call: typing.Callable[[], None] | None = None
    kind: type[Inner] | None = None
    raw: bytes = b""
    choice: typing.Annotated[float, Field(gt=0)] | typing.Literal["auto"] = "auto"


def leaves(model, above=()):
    """The place of each key of a model, those that hold others too; of dictionaries and lists what lies in them."""
    for name in names_at(model, above):
        yield (*above, name)
        yield from leaves(model, (*above, name))


def places(model):
    yield from leaves(model)
    if model is Scenario:
        yield from (("methods", "mine", *path) for path in leaves(MethodSpec))
        yield from (("mapping", "closed", 0), ("missions", "rows", 0), ("missions", "policies", "mine"),
                    ("methods", "mine"), ("refine", "route", "solver", "along_sigma_m", 0),
                    ("refine", "paper", "min_sigma", 1))  # fmt: skip


def with_value(path, value):
    """A scenario in which ``value`` stands at a place."""
    for part in reversed(path):
        value = [0.1] * part + [value] if isinstance(part, int) else {part: value}
    return {"name": "a", **value}


def faults(model, data):
    try:
        model.model_validate(data)
    except ValidationError as error:
        return faults_of(error, data, model)
    return []


def assert_plain(words):
    assert not STOCK.search(words), words
    assert words.isprintable(), words  # one line
    assert len(words) < 700, words


@pytest.mark.parametrize("model", [Scenario, Many])
def test_every_key_names_itself_and_what_it_wants_for_every_kind_of_value(model):
    told = 0
    for path in places(model):
        for kind, value in WRONG.items():
            found = faults(model, with_value(path, value) if model is Scenario else {path[0]: value})
            told += len(found)
            for fault in found:
                words = f"{place_of(fault.location)}: {fault.words}"
                assert_plain(words)
                if fault.kind not in ("value_error", "string_pattern_mismatch"):  # these are sentences of ours
                    assert fault.words.startswith(("must ", "takes keys of its own", "unknown key")), (
                        kind,
                        words,
                    )
                if value is None and fault.given is None and fault.kind != "missing":
                    assert "leave the key out" in fault.words or "must be" not in fault.words, words
    assert told > (3000 if model is Scenario else 100)


def test_the_same_of_files(tmp_path):
    """The lines of files, a value of each kind at each key of the scenario's first two levels; each names the key in its line."""
    path = tmp_path / "a.yaml"
    for place in [one for one in places(Scenario) if len(one) <= 2 and all(isinstance(part, str) for part in one)]:
        for value in (None, True, -3, 2.5, "five", [1], {"a": 1}):
            path.write_text(yaml.safe_dump(with_value(place, value), sort_keys=False))
            for line in file_errors(path):
                assert_plain(line)
                assert place[0] in line or "names" in line or "has one of" in line, line


@pytest.mark.parametrize("model", [Results, Baseline])
def test_kept_files_that_are_wrong_are_told_in_the_same_words(model):
    for name in model.model_fields:
        for value in WRONG.values():
            try:
                model.model_validate({name: value})
            except ValidationError as error:
                assert_plain(first_fault(error, {name: value}, model))


def test_every_kind_of_error_that_pydantic_knows_has_words():
    for kind in typing.get_args(core_schema.ErrorType):
        one = typing.cast("ErrorDetails", {"type": kind, "loc": (), "msg": "Input should be odd", "input": 3})
        for words in (
            words_of(one),
            wanted_of(one),
            words_of({**one, "input": None}),
            words_of({**one, "msg": "Value error, a\nb"}),
        ):
            assert_plain(words)
            assert "{" not in words or "{a: b}" in words, words
            assert words


@pytest.mark.parametrize(("path", "meant"), [
    (("nose",), ("noise",)),
    (("camera", "hight"), ("camera", "height")),
    (("mapping", "length_m"), ("mapping", "tour", "length_m")),
    (("localization", "lenght_m"), ("localization", "tour", "length_m")),
    (("vehicles",), ("mapping", "traffic", "vehicles")),
    (("network",), ("town", "network")),
    (("methods", "mine", "comand"), ("methods", "mine", "command")),
    (("noise", "gyro_gian"), ("noise", "gyro_gain")),
    (("refine", "route", "solver", "inner_iteration"), ("refine", "route", "solver", "inner_iterations")),
    (("zzzzzz",), None),
])  # fmt: skip
def test_the_key_that_is_meant_is_found_here_or_elsewhere(path, meant):
    assert path_meant(Scenario, path) == meant


def test_names_of_keys_are_those_of_the_file():
    assert "class" in names_at(Scenario, ("methods", "anything"))
    assert "class_" not in names_at(MethodSpec, ())
    assert names_at(Scenario, ("noise",)) == list(SelfMotionNoise.model_fields)
    assert names_at(None, ()) == names_at(Path, ()) == names_at(Scenario, ("nowhere", 3)) == []


def test_a_key_that_a_model_would_pass_over_is_found():
    class Open(BaseModel, extra="allow"):
        a: int = 1

    assert unread_key(Many, {"inner": {"length": 2}}) == ("inner", "length")
    assert unread_key(Many, {"colour": "red", "colours": 1}) == ("colours",)
    assert unread_key(Many, {"inner": {"length_m": 2}}) is unread_key(Open, {"b": 1}) is unread_key(Spec, {}) is None


def test_a_place_is_one_line_whatever_its_keys_are():
    assert place_of(("a\nb", 3, "\x1b[31m", "", "x" * 500)) == f"a b.3.[31m.''.{60 * 'x'}"
