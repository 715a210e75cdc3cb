"""Methods that are programs and are fed frame by frame: ``proto/method_stream.proto`` on their standard input and output."""

from __future__ import annotations

import fcntl
import os
import select
import struct
import termios
import time
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Final

import numpy as np
from google.protobuf.message import DecodeError

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Observation, Trajectory
from hippodrome.eval.methods.protocol import Answer, Cost, Given, Localized, Mapped, MethodError, StereoObservation
from hippodrome.eval.programs.environments import words_of
from hippodrome.eval.programs.limits import Limits
from hippodrome.eval.programs.process import POLL_S, Process, last_words, started
from hippodrome.proto import method_stream_pb2 as pb
from hippodrome.proto.driving import observation_message
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.render.camera import CameraSpec

VERSION: Final = 1
MAX_MESSAGE_BYTES: Final = 64 << 20  # of a method's answer: the trajectory of a drive of a day
CHUNK_BYTES: Final = 1 << 16
# First bytes of messages: each holds one field, which is a message itself.
TAGS: Final = frozenset(field.number << 3 | 2 for field in pb.FromMethod.DESCRIPTOR.fields)
REPLACED: Final = "\ufffd"  # what Python makes of a byte that is no letter
QUOTED: Final = 40  # bytes of what is no message that an error repeats
LOOK_S: Final = 1.0  # between two looks at what memory a process that answers holds


class StreamMapper:
    """A program that makes a trajectory of the observations that it is fed."""

    def __init__(self, spec: MethodSpec) -> None:
        assert spec.stream is not None
        self._spec, self._command = spec, spec.stream

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """Its trajectory of the mapping drive. Raises MethodError with the cause if there is none."""
        times_s, answers, finished, cost = self._run(self._command, pb.Begin.MAP, observations, given)
        if finished.trajectory:
            t_s = np.array([one.t_s for one in finished.trajectory])
            poses = np.array([_pose(one.pose) for one in finished.trajectory])
            return Mapped(Trajectory(t_s, poses), cost=cost, live=_on_the_way(times_s, answers))
        if (live := _on_the_way(times_s, answers)) is None:
            raise MethodError("none of its answers has a pose, and its last message has no trajectory")
        return Mapped(live, cost=cost, live=live)

    def _run(
        self, command: str, phase: pb.Begin.Phase, observations: Iterator[Observation], given: Given
    ) -> tuple[list[float], list[pb.Answer], pb.Finished, Cost]:
        """One drive, from Begin to Finished: times, answers, the last message, and what it cost."""
        folder = given.folder / "kept"
        folder.mkdir(exist_ok=True)
        times_s, answers, steps_s, cpu_s = [], [], [], []
        words = words_of(self._spec, command)
        with started(words, given.folder, Limits.of(self._spec), given.concealed, fed=True) as process:
            line = Line(process)
            ready = line.asked(pb.ToMethod(begin=_begin(phase, given, folder)), "ready").ready
            if ready.version != VERSION:
                raise MethodError(f"it speaks version {ready.version} of the stream, this harness version {VERSION}")
            loading_s = process.cpu_now_s()
            for observation in observations:
                message = pb.ToMethod(observation=_observation(observation))
                began = time.perf_counter()
                answers.append(line.asked(message, "answer").answer)
                steps_s.append(time.perf_counter() - began)
                cpu_s.append(process.cpu_now_s())
                times_s.append(observation.t_s)
            finished = line.asked(pb.ToMethod(end=pb.End()), "finished").finished
            process.look()
            line.close()
            process.wait()
        step_cpu_s = np.diff(cpu_s, prepend=loading_s)
        cost = Cost(process.cpu_s - loading_s, process.peak_rss_bytes, np.array(steps_s), step_cpu_s, loading_s)
        return times_s, answers, finished, cost


class StreamLocalizer(StreamMapper):
    """A program that can find a second drive in what it kept of the first one."""

    def localize(self, observations: Iterator[Observation], given: Given) -> Localized:
        """Its answers to the observations of the second drive."""
        assert self._spec.localize is not None
        times_s, answers, _, cost = self._run(self._spec.localize, pb.Begin.LOCALIZE, observations, given)
        return Localized([answer_of(t_s, answer) for t_s, answer in zip(times_s, answers, strict=True)], cost)


