"""What a program said before it ended is heard, however busy the machine is."""

import os
from types import SimpleNamespace

import pytest

from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs import stream
from hippodrome.eval.programs.stream import Line
from hippodrome.proto import method_stream_pb2 as pb


class Ending:
    """A process that says its last message, and is gone, after the harness has looked for the message and before it looks for
    the process."""

    status, left_s, log = 0, 60.0, "log.txt"

    def __init__(self, last):
        take, self.given = os.pipe()
        self.said, say = os.pipe()
        self.popen = SimpleNamespace(stdin=os.fdopen(self.given, "wb"), stdout=os.fdopen(self.said, "rb"))
        self.take, self.say, self.last = take, say, last

    def poll(self):
        return False

    def failure(self):
        return None

    def error(self, cause):
        return MethodError(cause)

    def has_let_go(self, _):
        if self.last:
            os.write(self.say, self.last)
            os.close(self.say)
            self.last = b""
        return True


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr(stream, "LOOK_S", -1.0)
    monkeypatch.setattr(stream, "POLL_S", 0.01)


def test_a_last_message_that_comes_between_two_looks_is_heard():
    body = pb.FromMethod(finished=pb.Finished()).SerializeToString()
    line = Line(Ending(bytes([len(body)]) + body))
    assert line.asked(pb.ToMethod(end=pb.End()), "finished").WhichOneof("message") == "finished"


def test_half_a_message_is_none():
    body = pb.FromMethod(finished=pb.Finished()).SerializeToString()
    with pytest.raises(MethodError, match="it ended before the drive did"):
        Line(Ending(b"\x05" + body[:1])).asked(pb.ToMethod(end=pb.End()), "finished")
