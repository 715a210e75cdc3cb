"""Methods as text, for the modules that the tests of the contest write, and the row of one of them."""

from pathlib import Path

from hippodrome.eval.contest.entry import entries_of, parse_method, with_methods
from hippodrome.eval.contest.perform import perform

EXAMPLE = Path(__file__).parents[3] / "examples/methods/integrate.py"
MAPPER = "import math" + EXAMPLE.read_text().partition("import math")[2].replace("class Integrator", "class Mapper")
ENTRANTS = f"""\
import os, sys, time
from dataclasses import replace
import numpy as np
from pydantic import BaseModel
from hippodrome.core.types import Trajectory
from hippodrome.eval.methods.protocol import Answer, Mapped, Needs
{MAPPER}
class Configured(Mapper):
    class Config(BaseModel):
        factor: float = 1.0
    def __init__(self, config):
        self.factor = config.factor

class Asking(Mapper):
    needs = Needs(camera=False, road_network=True, start_pose=True)
    def map(self, observations, given):
        assert given.roads == "the roads" and given.start.x_m < 1.0
        observations = list(observations)
        assert all(one.frame is None for one in observations)
        return Mapper.map(self, observations, given)

class Blind(Mapper):
    def map(self, observations, given):
        assert given.roads is None and given.start is None
        return super().map(observations, given)

class Localizer(Mapper):
    frame = "network"
    def localize(self, observations, given):
        for one, pose in zip(observations, given.mapped.trajectory.poses):
            yield Answer(one.t_s, *pose, localized=one.t_s > 5.0)

class Silent(Mapper):
    frame = "network"
    def localize(self, observations, given):
        return []

class Crash:
    def map(self, observations, given):
        raise ValueError("wrong thing")

class Leaves:
    def map(self, observations, given):
        raise SystemExit(3)

class Nan:
    def map(self, observations, given):
        return ((one.t_s, math.nan, 0.0, 0.0) for one in observations)

class Backwards:
    def map(self, observations, given):
        return [(-one.t_s, 0.0, 0.0, 0.0) for one in observations]

class Nothing:
    def map(self, observations, given):
        return None

class Words:
    def map(self, observations, given):
        return ["a", "b"]

class Odd(Mapper):  # what comes of it is found out when it is scored, not before
    def map(self, observations, given):
        poses = np.array(list(super().map(observations, given)))
        return Mapped(Trajectory(poses[:, 0], poses[:, 1:]), figures=dict(ape="good"))

class Saves(Mapper):
    def map(self, observations, given):
        poses = np.array(list(super().map(observations, given)))
        self.text = "a map"
        return Mapped(Trajectory(poses[:, 0], poses[:, 1:]), save=lambda path: path.write_text(self.text))

class SavesNot(Saves):
    def map(self, observations, given):
        return replace(super().map(observations, given), save=lambda path: 1 / 0)

class Reads(Mapper):  # standard input, which is not its own
    def map(self, observations, given):
        sys.stdin.read()
        return super().map(observations, given)

class Asks(Mapper):
    def map(self, observations, given):
        input("which way?")

class Scribbles(Mapper):
    def map(self, observations, given):
        for number in range(3, 30):
            try:
                os.write(number, bytes([255]) * 1000)
            except OSError:
                pass
        return super().map(observations, given)

class Speechless:
    def map(self, observations, given):
        class Silence(Exception):
            def __str__(self):
                raise ValueError
        raise Silence

class Gibberish:
    def map(self, observations, given):
        raise ValueError("\\udcff\\x1b[31m")

class Remembers(Mapper):  # its state is of a class of its own
    frame = "network"
    def map(self, observations, given):
        poses = np.array(list(super().map(observations, given)))
        return Mapped(Trajectory(poses[:, 0], poses[:, 1:]), state=Memory(poses))
    def localize(self, observations, given):
        for one, pose in zip(observations, given.mapped.state.poses):
            yield Answer(one.t_s, *pose[1:])

class OnRemembers(Remembers):
    builds_on = "first"
    def map(self, observations, given):
        assert type(given.base.state).__name__ == "Memory"
        return given.base

class Memory:
    def __init__(self, poses):
        self.poses = poses

class Strange(Mapper):
    def map(self, observations, given):
        return Mapped(Trajectory(np.zeros(1), np.zeros((1, 3))), figures=dict(mine=Memory(1)))

class Lambda(Mapper):
    def map(self, observations, given):
        return Mapped(Trajectory(np.zeros(1), np.zeros((1, 3))), figures=dict(mine=lambda: 1))

class Daemon(Mapper):
    def map(self, observations, given):
        if os.fork() == 0:
            os.setsid()
            time.sleep(1000.0 + given.seed)
        (given.folder.parent / "forked").touch()
        return super().map(observations, given)

class Half(Mapper):
    def map(self, observations, given):
        return list(super().map(observations, given))[:350]

class Little(Mapper):
    def map(self, observations, given):
        return list(super().map(observations, given))[:50]

class Empty: ...

class Endless:
    def map(self, observations, given):
        while True:
            pass

class Sleeps:
    needs = Needs(camera=False)
    def describe(self, frame):
        import time
        time.sleep(1000.0)

class Hungry:
    def map(self, observations, given):
        return [np.ones(100_000_000) for _ in range(300)]

class Fills(Mapper):
    def map(self, observations, given):
        for number, _ in enumerate(observations):
            (given.folder / str(number)).write_bytes(bytes(1_000_000))
            time.sleep(0.05)

class FillsTemporary(Mapper):
    def map(self, observations, given):
        import tempfile
        held = [tempfile.TemporaryFile() for _ in range(10)]
        for one in held:
            one.write(bytes(5_000_000))
            one.flush()
        time.sleep(60.0)

class Aborts:
    def map(self, observations, given):
        import os
        os.abort()

class Prints(Mapper):
    def __init__(self):
        self.lock = __import__("threading").Lock()  # cannot be pickled
    def map(self, observations, given):
        print("a line on standard output")
        return super().map(observations, given)
    def localize(self, observations, given):
        with self.lock:
            for one in observations:
                yield Answer(one.t_s, 0.0, 0.0, 0.0)
"""


def row_of(materials, name, scenario=None):
    """The row of a class of ``ENTRANTS``, run alone."""
    entry = entries_of(with_methods(scenario or materials.scenario, [parse_method(f"mine=entrants:{name}")]))[-1]
    return perform(materials, [entry]).rows[0]
