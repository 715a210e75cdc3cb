"""A program that is fed frame by frame: the clients of the examples, and a row with the cause for whatever one does wrong."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import Added, entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.programs.stream import answer_of
from hippodrome.proto import method_stream_pb2 as pb
from hippodrome.sim.method_spec import MethodSpec
from tests.eval.contest.entrants import MAPPER

EXAMPLES = Path(__file__).parents[3] / "examples/methods"
LONGEST = 100  # lines of a client
FRAMES = """\
import sys, zlib
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed
from hippodrome.proto.method_stream_pb2 import Answer, Finished, FromMethod, Pose, Ready, TimedPose, ToMethod

def answer(message):
    serialize_length_prefixed(message, sys.stdout.buffer)
    sys.stdout.buffer.flush()

"""
LOCALIZER = (
    FRAMES
    + """\
from pathlib import Path
poses = []
while (message := parse_length_prefixed(ToMethod, sys.stdin.buffer)) is not None:
    kind = message.WhichOneof("message")
    if kind == "begin":
        begin, step = message.begin, 0
        place = Path(begin.folder) / "poses.txt"
        if begin.phase == begin.LOCALIZE:
            kept = [tuple(map(float, line.split())) for line in place.read_text().splitlines()]
        answer(FromMethod(ready=Ready(version=1)))
    elif kind == "observation":
        one = message.observation
        assert len(one.pixels) == one.width * one.height * one.channels
        if begin.phase == begin.MAP:
            poses.append((one.t_s, *{truth}[step]))
            answer(FromMethod(answer=Answer(known=False)))
        else:
            x, y, heading = kept[step][1:]
            answer(FromMethod(answer=Answer(known=step > 20, pose=Pose(x=x, y=y, heading_rad=heading))))
        step += 1
    else:
        if begin.phase == begin.MAP:
            place.write_text("\\n".join(" ".join(map(repr, pose)) for pose in poses))
        timed = [TimedPose(t_s=t, pose=Pose(x=x, y=y, heading_rad=h)) for t, x, y, h in poses]
        answer(FromMethod(finished=Finished(trajectory=timed)))
