"""The same method as a class and as a program over the stream: the same bytes, of its map and of its answers."""

import sys

import numpy as np

from hippodrome.eval.contest.calls import draw_all, localize
from hippodrome.eval.contest.entry import Added, entries_of, parse_method, with_methods
from hippodrome.sim.method_spec import MethodSpec

# Both import it: arithmetic on self-motion and on the bytes of frames, whose last digits depend on the order of additions.
ARITHMETIC = """\
import math

class Walker:
    def __init__(self, x=0.0, y=0.0, heading=0.0):
        self.x, self.y, self.heading, self.seen = x, y, heading, 0.0

    def step(self, dt_s, speed, yaw_rate_radps, pixels):
        if pixels:
            self.seen = 0.9 * self.seen + 1e-5 * (sum(pixels) % 1013)
        self.heading += yaw_rate_radps * dt_s + 1e-4 * self.seen
        self.x += speed * dt_s * math.cos(self.heading)
        self.y += speed * dt_s * math.sin(self.heading)
        return self.x, self.y, self.heading

    def covariance(self):
        return [1.0 + self.seen, 0.1, 0.0, 0.1, 1.0 / 3.0, 0.0, 0.0, 0.0, 0.01]
"""
CLASS = """\
import numpy as np
from arithmetic import Walker
from hippodrome.eval.methods.protocol import Answer

def steps(walker, observations):
    for one in observations:
        pixels = b"" if one.frame is None else one.frame.tobytes()
        yield one, walker.step(one.dt_s, one.speed, one.yaw_rate_radps, pixels)

class Twin:
    frame = "network"
    def map(self, observations, given):
        for one, pose in steps(Walker(), observations):
            yield one.t_s, *pose
    def localize(self, observations, given):
        walker = Walker(*map(float, given.mapped.trajectory.poses[10]))
        for one, pose in steps(walker, observations):
            yield Answer(one.t_s, *pose, localized=one.t_s > 3.0, covariance=np.reshape(walker.covariance(), (3, 3)))
"""
CLIENT = """\
import sys
from pathlib import Path
from arithmetic import Walker
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed
from hippodrome.proto.method_stream_pb2 import Answer, Finished, FromMethod, Pose, Ready, ToMethod

def answer(message):
    serialize_length_prefixed(message, sys.stdout.buffer)
    sys.stdout.buffer.flush()

poses = []
while (message := parse_length_prefixed(ToMethod, sys.stdin.buffer)) is not None:
    kind = message.WhichOneof("message")
    if kind == "begin":
        begin, walker = message.begin, Walker()
        start = Path(begin.folder) / "start.txt"
        if begin.phase == begin.LOCALIZE:
            walker = Walker(*map(float, start.read_text().split()))
        answer(FromMethod(ready=Ready(version=begin.version)))
    elif kind == "observation":
        one = message.observation
        x, y, heading = walker.step(one.dt_s, one.speed, one.yaw_rate_radps, one.pixels)
        poses.append((x, y, heading))
        said = Answer(known=True, pose=Pose(x=x, y=y, heading_rad=heading))
        if begin.phase == begin.LOCALIZE:
            said = Answer(known=one.t_s > 3.0, pose=said.pose, covariance=walker.covariance())
        answer(FromMethod(answer=said))
    else:
        if begin.phase == begin.MAP:
            start.write_text(" ".join(map(repr, poses[10])))
        answer(FromMethod(finished=Finished()))
"""


def test_map_and_localization_have_the_same_bytes_in_a_process_of_ours_and_over_the_stream(materials, tmp_path, monkeypatch):
    for name, text in (("arithmetic", ARITHMETIC), ("twin", CLASS), ("client", CLIENT)):
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    command = f"{sys.executable} {tmp_path / 'client.py'}"
    added = (parse_method("class=twin:Twin"), Added("fed", MethodSpec(stream=command, localize=command, frame="network")))
    entries = entries_of(with_methods(materials.scenario, added))[-2:]
    folders = {entry.method.key: tmp_path / entry.method.key for entry in entries}
    for folder in folders.values():
        folder.mkdir()
    drawn = draw_all(materials, entries, folders)
    first, second = (drawn[entry.method.key].mapped.trajectory for entry in entries)
    assert first.t_s.tobytes() == second.t_s.tobytes()
    assert first.poses.tobytes() == second.poses.tobytes()
    answers = [
        localize(one, materials, drawn[one.method.key].mapped, folders[one.method.key], materials.drive) for one in entries
    ]
    for entry in entries:
        entry.close()
    ours, fed = (run.estimates for run in answers)
    assert len(ours) == len(fed) == len(materials.drive.samples.t_s)
    assert any(one.localized for one in ours) and not all(one.localized for one in ours)
    for one, other in zip(ours, fed, strict=True):
        assert (one.t_s, one.localized) == (other.t_s, other.localized)
        assert one.pose.tobytes() == other.pose.tobytes()
        assert np.asarray(one.covariance).tobytes() == np.asarray(other.covariance).tobytes()
