"""A driver that is fed step by step, in Python: it keeps to the lane's right-hand line, over ``proto/method_stream.proto``.

hippodrome drive scenarios/missions/rural.yaml --missions 1 --policy "keeper=exec:python examples/loop/drive_client.py"
"""

import sys

import numpy as np
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed

from hippodrome.proto.method_stream_pb2 import Command, Finished, FromMethod, Ready, ToMethod

LINE_M, AHEAD_M = 1.4, 6.0  # from the lane's middle to its right-hand line, which is looked at so far ahead
CRUISE = 1.6  # map units per second, some 3 m/s
RED, YELLOW = 3, 2


def answer(message):
    """Send one message and give the turn back."""
    serialize_length_prefixed(message, sys.stdout.buffer)
    sys.stdout.buffer.flush()


def off_m(frame, camera_m):
    """How far the vehicle is left of the lane's middle, by the white line on the right; 0 where none is seen."""
    height, width, _ = frame.shape
    places = []
    for below in range(14, 30):  # rows below the horizon: 8 to 4 metres ahead on a flat road
        white = frame[height // 2 + below, width // 2 :].min(axis=1) > 165
        if white.any():
            places.append((int(np.argmax(white)) + 0.5) * camera_m / below)
    places = [place for place in places if 0.3 < place < 3.0]
    return float(np.median(places)) - LINE_M if len(places) > 3 else 0.0


steering, camera_m = 0.0, 1.4
while (message := parse_length_prefixed(ToMethod, sys.stdin.buffer)) is not None:
    kind = message.WhichOneof("message")
    if kind == "begin":  # message.begin has goal, map and lanes
        camera_m = message.begin.camera.height_m
        answer(FromMethod(ready=Ready(version=message.begin.version)))
    elif kind == "observation":
        one = message.observation
        if one.width:
            frame = np.frombuffer(one.pixels, np.uint8).reshape(one.height, one.width, one.channels)
            steering = 2.7 * 2.0 * -off_m(frame, camera_m) / AHEAD_M**2
        waits = one.radar.gap_m < 8.0 or one.radar.lamp in (RED, YELLOW) or one.radar.blind
        acceleration = -3.0 if waits else min(max(2.0 * (CRUISE - one.speed), -1.0), 1.0)
        command = Command(acceleration_mps2=acceleration, steering_rad=steering, state=Command.SEARCHING)
        command.reason = "keeps its lane" if not waits else "waits"
        answer(FromMethod(command=command))
    else:
        answer(FromMethod(finished=Finished()))
