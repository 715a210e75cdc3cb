"""Compile and load the inner loops before anything is timed: ``python -m hippodrome.eval.methods.warm_up`` (``make setup``).

Numba compiles a function at its first call and keeps the machine code beside the sources. A drive of about a minute through a
very small town, with noise for camera frames, calls every compiled function once; what it computes is thrown away.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from hippodrome._folders import temporary_folder
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import HippodromeError, Observation, StartPose
from hippodrome.eval.methods.stages import localize_recording, map_recording
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.self_motion import NOISE_LEVELS, sense_self_motion
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

TOWN = TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9)
RATE_HZ = 5.0  # of observations


@cache
def warm_up() -> None:
    """Run the whole chain on a small drive, once per process."""
    with temporary_folder() as folder:
        town = build_town(TOWN, 1, folder)
        drive = simulate_drive(town, TourSpec(length_m=700.0), TrafficSpec(vehicles=0), EgoSpec(), 1)
    start = StartPose(*(float(value) for value in drive.poses_m[0]))
    motion = sense_self_motion(drive, RATE_HZ, NOISE_LEVELS["paper"], np.random.default_rng(1))

    def observations() -> Iterator[Observation]:
        rng = np.random.default_rng(2)
        for t_s, speed, yaw_rate in zip(motion.t_s, motion.speed, motion.yaw_rate_radps, strict=True):
            frame = rng.integers(0, 256, (120, 160, 3), dtype=np.uint8)
            yield Observation(float(t_s), motion.dt_s, float(speed), float(yaw_rate), frame)

    cognitive_map, _ = map_recording(observations(), Mapper(MapperConfig()))
    for mode in ("route", "paper"):
        try:
            refinement = refine(cognitive_map, town.network, RefineConfig(mode=mode), start)
        except HippodromeError:
            continue  # a refinement that refuses the map has called its functions all the same
        localize_recording(observations(), Localizer(refinement.cognitive_map, town.network, LocalizerConfig()))


if __name__ == "__main__":
    warm_up()
