"""``gymnasium.make("hippodrome/Town-v0", scenario="towns/grid")``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.sim.loop.env import EnvOptions, TownEnv
from hippodrome.sim.scenario import Scenario


def town_env(
    scenario: str | Path | Scenario = "towns/grid", root: Path | str | None = None, render_mode: str | None = None, **options: Any
) -> TownEnv:
    """The environment of a scenario.

    Args:
        scenario: the file, the name of a scenario that comes with the package, or the scenario itself.
        root: folder below which generated towns are kept; by default one that goes with the process.
        render_mode: "rgb_array", or None for no pictures.
        options: of ``EnvOptions``.

    Raises:
        HippodromeError: the scenario cannot be used.
    """
    found = scenario if isinstance(scenario, Scenario) else read_scenario(Path(scenario))
    return TownEnv(found, None if root is None else Path(root), render_mode, EnvOptions(**options))
