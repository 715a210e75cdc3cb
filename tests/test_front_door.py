"""What ``import hippodrome`` offers, and that its objects behave as people expect of Python objects."""

import dataclasses
import inspect
import subprocess
import sys
from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest

import hippodrome
import hippodrome.core
from hippodrome import CognitiveMap, Localizer, Mapper, Observation, RoadNetwork, Trajectory, localize, map_drive, refine
from hippodrome.core.types import HippodromeError, ObservationError

PUBLIC = {
    "Mapper", "map_drive", "refine", "Localizer", "localize", "Observation", "CognitiveMap", "RoadNetwork", "StartPose",
    "Trajectory", "load_map", "save_map", "read_network", "ape", "rpe", "__version__",
}  # fmt: skip
GOOD = {"t_s": 0.1, "dt_s": 0.1, "speed": 5.0, "yaw_rate_radps": 0.0}


def test_the_public_names_are_these_and_each_can_be_had():
    assert set(hippodrome.__all__) == set(dir(hippodrome)) == PUBLIC
    for name in PUBLIC:
        assert getattr(hippodrome, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        hippodrome.no_such_name  # noqa: B018


def test_importing_loads_no_part():
    code = "import sys, hippodrome; print([name for name in sys.modules if name.startswith(('numpy', 'hippodrome.'))])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_the_version_is_that_of_the_package():
    from importlib.metadata import version

    assert hippodrome.__version__ == version("hippodrome")


@pytest.mark.parametrize("name", sorted(PUBLIC - {"__version__"}))
def test_every_public_name_says_what_it_is(name):
    assert inspect.getdoc(getattr(hippodrome, name))


@pytest.mark.parametrize("function", [Mapper, map_drive, refine, Localizer, localize])
def test_every_config_has_a_default(function):
    assert inspect.signature(function).parameters["config"].default is not inspect.Parameter.empty


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("speed", np.nan, "speed is nan, a finite number"),
        ("yaw_rate_radps", -np.inf, "yaw_rate_radps is -inf"),
        ("t_s", np.inf, "t_s is inf"),
        ("dt_s", 0.0, "dt_s is 0.0, a positive number"),
        ("dt_s", -0.1, "dt_s is -0.1"),
        ("dt_s", np.nan, "dt_s is nan"),
        ("frame", np.zeros((4, 4)), "frame is float64 of shape"),
        ("frame", np.zeros((4, 4, 4), np.uint8), "(H, W, 3)"),
        ("frame", np.zeros((0, 4), np.uint8), "(H, W), grey"),
        ("frame", "frame.png", "frame is str"),
    ],
)
def test_an_observation_that_cannot_be_is_refused_with_field_value_and_cure(field, value, expected):
    with pytest.raises(ObservationError) as caught:
        Observation(**{**GOOD, field: value})
    assert expected in str(caught.value)
    assert isinstance(caught.value, HippodromeError)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 3)])
def test_frames_are_grey_or_rgb(shape):
    assert Observation(**GOOD, frame=np.zeros(shape, np.uint8)).frame.shape == shape


def test_objects_with_arrays_compare_by_identity_and_have_a_short_repr():
    trajectory, same = (Trajectory(np.arange(9.0), np.zeros((9, 3))) for _ in range(2))
    assert trajectory == trajectory
    assert trajectory != same
    assert len({trajectory, same}) == 2
    assert repr(trajectory) == "Trajectory(t_s=float64[9], poses=float64[9, 3])"
    assert "frame=uint8[3, 4, 3]" in repr(Observation(**GOOD, frame=np.zeros((3, 4, 3), np.uint8)))


def _dataclasses():
    for module in walk_packages(hippodrome.core.__path__, "hippodrome.core."):
        for thing in vars(import_module(module.name)).values():
            if dataclasses.is_dataclass(thing) and isinstance(thing, type) and thing.__module__ == module.name:
                yield thing


@pytest.mark.parametrize("kind", list(_dataclasses()), ids=lambda kind: kind.__qualname__)
def test_no_dataclass_of_core_compares_arrays(kind):
    """``==`` between arrays is an array, which is neither true nor false."""
    holds_arrays = any("Array" in str(field.type) or "ndarray" in str(field.type) for field in dataclasses.fields(kind))
    assert not holds_arrays or kind.__eq__ is object.__eq__


@pytest.mark.parametrize("kind", [CognitiveMap, RoadNetwork])
def test_large_objects_are_told_in_a_line(kind):
    assert "__repr__" in vars(kind)
