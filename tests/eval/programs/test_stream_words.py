"""What a program writes on the stream that is no message is told at once, in words that say what to do."""

import os
import time
from types import SimpleNamespace

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.programs.process import command_words
from hippodrome.eval.programs.stream import Line, no_message
from hippodrome.proto import method_stream_pb2 as pb

READY = pb.FromMethod(ready=pb.Ready(version=1)).SerializeToString()
BEGIN = pb.ToMethod(begin=pb.Begin(version=1))


class Ended(HippodromeError):
    """What the stand-in's error is."""


class Program:
    """A process of which there are the pipes alone, and which ends by its limit of time when it is looked at."""

    left_s, status = 0.0, None

    def __init__(self):
        (stdin, self.to), (self.source, stdout) = os.pipe(), os.pipe()
        self.sink, self.read = stdout, stdin
        self.popen = SimpleNamespace(stdin=os.fdopen(self.to, "wb", 0), stdout=os.fdopen(self.source, "rb", 0))

    def poll(self):
        return False

    def failure(self):
        return "hung: no end after 2 s, its limit"

    def error(self, cause):
        return Ended(cause)


@pytest.fixture
def program():
    one = Program()
    yield one
    for stream in (one.popen.stdin, one.popen.stdout):
        stream.close()
    for end in (one.sink, one.read):
        os.close(end)


def delimited(body):
    return bytes([len(body)]) + body


@pytest.mark.parametrize("text", ["Loading the vocabulary ...\n", "ok\n", "[info] ready\n", "{}\n", "Hello"])
def test_text_on_standard_output_is_told_at_once(program, text):
    os.write(program.sink, text.encode() + delimited(READY))
    began = time.monotonic()
    with pytest.raises(HippodromeError, match="standard output is for messages alone; print on standard error") as caught:
        Line(program).asked(BEGIN, "ready")
    assert text.strip()[:10] in str(caught.value)
    assert time.monotonic() - began < 5.0


def test_text_after_a_message_is_told_as_well(program):
    os.write(program.sink, delimited(READY) + b"step 1: lost\n")
    line = Line(program)
    assert line.asked(BEGIN, "ready").ready.version == 1
    with pytest.raises(HippodromeError, match="it wrote 'step 1: lost"):
        line.asked(BEGIN, "answer")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b"", "an empty message where 'ready' was expected"),
        (pb.FromMethod(finished=pb.Finished()).SerializeToString(), "answered with 'finished' where 'ready' was expected"),
        (b"\x0a\xff\xff", "3 bytes that are no message"),
    ],
)
def test_messages_that_are_none_are_told(program, body, words):
    os.write(program.sink, delimited(body))
    with pytest.raises(HippodromeError, match=words):
        Line(program).asked(BEGIN, "ready")


def test_who_has_read_all_and_answers_nothing_is_told_to_flush(program):
    line = Line(program)
    with pytest.raises(HippodromeError, match=r"hung: no end after 2 s, its limit$"):
        line.asked(BEGIN, "ready")  # it has not read it
    os.read(program.read, 1000)
    with pytest.raises(HippodromeError, match=r"had read all that it was sent, and was waiting: does it answer .* flush"):
        line._receive() or line._wait(writing=False)


def test_bytes_that_are_no_text_are_counted():
    assert "sent 3 bytes that are no message" in str(no_message(b"\x00\x01\xff"))


@pytest.mark.parametrize("command", ["./run {sequence} {out} > log", "a | b", "cd x && ./run", "./run 2>&1", "a ; b", "./run &"])
def test_what_only_a_shell_understands_is_told(command):
    with pytest.raises(HippodromeError, match="and no shell reads it; write it into a script, or use sh -c"):
        command_words(command)


def test_operators_within_words_are_left_to_the_program():
    assert command_words("sh -c 'cd x && ./run > log'") == ["sh", "-c", "cd x && ./run > log"]
