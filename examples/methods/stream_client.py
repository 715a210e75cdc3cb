"""A method that is fed frame by frame, in Python: dead reckoning over the stream of ``proto/method_stream.proto``.

hippodrome eval scenarios/towns/grid.yaml --method "mine=stream:python examples/methods/stream_client.py"
"""

import math
import sys

from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed

from hippodrome.proto.method_stream_pb2 import Answer, Finished, FromMethod, Pose, Ready, ToMethod


def answer(message):
    """Send one message and give the turn back."""
    serialize_length_prefixed(message, sys.stdout.buffer)
    sys.stdout.buffer.flush()


x = y = heading = 0.0
while (message := parse_length_prefixed(ToMethod, sys.stdin.buffer)) is not None:
    kind = message.WhichOneof("message")
    if kind == "begin":
        answer(FromMethod(ready=Ready(version=message.begin.version)))
    elif kind == "observation":
        one = message.observation  # one.pixels holds the frame, if there is one
        heading += one.yaw_rate_radps * one.dt_s
        x += one.speed * one.dt_s * math.cos(heading)
        y += one.speed * one.dt_s * math.sin(heading)
        answer(FromMethod(answer=Answer(known=True, pose=Pose(x=x, y=y, heading_rad=heading))))
    else:
        answer(FromMethod(finished=Finished()))
