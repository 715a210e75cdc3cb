"""A policy that is not ours: a program that is fed step by step over the stream, or a Python object that ``child.py`` runs so."""

from __future__ import annotations

import re
import shutil
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hippodrome._folders import temporary_folder
from hippodrome.core.navigation.types import Command, Goal, Radar
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, Observation
from hippodrome.eval.contest.sources import method_sha256
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.limits import Limits
from hippodrome.eval.programs.process import Process, command_words, started
from hippodrome.eval.programs.stream import VERSION, Line, camera_message
from hippodrome.proto import method_stream_pb2 as pb
from hippodrome.proto.driving import command_of, lane_messages, observation_message, radar_message
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.value_words import POLICY

CHILD: Final = "hippodrome.eval.drive.child"
BEGIN_LIMIT_S: Final = 120.0  # to load, to read the map and to compile, before the first step
END_LIMIT_S: Final = 10.0
CHECK_LIMIT_S: Final = 120.0  # to import a module
NAMED: Final = re.compile(r"^([A-Za-z0-9][A-Za-z0-9 ._+(),-]{0,39})=(.*)$", re.DOTALL)
GIVEN: Final = "frames of one camera, self-motion, the radar, the map, the road network, the goal"  # for the report


@dataclass(frozen=True, slots=True)
class Policy:
    """A policy and how it is run."""

    name: str
    source: str  # module:Object, or exec: or stream: and a command

    @property
    def is_program(self) -> bool:
        """Whether it is a command."""
        return self.source.startswith(("exec:", "stream:"))

    @property
    def spec(self) -> MethodSpec:
        """The same as a method, for its limits and its sources."""
        kind, _, rest = self.source.partition(":")
        return MethodSpec.model_validate({"stream": rest} if kind in ("exec", "stream") else {"class": self.source})

    def words(self) -> list[str]:
        """The words of its command. Raises MethodError."""
        if self.is_program:
            return command_words(self.source.partition(":")[2])
        return [sys.executable, "-m", CHILD, self.source]

    def sha256(self) -> str:
        """Hash of what it is made of, so that no mission of older code is taken for one of its."""
        return method_sha256(self.spec)


def parse_policy(text: str) -> Policy:
    """What ``--policy`` names, after ``NAME=`` or not. Raises ValueError if it is no policy."""
    found = NAMED.match(text)
    name, source = (found.group(1), found.group(2)) if found else ("", text)
    if not re.fullmatch(POLICY, source):
        raise ValueError(f"'{text}' is none of my_package.my_module:MyPolicy, exec:COMMAND and stream:COMMAND")
    last = source.rpartition(":")[2].rpartition("/")[2] if source.startswith(("exec:", "stream:")) else source.partition(":")[2]
    return Policy(name or re.sub(r"[^A-Za-z0-9._-]", "-", last)[:40].strip("-._") or "policy", source)


def check_policy(policy: Policy) -> None:
    """Raise HippodromeError with the cause where a policy cannot be run at all."""
    words = policy.words()
    if policy.is_program:
        if shutil.which(words[0]) is None:
            raise HippodromeError(
                f"policy {policy.name}: there is no program '{words[0]}', or it may not be run; name its path, and chmod +x it"
            )
        return
    with temporary_folder() as folder, started([*words, "--check"], folder, Limits(CHECK_LIMIT_S, _memory(policy))) as process:
        try:
            process.wait()
        except MethodError as error:
            cause = str(error).partition("its last words: ")[2] or str(error)
            raise HippodromeError(f"policy {policy.name}: {cause}") from None


class Foreign:
    """Drives one mission: ``begin``, then ``step`` by step, then ``close``. What it does wrong is raised as ``MethodError``.

    Args:
        policy: which.
        answer_limit_s: how long it may take for a step, by the clock on the wall.
        concealed: folders that it shall not see.
    """

    estimate = None
    track = None
    plan = None

    def __init__(self, policy: Policy, answer_limit_s: float, concealed: tuple[Path, ...] = ()) -> None:
        self._policy, self._answer_limit_s, self._concealed = policy, answer_limit_s, concealed
        self._stack = ExitStack()
        self._process: Process | None = None
        self.cpu_s = 0.0

    def begin(self, map_file: Path, roads: RoadNetwork, goal: Goal, camera: CameraSpec, rate_hz: float, number: int) -> None:
        """Start it and tell it all that it may know. Nothing of the mission's seed, from which its start could be drawn, is."""
        folder = self._stack.enter_context(temporary_folder())
        given = folder / "map.pbstream"
        shutil.copyfile(map_file, given)
        limits = Limits(BEGIN_LIMIT_S, _memory(self._policy))
        self._process = self._stack.enter_context(started(self._policy.words(), folder, limits, self._concealed, fed=True))
        self._line = Line(self._process)
        begin = pb.Begin(
            version=VERSION, phase=pb.Begin.DRIVE, camera=camera_message(camera), rate_hz=rate_hz, seed=number,
            folder=str(folder), goal=pb.Pose(x=goal.x_m, y=goal.y_m, heading_rad=goal.heading_rad), map=str(given),
            survey_sigma_m=roads.survey_sigma_m, lanes=lane_messages(roads),
        )  # fmt: skip
        version = self._asked(pb.ToMethod(begin=begin), "ready").ready.version
        if version != VERSION:
            raise MethodError(f"it speaks version {version} of the stream, this harness version {VERSION}")
        self._process.limits = Limits(self._answer_limit_s, limits.memory_bytes)

    def step(self, observation: Observation, radar: Radar = Radar(), /) -> Command:
        """Its command. Raises MethodError with the cause if there is none."""
        message = observation_message(observation)
        message.radar.CopyFrom(radar_message(radar))
        try:
            return command_of(self._asked(pb.ToMethod(observation=message), "command").command)
        except MethodError:
            raise
        except HippodromeError as error:
            raise MethodError(str(error)) from None

    def close(self) -> None:
        """End it; ``cpu_s`` then says how much CPU time it took."""
        process = self._process
        if process is None:
            return
        try:
            if process.status is None:
                process.limits = Limits(END_LIMIT_S, process.limits.memory_bytes)
                self._asked(pb.ToMethod(end=pb.End()), "finished")
                self._line.close()
                process.began_s = time.monotonic()
                process.wait()
        except MethodError:  # the mission is over: how it takes leave is its own affair
            pass
        self._process = None
        self._stack.close()
        self.cpu_s = process.cpu_s

    def _asked(self, message: pb.ToMethod, expected: str) -> pb.FromMethod:
        assert self._process is not None
        self._process.began_s = time.monotonic()  # each answer has the whole limit
        try:
            return self._line.asked(message, expected)
        except MethodError as error:
            limit = self._process.limits.time_s
            said = str(error).replace(f"hung: no end after {limit:g} s, its limit", f"hung: no answer within {limit:g} s")
            raise MethodError(said) from None


def _memory(policy: Policy) -> int:
    return Limits.of(policy.spec).memory_bytes