"""
)


def rows_of(materials, *added):
    entries = entries_of(with_methods(materials.scenario, added))[-len(added) :]
    return perform(materials, entries)


def stream(command, **settings):
    return Added("streamed", MethodSpec(stream=command, **settings))


@pytest.fixture
def program(tmp_path):
    """Writes a Python program and gives the command that runs it."""

    def write(text):
        (tmp_path / "client.py").write_text(text)
        return f"{sys.executable} {tmp_path / 'client.py'}"

    return write


@pytest.fixture(scope="module")
def cpp(tmp_path_factory):
    if shutil.which("g++") is None:
        pytest.skip("there is no C++ compiler")
    built = tmp_path_factory.mktemp("cpp") / "stream_client"
    subprocess.run(["g++", "-O2", "-Wall", "-Werror", "-o", built, EXAMPLES / "stream_client.cpp"], check=True)
    return str(built)


def test_clients_are_short():
    for name in ("stream_client.py", "stream_client.cpp"):
        assert len((EXAMPLES / name).read_text().splitlines()) < LONGEST


def test_a_streamed_method_gives_the_bytes_that_it_gives_in_process(materials, cpp, tmp_path, monkeypatch):
    (tmp_path / "streamed_twin.py").write_text(MAPPER)
    monkeypatch.chdir(tmp_path)
    python = Added("python", MethodSpec(stream=f"{sys.executable} {EXAMPLES / 'stream_client.py'}"))
    added = (parse_method("class=streamed_twin:Mapper"), python, Added("cpp", MethodSpec(stream=cpp)))
    performance = rows_of(materials, *added)
    assert [row.failure for row in performance.rows] == [None, None, None]
    first, *others = (outcome.scored.trajectory for outcome in performance.outcomes)
    for other in others:
        np.testing.assert_array_equal(other.t_s, first.t_s)
        np.testing.assert_array_equal(other.poses, first.poses)


def test_a_client_has_its_costs_measured(materials, cpp):
    row = rows_of(materials, stream(cpp)).rows[0]
    assert 0.0 < row.latency_ms.median <= row.latency_ms.p99 < 1000.0
    assert row.cpu_percent > 0.0
    assert row.peak_rss_bytes > 100_000


def test_a_client_corrects_its_trajectory_in_the_end_and_localizes_in_what_it_kept(materials, program):
    command = program(LOCALIZER.replace("{truth}", repr(materials.mapping.samples.poses_m.tolist())))
    row = rows_of(materials, stream(command, localize=command, frame="network")).rows[0]
    assert row.failure is None
    assert row.ape.mean_m < 1e-6
    assert row.localization.success
    assert row.localization.initial_frames == 22


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("import time\ntime.sleep(1000)\n", "hung: no end after 2 s"),
        ("raise SystemExit(4)\n", "exit status 4"),
        ("", "it ended before the drive did"),
        ("print('hello ' * 1000)\n", "no message of proto/method_stream.proto"),
        ("import sys\nsys.stdout.buffer.write(bytes([255] * 10))\nsys.stdin.read()\n", "no length of a message"),
        ("import sys\nsys.stdout.buffer.write(bytes([255, 255, 255, 127]))\nsys.stdin.read()\n", "the limit is 67108864"),
        ("import os, signal\nos.kill(os.getpid(), signal.SIGABRT)\n", "signal 6 (SIGABRT)"),
        ("import sys\nsys.stdin.read()\n", "hung"),
        (FRAMES + "answer(FromMethod(ready=Ready(version=1)))\nwhile True: answer(FromMethod(answer=Answer(known=True)))\n", ""),
        (FRAMES + "answer(FromMethod(ready=Ready(version=7)))\nsys.stdin.read()\n", "it speaks version 7 of the stream"),
        (FRAMES + "answer(FromMethod(answer=Answer()))\nsys.stdin.read()\n", "answered with 'answer' where 'ready'"),
        (FRAMES + "answer(FromMethod(ready=Ready(version=1)))\n", "it ended before the drive did"),
    ],
)
def test_whatever_it_does_wrong_is_in_its_row(materials, program, text, cause):
    row = rows_of(materials, stream(program(text), time_limit_s=2.0)).rows[0]
    assert cause in row.failure
    assert row.ape is None


CLOSED = "it closed its standard input or output, and went on"


@pytest.mark.parametrize("text", [
    "import os, time\nos.close(1)\ntime.sleep(1000)\n",
    "import os, sys, time\nsys.stdin.buffer.read(10)\nos.dup2(2, 1)\ntime.sleep(1000)\n",
    FRAMES + "answer(FromMethod(ready=Ready(version=1)))\nimport os, time\nos.close(0)\ntime.sleep(1000)\n",
    "import os, time\nos.fork()\nos.closerange(0, 3)\ntime.sleep(1000)\n",
])  # fmt: skip
def test_a_client_that_closes_its_pipes_and_lives_on_is_named_at_once(materials, program, text):
    began = time.monotonic()
    row = rows_of(materials, stream(program(text), time_limit_s=60.0)).rows[0]
    assert CLOSED in row.failure
    assert time.monotonic() - began < 50.0  # a busy machine


def test_a_client_that_hands_its_pipes_to_another_is_none_of_those(materials, program):
    slow = (
        "import subprocess, sys\nsubprocess.Popen(['sleep', '4'], stdin=subprocess.DEVNULL)\nimport os\nos.close(1)\nos.wait()\n"
    )
    row = rows_of(materials, stream(program(slow), time_limit_s=60.0)).rows[0]
    assert CLOSED not in row.failure and "it ended before the drive did" in row.failure


def test_a_covariance_has_nine_numbers_or_none():
    assert answer_of(1.0, pb.Answer(known=True)).covariance is None
    assert answer_of(1.0, pb.Answer(covariance=range(9))).covariance.shape == (3, 3)
    with pytest.raises(HippodromeError, match="t_s=1 has a covariance of 3 numbers"):
        answer_of(1.0, pb.Answer(covariance=[1.0, 2.0, 3.0]))


def test_a_client_that_is_not_there_is_named(materials):
    assert "there is no program './absent'" in rows_of(materials, stream("./absent")).rows[0].failure
