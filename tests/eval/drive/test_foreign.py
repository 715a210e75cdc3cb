"""Policies of others: each kind of Python object and two clients drive, and whatever one does wrong has its cause told."""

import contextlib
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.message import DecodeError

from hippodrome.core.navigation.types import Command, DrivingState, Goal, Indicator, Lamp, Radar
from hippodrome.core.types import HippodromeError, Observation
from hippodrome.eval.drive.foreign import Foreign, Policy, check_policy, parse_policy
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.proto import method_stream_pb2 as pb
from hippodrome.proto.codec import save_map
from hippodrome.proto.driving import (
    command_message,
    command_of,
    lane_messages,
    network_of,
    observation_message,
    observation_of,
    radar_message,
    radar_of,
)
from hippodrome.sim.render.camera import CameraSpec
from tests.changes import BINARY, _float
from tests.core.navigation.roads import ring
from tests.eval.contest.test_streams import FRAMES
from tests.proto.maps import assert_same, random_map

EXAMPLES = Path(__file__).parents[3] / "examples/loop"
GOAL = Goal(100.0, 60.0, 1.5)
POLICIES = """\
import numpy as np
from hippodrome.core.navigation.types import Command, DrivingState, Indicator

print("said aloud")  # breaks no message

class Planner:
    def __init__(self, cognitive_map, network):
        self.length_m = float(network.lane_lengths_m().sum())
    def set_goal(self, goal):
        self.goal = goal
    def step(self, observation, radar):
        print("said aloud, too")
        assert observation.frame is None or observation.frame.flags.writeable
        return Command(self.goal.x_m / 1e3, radar.gap_m / 1e3, Indicator.RIGHT, DrivingState.DOUBTING, f"{self.length_m:.1f}")

class Called:
    def __call__(self, observed):
        return np.array([0.5 * observed["lamp"], observed["frame"].mean() / 255.0, -1.0])

class Predicts:
    def predict(self, observed):
        return [0.0, float(observed["gap_m"][0]) / 100.0], None

class Falls:
    def step(self, observation, radar):
        raise ZeroDivisionError("at the second junction")

class Silent:
    def step(self, observation, radar):
        while True:
            pass

class Truthless:
    def step(self, observation, radar):
        import sys
        found = [name for name in sys.modules if name.startswith(("hippodrome.sim", "libsumo", "highway_env"))]
        return Command(0.0, 0.0, reason=f"{found} {sorted(observation.__slots__)} {sorted(radar.__slots__)}")

class Wrong:
    def step(self, observation, radar):
        return 3.0

class Nan:
    def step(self, observation, radar):
        return Command(float("nan"), 0.0)

def short(observed):
    return [0.0]

class Nothing:
    pass

number = 3
"""


@pytest.fixture
def map_file(tmp_path):
    save_map(tmp_path / "map.pbstream", random_map(refined=True))
    return tmp_path / "map.pbstream"


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "their_policies.py").write_text(POLICIES)
    monkeypatch.chdir(tmp_path)
    return "their_policies"


def frames(count=3, seed=1):
    rng = np.random.default_rng(seed)
    for k in range(count):
        frame = rng.integers(0, 255, (120, 160, 3), dtype=np.uint8) if k != 1 else None
        if frame is not None:
            frame[60:, 80:][:, 20 + 5 * k : 30 + 5 * k] = 250  # a line
        yield Observation(0.1 * (k + 1), 0.1, 1.0 + k, 0.01, frame), Radar(30.0 + k, 0.5, k > 0, Lamp(k % 2))


def commands(source, map_file, limit_s=30.0, steps=3):
    foreign = Foreign(Policy("theirs", source), limit_s)
    try:
        foreign.begin(map_file, ring(), GOAL, CameraSpec(), 10.0, 0)
        return [foreign.step(observation, radar) for observation, radar in frames(steps)], foreign
    finally:
        foreign.close()


def test_a_planner_is_given_map_network_and_goal_and_what_is_sensed(module, map_file):
    found, foreign = commands(f"{module}:Planner", map_file)
    length_m = float(ring().lane_lengths_m().sum())
    assert found == [
        Command(0.1, gap_m / 1e3, Indicator.RIGHT, DrivingState.DOUBTING, f"{length_m:.1f}") for gap_m in (30, 31, 32)
    ]
    assert foreign.cpu_s > 0.0


def test_policies_of_gymnasium_answer_with_actions(module, map_file):
    (first, second, _), _ = commands(f"{module}:Called", map_file)
    sensed = [observation for observation, _ in frames()]
    share = sensed[0].frame.mean() / 255.0
    assert (
        first.steering_rad == second.steering_rad == pytest.approx(0.25 * np.pi * share)
    )  # the second step has the first's frame
    assert first.acceleration_mps2 == 0.0 and second.acceleration_mps2 == 2.5 and first.indicator is Indicator.RIGHT
    assert commands(f"{module}:Predicts", map_file)[0][0].steering_rad == pytest.approx(0.25 * np.pi * 0.3)


