"""The stream: what it costs to feed a program frame by frame instead of calling a class, at 160 x 120 pixels.

The program is ``examples/methods/stream_client.cpp`` where there is a C++ compiler, else its twin in Python; both do next to
nothing with a frame, so what is measured is the stream. CPU time, of our process and of the program's together.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.table import Row
from hippodrome.core.types import Observation
from hippodrome.eval.methods.protocol import Given
from hippodrome.eval.programs.stream import StreamMapper
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.scenario import Scenario

FRAMES = 3_000
EXAMPLES = Path(__file__).parent.parent / "examples/methods"


def run() -> list[Row]:
    """CPU per frame of our side of the stream, and of the client's."""
    with tempfile.TemporaryDirectory() as folder:
        command, language = _client(Path(folder))
        given = Given(camera=Scenario(name="bench").camera, rate_hz=10.0, duration_s=FRAMES / 10.0, seed=1, folder=Path(folder))
        observations = list(_observations())
        began = process_time()
        mapped = StreamMapper(MethodSpec(stream=command)).map(iter(observations), given)
        ours_s = process_time() - began
    assert mapped.cost is not None
    return [
        Row("stream", "our side", 1e3 * ours_s / FRAMES, "ms", "a frame of 160 x 120, handed over and answered"),
        Row("stream", f"client in {language}", 1e3 * mapped.cost.cpu_s / FRAMES, "ms", "the same, from its first frame on"),
    ]


def _client(folder: Path) -> tuple[str, str]:
    if shutil.which("g++") is None:
        return f"{sys.executable} {EXAMPLES / 'stream_client.py'}", "Python"
    built = folder / "stream_client"
    subprocess.run(["g++", "-O2", "-o", built, EXAMPLES / "stream_client.cpp"], check=True)
    return str(built), "C++"


def _observations() -> Iterator[Observation]:
    rng = np.random.default_rng(0)
    frames = [rng.integers(0, 256, (120, 160, 3), dtype=np.uint8) for _ in range(8)]
    for i in range(FRAMES):
        yield Observation(0.1 * (i + 1), 0.1, 5.0, 0.0, frames[i % len(frames)])
