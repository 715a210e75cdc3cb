"""The vocabulary for ORB-SLAM3: trained on frames of other generated towns, made once and kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.types import Frame
from hippodrome.eval.rivals.orbslam3.vocabulary import (
    BRANCHING,
    DEPTH,
    orb_descriptors,
    to_text,
    train,
)
from hippodrome.sim.record import RecordingPlan, record
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec

KINDS: Final[tuple[Literal["grid", "radial", "random", "rural"], ...]] = ("grid", "radial", "random", "rural")
FIRST_SEED: Final = 770_001  # of the training towns; scenarios use small seeds, and a town with the scenario's seed is left out
FRAME_RATE_HZ: Final = 1.0  # gives a frame every 5 to 10 m, so that neighbours share few corners
DRIVE_M: Final = 900.0  # gives about 150 frames per town


@dataclass(frozen=True, slots=True)
class VocabularyTask:
    """Train a vocabulary for a camera, unless it is on disk already."""

    camera: CameraSpec
    scenario_seed: int  # a town with this seed is not looked at
    root: Path  # the vocabulary and its training frames live below ``root/vocabulary``

    @property
    def path(self) -> Path:
        """The vocabulary's file."""
        size = f"{self.camera.width}x{self.camera.height}-{self.camera.fov_deg:g}deg{'-grain' if self.camera.grain else ''}"
        return self.root / "vocabulary" / f"orb-k{BRANCHING}-L{DEPTH}-{size}.txt"  # the tracker reads text by the suffix


def train_vocabulary(task: VocabularyTask) -> Path:
    """Train the vocabulary if it is not on disk; returns its file."""
    if not task.path.exists():
        descriptors, image = orb_descriptors(_training_frames(task))
        task.path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(task.path, to_text(train(descriptors, image, np.random.default_rng(FIRST_SEED))).encode())
    return task.path


def _training_frames(task: VocabularyTask) -> Iterator[Frame]:
    camera = task.camera.model_copy(update={"rate_hz": FRAME_RATE_HZ, "stereo_baseline_m": None})
    for number, kind in enumerate(KINDS):
        seed = FIRST_SEED + number
        if seed == task.scenario_seed:
            continue
        scenario = Scenario(
            name=f"words-{kind}",
            seed=seed,
            town=TownSpec(kind=kind, width_m=260.0, height_m=260.0, road_km=1.8),
            camera=camera,
            mapping=DriveSpec(tour=TourSpec(length_m=DRIVE_M), traffic=TrafficSpec(vehicles=4)),
        )
        recording = record(RecordingPlan(scenario, "mapping", task.root / "vocabulary"))
        yield from (recording.frame(i) for i in range(recording.frame_count))