def test_the_simulator_is_out_of_reach_of_a_policy(module, map_file):
    (first, *_), _ = commands(f"{module}:Truthless", map_file)
    assert first.reason.startswith("[] ['dt_s', 'frame', 'speed', 't_s', 'yaw_rate_radps'] ['blind', 'closing_mps'")


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")
def test_clients_are_short_and_drive_as_the_lane_keeper_of_the_examples(tmp_path, map_file, monkeypatch):
    built, clients = tmp_path / "drive_client", [EXAMPLES / name for name in ("drive_client.py", "drive_client.cpp")]
    assert all(len(client.read_text().splitlines()) < 100 for client in clients)
    subprocess.run(["g++", "-O2", "-Wall", "-Werror", "-o", built, clients[1]], check=True)
    python, _ = commands(f"exec:{sys.executable} {clients[0]}", map_file, steps=6)
    cpp, _ = commands(f"stream:{built}", map_file, steps=6)
    monkeypatch.chdir(EXAMPLES)
    keeper, _ = commands("lane_keeper:policy", map_file, steps=6)
    for one, other, third in zip(python, cpp, keeper, strict=True):
        assert one.steering_rad == pytest.approx(other.steering_rad, abs=1e-12) == pytest.approx(third.steering_rad, abs=1e-6)
        assert one.acceleration_mps2 == pytest.approx(other.acceleration_mps2)
    assert any(one.steering_rad != 0.0 for one in python)


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("Falls", "its last words: ZeroDivisionError: at the second junction"),
        ("Silent", "hung: no answer within 2 s"),
        ("Wrong", "step() gave a float; a hippodrome Command is expected"),
        ("Nan", "it commanded an acceleration of nan"),
        ("short", "action: [0.0] is not two or three finite numbers"),
    ],
)
def test_what_a_policy_does_wrong_is_told(module, map_file, name, cause):
    with pytest.raises(MethodError) as told:
        commands(f"{module}:{name}", map_file, limit_s=2.0)
    assert cause in str(told.value)


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("raise SystemExit(4)\n", "exit status 4"),
        ("", "it ended before the drive did"),
        ("print('hello ' * 1000)\n", "no message of proto/method_stream.proto"),
        (FRAMES + "answer(FromMethod(ready=Ready(version=7)))\nsys.stdin.read()\n", "it speaks version 7 of the stream"),
        (FRAMES + "answer(FromMethod(ready=Ready(version=1)))\nanswer(FromMethod(answer=Answer()))\nsys.stdin.read()\n",
         "answered with 'answer' where 'command' was expected"),
        (FRAMES + "answer(FromMethod(ready=Ready(version=1)))\nsys.stdin.read()\n", "hung: no answer within 2 s"),
    ],
)  # fmt: skip
def test_what_a_program_does_wrong_is_told(tmp_path, map_file, text, cause):
    (tmp_path / "client.py").write_text(text)
    with pytest.raises(MethodError) as told:
        commands(f"exec:{sys.executable} {tmp_path / 'client.py'}", map_file, limit_s=2.0)
    assert cause in str(told.value)


@pytest.mark.parametrize(
    ("source", "cause"),
    [
        ("absent_module:Policy", "there is no module 'absent_module'"),
        ("their_policies:Absent", "the module their_policies has no 'Absent'"),
        ("their_policies:Nothing", "a class without step, predict and __call__"),
        ("their_policies:number", "is a int; a policy is"),
        ("exec:./absent", "there is no program './absent'"),
    ],
)
def test_a_policy_that_cannot_be_run_is_refused_before_anything_is_driven(module, source, cause):
    with pytest.raises(HippodromeError) as told:
        check_policy(Policy("theirs", source))
    assert cause in str(told.value) and "\n" not in str(told.value)


def test_a_policy_that_can_be_run_is_not_refused(module):
    check_policy(Policy("theirs", f"{module}:Planner"))


def test_policies_are_named_by_the_command_line():
    assert parse_policy("mine=exec:./drive --fast") == Policy("mine", "exec:./drive --fast")
    assert parse_policy("my_module:MyPolicy") == Policy("MyPolicy", "my_module:MyPolicy")
    assert parse_policy("stream:./build/drive").name == "drive"
    with pytest.raises(ValueError, match="none of"):
        parse_policy("my_module")


def test_what_is_sensed_and_commanded_survives_the_stream():
    for observation, radar in (*frames(), (next(frames())[0], Radar(blind=True))):
        again = observation_of(pb.Observation.FromString(observation_message(observation).SerializeToString()))
        assert_same(again.frame, observation.frame) if observation.frame is not None else None
        assert (again.t_s, again.speed, again.yaw_rate_radps) == (observation.t_s, observation.speed, observation.yaw_rate_radps)
        assert radar_of(pb.Radar.FromString(radar_message(radar).SerializeToString())) == radar
    command = Command(-1.5, 0.2, Indicator.LEFT, DrivingState.ARRIVED, "is there")
    assert command_of(command_message(command)) == command
    with pytest.raises(HippodromeError, match="state 9"):
        command_of(pb.Command(state=9))
    network = ring()
    assert_same(network_of(list(lane_messages(network)), network.survey_sigma_m), network)


def test_broken_commands_are_commands_or_refused():
    """Garbage in a message is a command that the vehicle can be given, or a sentence."""
    whole = command_message(Command(-1.5, 0.2, Indicator.LEFT, DrivingState.DRIVING, "brakes", True)).SerializeToString()
    read = 0
    for seed in range(1500):
        rng = np.random.default_rng(seed)
        kinds = (*BINARY, _float)
        data = kinds[int(rng.integers(len(kinds)))](rng, whole)
        with contextlib.suppress(DecodeError, HippodromeError):
            command = command_of(pb.Command.FromString(data))
            assert math.isfinite(command.acceleration_mps2) and math.isfinite(command.steering_rad)
            assert command.reason.isprintable() and len(command.reason) <= 200
            read += 1
    assert 100 < read < 1500


def test_what_a_policy_says_cannot_command_the_terminal():
    assert command_of(pb.Command(reason="\x1b[31mred\nline\u202e")).reason == " [31mred line "
