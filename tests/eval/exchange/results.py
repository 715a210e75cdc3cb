"""A small run on disk, as ``hippodrome eval`` leaves it: two recordings, a town, trajectories and maps."""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from hippodrome._files import sha256_of
from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.cli import main
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.proto.codec import save_map
from hippodrome.sim.array_file import write_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import Recording, chunk_path, seal, write_chunk
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from tests.proto.maps import random_map

STEPS, RATE_HZ = 60, 10.0
CAMERA = CameraSpec(width=32, height=24, fov_deg=80.0, rate_hz=5.0, forward_m=1.5, height_m=1.2, stereo_baseline_m=0.4)


@dataclass(frozen=True)
class Run:
    """Where everything lies."""

    root: Path
    mapping: Recording
    localization: Recording

    @property
    def scenario(self) -> Path:
        return self.root / "hamlet"


def make_run(root: Path) -> Run:
    town = build_town(TownSpec(kind="grid", width_m=150, height_m=150, road_km=0.8), 1, root / "towns")
    recordings = {
        role: _recording(root, role, seed, sha256_of(town.net_file)) for seed, role in enumerate(("mapping", "localization"))
    }
    folder = root / "hamlet"
    rng = np.random.default_rng(5)
    for role, recording in recordings.items():
        truth = recording.ground_truth()
        suffix = "" if role == "mapping" else "-localization"
        write_tum(folder / ("ground-truth.tum" if role == "mapping" else "localization-ground-truth.tum"), truth)
        noisy = truth.poses[5:50:3] + rng.normal(0.0, 0.3, (15, 3))
        write_tum(folder / f"topometric{suffix}.tum", Trajectory(truth.t_s[5:50:3], noisy))
    own = se2.between(truth.poses[0], truth.poses[5:50:3]) * [0.5, 0.5, 1.0]
    write_tum(folder / "semi-metric.tum", Trajectory(truth.t_s[5:50:3], own))
    save_map(folder / "semi-metric.pbstream", random_map(vertices=12, edges=20), {})
    save_map(folder / "topometric-default.pbstream", random_map(seed=1, vertices=12, edges=20, refined=True), {})
    return Run(root, recordings["mapping"], recordings["localization"])


def _recording(root: Path, role: str, seed: int, network_sha256: str) -> Recording:
    folder, rng = root / "recordings" / f"hamlet-{role}-0123", np.random.default_rng(seed)
    folder.mkdir(parents=True)
    speed, turn = rng.uniform(3.0, 9.0, STEPS), rng.normal(0.0, 0.4, STEPS)
    motions = np.column_stack([speed / RATE_HZ, np.zeros(STEPS), turn / RATE_HZ])
    frame = np.where(np.arange(STEPS) % 2 == 1, np.arange(STEPS) // 2, -1).astype(np.int32)
    samples = Samples(
        t_s=np.arange(1, STEPS + 1) / RATE_HZ,
        dt_s=np.full(STEPS, 1.0 / RATE_HZ),
        speed=0.5 * speed,
        yaw_rate_radps=turn,
        frame=frame,
        poses_m=se2.integrate(np.array([120.5, 40.25, 2.0]), motions),
        speed_mps=speed,
        lane=np.zeros(STEPS, np.int32),
        lane_position_m=np.zeros(STEPS),
        lane_ids=("a_0",),
    )
    write_arrays(folder / "samples.npz", {field.name: np.asarray(getattr(samples, field.name)) for field in fields(Samples)})
    write_arrays(folder / "drive.npz", {"nothing": np.zeros(1)})
    pairs = (
        (rng.integers(0, 256, (24, 32, 3), dtype=np.uint8), rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)) for _ in range(30)
    )
    write_chunk(chunk_path(folder, 0), 0, pairs)
    return seal(folder, {"camera": CAMERA.model_dump(mode="json"), "network_sha256": network_sha256}, samples)


def imported(source, kind, out, *options):
    """The exit status of ``hippodrome import``."""
    return main(["import", str(source), "--from", kind, "--out", str(out), *map(str, options)])
