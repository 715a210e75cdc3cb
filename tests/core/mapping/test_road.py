"""What the mapper keeps of the road that it reads, and how it learns how long a unit is."""

import numpy as np
import pytest

from hippodrome.core.mapping.mapper import MapperConfig, map_drive
from hippodrome.core.mapping.road import ENOUGH, RoadLog
from hippodrome.core.types import PAINT_PLACES, Observation
from hippodrome.core.views.odometry import CameraGeometry
from tests.core.mapping.test_mapper import ring_drive


def test_a_map_keeps_a_reading_of_each_visit_and_is_the_same_otherwise():
    observations, _ = ring_drive(0.3)
    plain, read = (map_drive(observations, MapperConfig(road_reading=wanted)) for wanted in (False, True))
    assert plain.visits.lane is None
    assert len(read.visits.lane.offset_m) == len(read.visits.t_s)
    assert read.visits.lane.edge_percent.shape == (len(read.visits.t_s), 2)
    assert read.visits.lane.paint.shape == (len(read.visits.t_s), 2, PAINT_PLACES)
    for name in ("t_s", "poses", "view_cell"):
        assert getattr(plain, name).tobytes() == getattr(read, name).tobytes()
    assert plain.visits.motion.tobytes() == read.visits.motion.tobytes()


@pytest.mark.parametrize("units_per_m", [0.5, 3.0])
def test_passing_ground_tells_how_long_a_unit_is(units_per_m):
    rng = np.random.default_rng(0)
    ground = cv2_noise(rng)
    log = RoadLog(CameraGeometry())
    assert np.isnan(log.metres_per_unit)
    for k in range(3 * ENOUGH):
        log.move(Observation(0.1 * (k + 1), 0.1, 15.0 * units_per_m, 0.0, None))
        frame = seen_from(ground, 1.5 * k)
        log.read(frame, 1.5 * units_per_m, 0.0)
        log.see(frame)
    assert log.metres_per_unit * units_per_m == pytest.approx(1.0, rel=0.05)


def cv2_noise(rng):
    """Patches of asphalt (N, 60) of a square metre each fifth, from above."""
    return np.kron(rng.integers(60, 160, (400, 24)), np.ones((5, 5))).astype(np.uint8)


def seen_from(ground, at_m, size=(120, 160), per_m=5):
    """A frame of the ground, a camera's height above it, ``at_m`` along it."""
    camera = CameraGeometry()
    height, width = size
    focal = camera.focal_px(width)
    row, column = np.mgrid[:height, :width]
    depth = focal * camera.height_m / np.maximum(row - 0.5 * (height - 1), 1e-3)
    y = -(column - 0.5 * (width - 1)) * depth / focal
    x = at_m + camera.forward_m + depth
    inside = (row > 0.5 * height + 2) & (depth < 40.0)
    u, v = np.clip((x * per_m).astype(int), 0, len(ground) - 1), np.clip(((y + 12.0) * per_m).astype(int), 0, ground.shape[1] - 1)
    return np.where(inside, ground[u, v], 200).astype(np.uint8)
