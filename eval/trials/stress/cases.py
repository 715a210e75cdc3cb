"""What the refinement is stressed with: one thing that goes wrong per case."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NoiseLevel, SelfMotionNoise, at_level, noise_of
from hippodrome.sim.sumo_tools import run_tool
from hippodrome.sim.town import CONVERT_OPTIONS
from hippodrome.sim.town_spec import TownSpec

MISSING_ROADS: Final = 2  # driven streets that are taken out of the network, both directions of each
FOREIGN_SEED: Final = 1_000_003  # added to the scenario's seed: a town of the same kind, where the drive never was
# Crossings of the self-similar grid in each direction, and the way between two: as large as the other towns, all blocks alike.
GRID_CROSSINGS: Final = 4
GRID_BLOCK_M: Final = 80.0


@dataclass(frozen=True, slots=True)
class StressCase:
    """One thing that goes wrong."""

    name: str
    noise: NoiseLevel = "paper"  # level of the self-motion's errors
    false_closures: float = 0.0  # false loop closures added between random vertices, as a share of the map's own
    survey_error_m: float = 0.0  # standard deviation of the road network's displacement
    scale_jump: float = 0.0  # standard deviation of ln(scale) at each jump of the monocular scale
    gyro_bias_degps: float | None = None  # bias of the yaw rate; None: the level's
    missing_roads: int = 0  # driven streets that the road network lacks
    foreign: bool = False  # whether the road network is that of another town
    self_similar: bool = False  # whether the town is a grid of equal blocks, one a seed, whatever the scenario's town
    start_known: bool = False  # whether the first pose is given to the refinement

    @property
    def ours_alone(self) -> bool:
        """Whether it changes our own map, which other methods are not given, and nothing else."""
        return self.false_closures > 0.0 and self.name != "paper"

    def self_motion(self, noise: NoiseLevel | SelfMotionNoise = "paper") -> SelfMotionNoise:
        """The errors that the self-motion is sensed with, in the unit of the scenario's ``noise``."""
        level = noise_of(at_level(self.noise, noise))
        changed: dict[str, float] = {"scale_jump": max(self.scale_jump, level.scale_jump)}
        if self.gyro_bias_degps is not None:
            changed["gyro_bias_degps"] = self.gyro_bias_degps
        return level.model_copy(update=changed)


CASES = (
    StressCase("paper", false_closures=0.01),
    StressCase("no false closures"),
    StressCase("false closures 5 %", false_closures=0.05),
    StressCase("false closures 20 %", false_closures=0.20),
    StressCase("survey error 0.5 m", survey_error_m=0.5),
    StressCase("scale jumps 10 %", scale_jump=0.10),
    StressCase("drift x 3", gyro_bias_degps=0.15),
    StressCase("missing roads", missing_roads=MISSING_ROADS),
    StressCase("realistic", noise="realistic"),
    StressCase("harsh", noise="harsh"),
    StressCase("another town", foreign=True),
    StressCase("self-similar grid", self_similar=True),
    StressCase("self-similar grid, start given", self_similar=True, start_known=True),
)


def chosen_cases(names: Sequence[str]) -> tuple[StressCase, ...]:
    """The cases of these names, all of them if no name is given. Raises HippodromeError if there is no case of a name."""
    if unknown := set(names) - {case.name for case in CASES}:
        raise HippodromeError(f"no stress case '{sorted(unknown)[0]}'; there are: {', '.join(case.name for case in CASES)}")
    return tuple(case for case in CASES if not names or case.name in names)


def in_self_similar_grid(scenario: Scenario, root: Path) -> Scenario:
    """The scenario's drive and camera in a grid of equal blocks, whose network is made below ``root`` once."""
    file = root / "towns" / f"self-similar-{GRID_CROSSINGS}-{GRID_BLOCK_M:g}.net.xml"
    if not file.exists():
        part = file.with_suffix(".part.xml")
        part.parent.mkdir(parents=True, exist_ok=True)
        speed_mps = scenario.town.speed_limit_mps
        run_tool(
            "netgenerate", "--grid", f"--grid.number={GRID_CROSSINGS}", f"--grid.length={GRID_BLOCK_M}",
            f"--default.speed={speed_mps}", f"--output-file={part}", *CONVERT_OPTIONS,
        )  # fmt: skip
        without_date = re.sub(r"<!--.*?-->\s*", "", part.read_text(encoding="utf-8"), flags=re.DOTALL)
        write_atomically(file, without_date.encode())
        part.unlink()
    return scenario.model_copy(update={"name": "self-similar-grid", "town": TownSpec(network=file)})
