"""A method alone in its process, as ORB-SLAM3 is: observations come through a pipe, and no simulator is loaded.

    python -m hippodrome.eval.rivals.lean < JOB AND OBSERVATIONS

Standard input: a pickled ``Job``, then pickled observations until the end. Prints the most memory [bytes] that the process held.
"""

from __future__ import annotations

import pickle
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import StartPose
from hippodrome.eval.rivals.ablation import MapperWithoutAttractor
from hippodrome.eval.rivals.ratslam.system import RatSlam, RatSlamConfig

Kind = Literal["mapper", "no attractor", "RatSLAM"]


@dataclass(frozen=True, slots=True)
class Job:
    """What to build of the observations, and how to refine it, if at all."""

    kind: Kind
    config: MapperConfig
    refine: tuple[RoadNetwork, RefineConfig, StartPose | None] | None = None


def main() -> None:
    """Run the job on all observations of standard input and print the most memory [bytes] that the process held."""
    stream = sys.stdin.buffer
    job: Job = pickle.load(stream)
    builder = _builder(job)
    while True:
        try:
            builder.step(pickle.load(stream))
        except EOFError:
            break
    finished = builder.finish()
    if job.refine is not None and not isinstance(builder, RatSlam):
        refine(finished, *job.refine)  # type: ignore[arg-type]
    status = Path("/proc/self/status").read_text()
    print(1024 * int(status.split("VmHWM:")[1].split()[0]))


def _builder(job: Job) -> Mapper | RatSlam:
    if job.kind == "RatSLAM":
        return RatSlam(RatSlamConfig())
    return Mapper(job.config) if job.kind == "mapper" else MapperWithoutAttractor(job.config)


if __name__ == "__main__":
    main()