def _on_the_way(times_s: list[float], answers: list[pb.Answer]) -> Trajectory | None:
    """The poses of the answers that have one; None if none has."""
    known = [(t_s, *_pose(answer.pose)) for t_s, answer in zip(times_s, answers, strict=True) if answer.known]
    table = np.array(known)
    return Trajectory(table[:, 0], table[:, 1:]) if known else None


class Line:
    """Messages to and from a process, with its limit of time."""

    def __init__(self, process: Process) -> None:
        assert process.popen.stdin is not None
        assert process.popen.stdout is not None
        self._process = process
        self._to, self._from = process.popen.stdin.fileno(), process.popen.stdout.fileno()
        self._held = bytearray()
        self._looked_s = self._asked_s = time.monotonic()
        os.set_blocking(self._to, False)
        os.set_blocking(self._from, False)

    def asked(self, message: pb.ToMethod, expected: str) -> pb.FromMethod:
        """The answer to a message. Raises MethodError if there is none, or it is another one than ``expected``."""
        data = message.SerializeToString()
        self._asked_s = time.monotonic()
        self._send(_varint(len(data)) + data)
        while (body := self._message()) is None:
            self._receive()
        try:
            answer = pb.FromMethod.FromString(body)
        except DecodeError:
            raise no_message(body) from None
        if (kind := answer.WhichOneof("message")) is None:
            raise MethodError(f"it sent an empty message where '{expected}' was expected; see proto/method_stream.proto")
        if kind != expected:
            raise MethodError(f"it answered with '{kind}' where '{expected}' was expected; see proto/method_stream.proto")
        return answer

    def close(self) -> None:
        """Nothing more is sent."""
        assert self._process.popen.stdin is not None
        self._process.popen.stdin.close()

    def _send(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self._to, view) :]
            except BlockingIOError:
                self._wait(writing=True)
            except BrokenPipeError:
                self._gone()

    def _receive(self) -> None:
        if not self._take():
            self._wait(writing=False)

    def _take(self) -> bool:
        """Keep what the process has said by now; False: nothing yet."""
        try:
            data = os.read(self._from, CHUNK_BYTES)
        except BlockingIOError:
            return False
        if not data:
            self._gone()
        self._held += data
        return True

    def _wait(self, writing: bool) -> None:
        """Until the process takes or gives something; what it says too early is kept, so that neither waits for the other."""
        readable, _, _ = select.select([self._from], [self._to] if writing else [], [], POLL_S)
        if readable and writing:
            self._take()
        if len(self._held) > MAX_MESSAGE_BYTES:
            raise MethodError(f"it sent more than {MAX_MESSAGE_BYTES >> 20} MiB without being asked")
        now_s = time.monotonic()
        if now_s - self._looked_s > LOOK_S or self._process.left_s <= 0.0:
            self._looked_s = now_s
            self._process.poll()
            if (cause := self._process.failure()) is not None:
                raise self._process.error(cause + (self._why_silent() if cause.startswith("hung") else ""))
            if now_s - self._asked_s > LOOK_S and self._is_closed(writing) and not self._take():  # perhaps its last words
                self._gone()

    def _why_silent(self) -> str:
        """What may be the matter with a process that hung: most forget to give out what they have written."""
        cure = "does it answer each message, and flush its output after each answer?"
        return "" if self._unread() > 0 else f"; it had read all that it was sent, and was waiting: {cure}"

    def _unread(self) -> int:
        """Bytes that it was sent and has not read."""
        return int(struct.unpack("i", fcntl.ioctl(self._to, termios.FIONREAD, bytes(4)))[0])

    def _is_closed(self, writing: bool) -> bool:
        """Whether the process closed a pipe that it still needs: for its answer, or for what it has not read yet."""
        answers = not writing and self._process.has_let_go(self._from)
        return answers or ((writing or self._unread() > 0) and self._process.has_let_go(self._to))

    def _message(self) -> bytes | None:
        """The next whole message that has arrived."""
        length = shift = place = 0
        while True:
            if place == len(self._held):
                return None
            byte = self._held[place]
            length |= (byte & 0x7F) << shift
            place, shift = place + 1, shift + 7
            if byte < 0x80:
                break
            if shift > 28:
                raise MethodError("it sent what is no length of a message: are its messages preceded by theirs, as a varint?")
        if length > MAX_MESSAGE_BYTES:
            raise MethodError(f"it sent a message of {length} bytes, the limit is {MAX_MESSAGE_BYTES}")
        if length > 0 and len(self._held) > place and self._held[place] not in TAGS:
            raise no_message(self._held)  # said at once: the rest of what is taken for a message may never come
        if len(self._held) < place + length:
            return None
        body = bytes(self._held[place : place + length])
        del self._held[: place + length]
        return body

    def _gone(self) -> None:
        """The process has closed a pipe. Raises MethodError that says how it ended."""
        end_s = time.monotonic() + 2.0
        while not self._process.poll() and time.monotonic() < end_s:
            time.sleep(POLL_S / 10.0)
        if (cause := self._process.failure()) is None and self._process.status is None:
            cause = f"it closed its standard input or output, and went on; its last words: {last_words(self._process.log)}"
        raise self._process.error(cause or f"it ended before the drive did; its last words: {last_words(self._process.log)}")


