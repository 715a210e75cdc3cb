"""Methods that need stereo pairs: each way in is given both images, and a drive without them is a row with the cause."""

import sys

import pytest

from hippodrome.eval.contest.entry import Added, entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform
from hippodrome.sim.method_spec import MethodSpec

CLASS = """\
from hippodrome.eval.methods.protocol import Needs, StereoObservation

class Pairs:
    needs = Needs(stereo=True)
    def map(self, observations, given):
        assert given.camera.stereo_baseline_m == 0.5
        for i, one in enumerate(observations):
            assert isinstance(one, StereoObservation)
            assert (one.frame is None) == (one.right is None) == (i % 2 == 1)
            assert one.right is None or (one.right.astype(int) - one.frame == 1).all()
            yield one.t_s, float(i), 0.0, 0.0
"""
STREAM = """\
import sys
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed
from hippodrome.proto.method_stream_pb2 import Answer, Finished, FromMethod, Pose, Ready, ToMethod

x = 0.0
while (message := parse_length_prefixed(ToMethod, sys.stdin.buffer)) is not None:
    kind, one = message.WhichOneof("message"), message.observation
    if kind == "begin":
        assert message.begin.camera.baseline_m == 0.5
        answer = FromMethod(ready=Ready(version=1))
    elif kind == "observation":
        assert len(one.pixels) == len(one.right_pixels) == one.width * one.height * one.channels
        assert not one.pixels or one.right_pixels[0] == one.pixels[0] + 1
        x += 1.0
        answer = FromMethod(answer=Answer(known=True, pose=Pose(x=x)))
    else:
        answer = FromMethod(finished=Finished())
    serialize_length_prefixed(answer, sys.stdout.buffer)
    sys.stdout.buffer.flush()
"""
LISTING = """\
import json, pathlib, sys
here = pathlib.Path(sys.argv[1])
assert json.loads((here / "camera.json").read_text())["baseline_m"] == 0.5
sys.exit(" ".join(str(sorted(place.iterdir())[0].relative_to(here)) for place in map(here.joinpath, sys.argv[3:])))
"""


@pytest.fixture
def row(materials, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "pairs_of.py").write_text(CLASS)
    (tmp_path / "client.py").write_text(STREAM)
    (tmp_path / "listing.py").write_text(LISTING)

    def of(added, baseline_m=0.5):
        camera = materials.scenario.camera.model_copy(update={"stereo_baseline_m": baseline_m})
        materials.scenario = with_methods(materials.scenario.model_copy(update={"camera": camera}), [added])
        return perform(materials, [entries_of(materials.scenario)[-1]]).rows[0]

    return of


STREAMED = Added("streamed", MethodSpec(stream=f"{sys.executable} client.py", needs=("stereo",)))


def test_a_class_and_a_streamed_program_see_both_images(row):
    assert row(parse_method("mine=pairs_of:Pairs")).failure is None
    found = row(STREAMED)
    assert found.failure is None
    assert found.declaration.given == "self-motion, stereo pairs"


@pytest.mark.parametrize(
    ("layout", "places", "files"),
    [
        ("euroc", ("mav0/cam0/data", "mav0/cam1/data"), "mav0/cam0/data/100000000.png mav0/cam1/data/100000000.png"),
        ("kitti", ("image_2", "image_3"), "image_2/000000.png image_3/000000.png"),
    ],
)
def test_pairs_lie_where_the_layouts_have_them(row, layout, places, files):
    command = f"{sys.executable} listing.py {{sequence}} {{out}} {' '.join(places)}"
    assert files in row(Added("files", MethodSpec(command=command, input=layout, needs=("stereo",)))).failure


def test_a_drive_that_lacks_what_is_needed_is_a_row_with_cause_and_cure(row):
    found = row(STREAMED, baseline_m=None)
    assert "it needs stereo pairs" in found.failure
    assert "camera.stereo_baseline_m" in found.failure
    sized = Added("large", MethodSpec(stream="./absent", needs=("640x480", "grain")))
    assert "at least 640x480" in row(sized).failure


@pytest.mark.parametrize(
    ("settings", "cause"),
    [
        ({"command": "./a {sequence} {out}", "needs": ["stereo"]}, "input tum has no place for the right image"),
        ({"command": "./a {sequence} {out}", "needs": ["sonar"]}, "should match pattern"),
        ({"class": "a:B", "needs": ["stereo"]}, "needs is for programs"),
        ({"stream": "./a", "axes": "camera"}, "over the stream poses are planar"),
    ],
)
def test_what_cannot_be_is_refused(settings, cause):
    with pytest.raises(ValueError, match=cause):
        MethodSpec.model_validate(settings)


def test_orb_slam3_is_one_of_them(row):
    assert parse_method("ORB-SLAM3").name == "ORB-SLAM3"
    assert "at least 640x480" in row(parse_method("ORB-SLAM3")).failure
