"""Compile and load the inner loops before anything is timed: ``python -m hippodrome.eval.methods.warm_up`` (``make setup``).

Numba compiles a function at its first call and keeps the machine code beside the sources. A drive of about a minute through a
very small town calls every compiled function of mapping, refinement and localization once; what it computes is thrown away. Its
camera frames are noise above a painted road, as the lines of a road have to be seen for the reader's functions to be called.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final, get_args

import numpy as np

from hippodrome._folders import temporary_folder
from hippodrome.core.localization.beliefs.config import Mode
from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.matching.search import beam
from hippodrome.core.reading.ground import ground_of
from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import Frame, HippodromeError, Observation, StartPose
from hippodrome.core.views.config import CameraGeometry
from hippodrome.eval.methods.stages import localize_recording, map_recording
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.self_motion import NOISE_LEVELS, sense_self_motion
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

TOWN: Final = TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9)
RATE_HZ: Final = 5.0  # of observations
SIZE_PX: Final = (160, 120)
LINES_M: Final = (-1.5, 1.5, 4.5)  # to the left, of a street's two lanes
LINE_M: Final = 0.12
BARS_M: Final = (4.0, 12.0)  # where the line at the lane's end lies, from the nearest to the farthest
BAR_M: Final = 0.5
PAINT, ASPHALT = np.uint8(225), np.uint8(96)
READING_MODES: Final = ("coupled", "kalman")  # of the localizer, in which it can read the road
SHORT_SHARE: Final = 0.2  # of the drive, for the localizer's other modes, which share most functions with "coupled"


@cache
def warm_up() -> None:
    """Run the whole chain on a small drive, once per process."""
    with temporary_folder() as folder:
        town = build_town(TOWN, 1, folder)
        drive = simulate_drive(town, TourSpec(length_m=700.0), TrafficSpec(vehicles=0), EgoSpec(), 1)
    start = StartPose(*(float(value) for value in drive.poses_m[0]))
    motion = sense_self_motion(drive, RATE_HZ, NOISE_LEVELS["paper"], np.random.default_rng(1))

    observed = [
        Observation(float(t_s), motion.dt_s, float(speed), float(yaw_rate), frame)
        for t_s, speed, yaw_rate, frame in zip(motion.t_s, motion.speed, motion.yaw_rate_radps, _frames(), strict=False)
    ]
    cognitive_map, _ = map_recording(observed, Mapper(MapperConfig(road_reading=True)))
    for refinement_mode in ("paper", "route"):
        try:
            refinement = refine(cognitive_map, town.network, RefineConfig(mode=refinement_mode), start)
        except HippodromeError:
            continue  # a refinement that refuses the map has called its functions all the same
    for mode in get_args(Mode):
        localizer = LocalizerConfig(mode=mode, road_reading=mode in READING_MODES)
        share = 1.0 if mode == "coupled" else SHORT_SHARE
        localize_recording(observed[: round(share * len(observed))], Localizer(refinement.cognitive_map, town.network, localizer))


def is_compiled() -> bool:
    """Whether machine code of the route search, the largest of the inner loops, is kept and newer than its source."""
    source = Path(str(beam.__file__))
    kept = Path(str(beam._forward.stats.cache_path)).glob(f"{source.stem}._forward-*.nbi")
    return max((index.stat().st_mtime for index in kept), default=0.0) > source.stat().st_mtime


def _frames() -> Iterator[Frame]:
    """Noise above a road of two lanes, seen from the middle of the right one; there is a line across it in every other frame."""
    rng = np.random.default_rng(2)
    ground = ground_of(CameraGeometry().on_road(*SIZE_PX), SIZE_PX, far_m=40.0, raised_m=0.0)
    along = np.any(np.abs(ground.y_m[..., None] - np.array(LINES_M)) < 0.5 * LINE_M, axis=-1)
    in_lane = np.abs(ground.y_m) < LINES_M[1]
    while True:
        frame = rng.integers(0, 256, (SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8)
        across = in_lane & (np.abs(ground.x_m - rng.uniform(*BARS_M)) < 0.5 * BAR_M) & (rng.random() < 0.5)
        frame[ground.rows] = np.where(across | along, PAINT, ASPHALT)[..., None]
        yield frame


if __name__ == "__main__":
    warm_up()
