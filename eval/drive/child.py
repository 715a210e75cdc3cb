"""The process of a Python policy: ``python -m hippodrome.eval.drive.child MODULE:OBJECT``, fed over the stream.

It knows nothing of the simulator: what is sensed comes in, commands go out. An object is taken for what it can do:
``step(observation, radar)`` answers with a ``Command``, as the navigator does; ``predict(observed)`` and a call answer with an
action of Gymnasium.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from google.protobuf.proto import parse_length_prefixed, serialize_length_prefixed

from hippodrome.core.navigation.spaces import command_of, observed
from hippodrome.core.navigation.types import Command, Radar
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, HippodromeError, Observation
from hippodrome.eval.programs.references import object_of
from hippodrome.proto import method_stream_pb2 as pb
from hippodrome.proto.codec import load_map
from hippodrome.proto.driving import command_message, goal_of, network_of, observation_of, radar_of

Step: TypeAlias = Callable[[Observation, Radar], Command]
KINDS = "a class or an object with step(observation, radar), predict(observed), or that is called with what is observed"


def load(reference: str) -> Any:
    """The policy of ``module:Object``; the working directory is searched as well. Raises HippodromeError."""
    found = object_of(reference)
    if not (hasattr(found, "step") or hasattr(found, "predict") or callable(found)):
        raise HippodromeError(f"{reference} is a {type(found).__name__}; a policy is {KINDS}")
    if isinstance(found, type) and not any(name in dir(found) for name in ("step", "predict", "__call__")):
        raise HippodromeError(f"{reference} is a class without step, predict and __call__; a policy is {KINDS}")
    return found


def made(found: Any, cognitive_map: CognitiveMap, roads: RoadNetwork) -> Any:
    """The policy itself: a class is called with map and network if it takes them, and else with nothing."""
    if not isinstance(found, type):
        return found
    try:
        inspect.signature(found).bind(cognitive_map, roads)
    except (TypeError, ValueError):
        return found()
    return found(cognitive_map, roads)


def stepper(policy: Any) -> Step:
    """How the policy answers a step."""
    if hasattr(policy, "step"):
        step: Step = policy.step
        return step
    act = (lambda seen: policy.predict(seen)[0]) if hasattr(policy, "predict") else policy
    last: list[Any] = []  # the last frame

    def from_action(observation: Observation, radar: Radar) -> Command:
        if observation.frame is not None:
            last[:] = [observation.frame]
        frame = last[0] if last else np.zeros((1, 1, 3), dtype=np.uint8)
        return command_of(act(observed(observation, radar, frame)))

    return from_action


def serve(reference: str, source: Any, sink: Any) -> None:
    """Answer the harness over two binary streams until it says that the mission is over."""
    step: Step | None = None
    while (message := parse_length_prefixed(pb.ToMethod, source)) is not None:
        kind = message.WhichOneof("message")
        if kind == "begin":
            begin = message.begin
            roads = network_of(begin.lanes, begin.survey_sigma_m)
            policy = made(load(reference), load_map(begin.map)[0], roads)
            if hasattr(policy, "set_goal"):
                policy.set_goal(goal_of(begin.goal))
            step = stepper(policy)
            answer = pb.FromMethod(ready=pb.Ready(version=begin.version))
        elif kind == "observation" and step is not None:
            command = step(observation_of(message.observation), radar_of(message.observation.radar))
            answer = pb.FromMethod(command=command_message(command))
        else:
            answer = pb.FromMethod(finished=pb.Finished())
        serialize_length_prefixed(answer, sink)
        sink.flush()


def main() -> int:
    """Serve, or with ``--check`` only say whether there is such a policy."""
    reference, *options = sys.argv[1:]
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a policy that prints does not break the messages
    try:
        if options:
            load(reference)
        else:
            serve(reference, source, sink)
    except HippodromeError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:  # the harness has gone
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
