"""What a class declares, its settings and its functions are looked at before anything is driven; what is wrong is a sentence."""

from dataclasses import dataclass
from functools import partial

import pytest
from pydantic import BaseModel, field_validator

from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.declared import declared_by, require_as_declared
from hippodrome.eval.contest.entry import BUILT_IN
from hippodrome.eval.contest.loading import made_of, require_config
from hippodrome.eval.methods.protocol import Needs
from hippodrome.eval.rivals.orbslam3.method import OrbSlam3
from hippodrome.sim.method_spec import MethodSpec


class Inner(BaseModel):
    length_m: float = 1.0


class Settings(BaseModel):
    corners: int = 300
    inner: Inner = Inner()
    learn_on: list[str]

    @field_validator("corners")
    @classmethod
    def _some(cls, value: int) -> int:
        if value == 13:
            raise ValueError("thirteen\ncorners bring bad luck")
        if value == 14:
            raise KeyError("fourteen")
        return value


class Configured:
    Config = Settings

    def __init__(self, config):
        self.config = config

    def map(self, observations, given): ...


class Unsettled(Configured):
    def __init__(self):
        pass


class Keywords:
    def __init__(self, corners, radius_m=3.0):
        self.corners = corners

    def map(self, observations, given): ...


class Anything(Keywords):
    def __init__(self, **settings):
        self.settings = settings


class Plain:
    def describe(self, frame): ...


@dataclass
class Fields:
    words: int = 16

    def describe(self, frame): ...


@pytest.mark.parametrize(
    ("cls", "config", "words"),
    [
        (Configured, {"learn_on": [], "corners": "many"}, "config.corners: must be a whole number, not 'many'"),
        (Configured, {"learn_on": [], "corners": True}, None),  # its own model decides
        (Configured, {"learn_on": []}, None),
        (Configured, {}, "config.learn_on: must be given"),
        (Configured, {"learn_on": "a"}, "config.learn_on: must be a list, as in [a, b], not 'a'"),
        (Configured, {"learn_on": [3]}, "config.learn_on.0: must be text"),
        (Configured, {"learn_on": [], "cornrs": 3}, "config.cornrs: unknown key; did you mean corners?"),
        (Configured, {"learn_on": [], "x": 3}, "config.x: unknown key; take it out; there are corners, inner, learn_on"),
        (Configured, {"learn_on": [], "inner": {"length": 3}}, "config.inner.length: unknown key; did you mean inner.length_m?"),
        (Configured, {"learn_on": [], "inner": 3}, "config.inner: takes keys of its own (length_m), not 3"),
        (Configured, {"learn_on": [], "corners": 13}, "config.corners: thirteen corners bring bad luck"),
        (Configured, {"learn_on": [], "corners": 14}, "config: its Config cannot be made: KeyError: 'fourteen'"),
        (Unsettled, {"learn_on": []}, "the class has a Config, so that its constructor is called with one"),
        (Keywords, {"corners": 1}, None),
        (Keywords, {}, "config.corners: must be given, as the constructor asks for it"),
        (Keywords, {"corners": 1, "radius": 2}, "config.radius: unknown setting; there are corners, radius_m"),
        (Anything, {"whatever": 1}, None),
        (Plain, {}, None),
        (Plain, {"a": 1}, "config.a: unknown setting; the class has no Config, and its constructor takes nothing"),
        (Fields, {"words": 3}, None),
        (Fields, {"word": 3}, "config.word: unknown setting; there are words"),
    ],
)
def test_settings_fit_or_are_told_in_words(cls, config, words):
    if words is None:
        require_config(cls, config, "mine")
        assert made_of(cls, config, None, "mine") is not None
        return
    for call in (require_config, lambda *given: made_of(given[0], given[1], None, given[2])):
        with pytest.raises(HippodromeError) as caught:
            call(cls, config, "mine")
        assert str(caught.value).startswith(f"method mine: {words}")
        assert "\n" not in str(caught.value) and "Input should" not in str(caught.value)


def with_function(name, function):
    return type("Mine", (), {name: function})


async def awaited(self, observations, given): ...


async def awaited_one_by_one(self, observations, given):
    yield 1


@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("map", lambda self, observations, given: 1, None),
        ("map", lambda self, *given: 1, None),
        ("map", lambda self, observations, given, more=3: 1, None),
        ("map", staticmethod(lambda observations, given: 1), None),
        ("map", classmethod(lambda cls, observations, given: 1), None),
        ("map", partial(print, "mine"), None),
        ("map", lambda observations, given: 1, "it has map(observations, given), and it is called as map(observations, given)"),
        ("map", lambda self, observations: 1, "it has map(self, observations), and it is called as map(observations, given)"),
        ("localize", lambda self: 1, "it has localize(self), and it is called as localize(observations, given)"),
        ("describe", lambda self, frame, given: 1, "it has describe(self, frame, given), and it is called as describe(frame)"),
        ("warm_up", lambda self, given: 1, "it has warm_up(self, given), and it is called as warm_up()"),
        ("map", None, "its map is a NoneType, not a function"),
        ("map", awaited, "its map is async, and nobody awaits it"),
        ("localize", awaited_one_by_one, "its localize is async"),
    ],
)
def test_functions_can_be_called_as_the_protocol_calls_them_or_that_is_said(name, function, words):
    if words is None:
        assert name in declared_by(with_function(name, function), "mine").functions
        return
    with pytest.raises(HippodromeError) as caught:
        declared_by(with_function(name, function), "mine")
    assert str(caught.value).startswith(f"method mine: {words}")


@pytest.mark.parametrize("needs", [Needs, {"camera": False}, "stereo", None])
def test_needs_are_needs(needs):
    with pytest.raises(HippodromeError, match=r"its needs are a .*Needs\(\.\.\.\) is expected"):
        declared_by(type("Mine", (), {"needs": needs, "describe": lambda self, frame: 1}), "mine")


@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({"frame": "network"}, r"its constructor sets frame \('network'\), which is too late"),
        ({"needs": Needs(stereo=True)}, "its constructor sets needs"),
        ({"builds_on": "topometric"}, "its constructor sets builds_on"),
        ({"frame": "own", "needs": Needs(), "builds_on": None}, None),  # what the class has
        ({"frame": None, "needs": ["a", "list"], "label": 3}, None),  # other things of these names
        ({"frame": "metric"}, None),  # as the scenario says
    ],
)
def test_what_a_constructor_declares_too_late_is_refused(own, words):
    runner = Plain()
    vars(runner).update(own)
    spec = MethodSpec.model_validate({"class": "m:C", "frame": "metric"})
    if words is None:
        require_as_declared(runner, Plain, spec, "mine")
    else:
        with pytest.raises(HippodromeError, match=words):
            require_as_declared(runner, Plain, spec, "mine")
    require_as_declared(3, int, spec, "mine")  # an object without a dictionary of its own


@pytest.mark.parametrize("cls", [*BUILT_IN, OrbSlam3])
def test_ours_keep_to_it(cls):
    assert declared_by(cls, "ours").functions