def no_message(data: bytes | bytearray) -> MethodError:
    """What is to be said of bytes on standard output that are no message; text there is what a program prints."""
    start = bytes(data[:QUOTED]).decode(errors="replace").lstrip()
    text = "".join(takewhile(lambda letter: letter.isprintable() and letter != REPLACED, start)).strip()
    if len(text) > 1:
        what = f"it wrote '{text}' on its standard output, which is no message of proto/method_stream.proto"
        return MethodError(f"{what}: standard output is for messages alone; print on standard error")
    return MethodError(f"it sent {len(data)} bytes that are no message of proto/method_stream.proto")


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    found.append(value)
    return bytes(found)


def camera_message(camera: CameraSpec) -> pb.Camera:
    """A camera as a program is told of it."""
    return pb.Camera(
        width=camera.width,
        height=camera.height,
        focal_px=camera.focal_px(),
        rate_hz=camera.rate_hz,
        ahead_of_rear_axle_m=camera.forward_m,
        height_m=camera.height_m,
        baseline_m=camera.stereo_baseline_m or 0.0,
    )


def _begin(phase: pb.Begin.Phase, given: Given, folder: Path) -> pb.Begin:
    message = pb.Begin(
        version=VERSION,
        phase=phase,
        camera=camera_message(given.camera),
        rate_hz=given.rate_hz,
        seed=given.seed,
        folder=str(folder),
    )
    if given.metres_per_unit is not None:
        message.metres_per_unit = given.metres_per_unit
    if given.start is not None:
        message.start.CopyFrom(pb.Pose(x=given.start.x_m, y=given.start.y_m, heading_rad=given.start.heading_rad))
    if given.roads is not None:
        message.lanes.extend(_lanes(given.roads))
    return message


def _lanes(roads: RoadNetwork) -> Iterator[pb.Lane]:
    for lane in range(roads.lane_count):
        points_m = roads.lane_points_m(lane)
        yield pb.Lane(x_m=points_m[:, 0].tolist(), y_m=points_m[:, 1].tolist())


def _observation(one: Observation) -> pb.Observation:
    message = observation_message(one)
    if isinstance(one, StereoObservation) and one.frame is not None and one.right is not None:
        message.right_pixels = one.right.tobytes()
    return message


def _pose(pose: pb.Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.heading_rad


def answer_of(t_s: float, answer: pb.Answer) -> Answer:
    """An answer of the stream as one of the protocol. Raises MethodError if it is none."""
    if (count := len(answer.covariance)) not in (0, 9):
        raise MethodError(f"its answer at t_s={t_s:g} has a covariance of {count} numbers; 9 are expected, or none")
    covariance = np.array(answer.covariance).reshape(3, 3) if answer.covariance else None
    return Answer(t_s, *_pose(answer.pose), localized=answer.known, covariance=covariance)
