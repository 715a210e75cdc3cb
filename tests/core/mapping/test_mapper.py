"""The mapper on a ring road seen as crops of a panorama: it closes the loop, in any unit, from what it sees and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core.mapping.config import ExperienceMapConfig, MapperConfig, PlaceMemoryConfig
from hippodrome.core.mapping.mapper import Mapper, MappingError, map_drive
from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.types import EdgeKind, Observation
from hippodrome.core.views.config import ViewCellConfig

LAP_M, DT_S, PIXELS_PER_M = 500.0, 0.1, 5
CONFIG = MapperConfig()


def ring_panorama():
    rng, width = np.random.default_rng(3), int(LAP_M * PIXELS_PER_M)
    image = np.full((120, width), 200, dtype=np.uint8)
    x = 0
    while x < width:
        step = int(rng.integers(6, 30))
        image[int(rng.integers(20, 80)) : 90, x : x + step] = rng.integers(30, 230)
        x += step
    return np.concatenate([image, image[:, :200]], axis=1)


PANORAMA = ring_panorama()


def ring_drive(laps, units_per_m=0.5, look=None, stop_at_s=50.0):
    """Observations and the true way (N,) in metres; the vehicle stands for 10 s once."""
    way_m, observations, ways_m = 0.0, [], []
    while way_m < laps * LAP_M:
        t_s = DT_S * (len(observations) + 1)
        speed = 0.0 if stop_at_s < t_s < stop_at_s + 10 else 8.0 * (1 + 0.2 * np.sin(t_s / 7))
        way_m += speed * DT_S
        left = int(way_m % LAP_M * PIXELS_PER_M)
        frame = PANORAMA[:, left : left + 160] if look is None else look(len(observations))
        yaw_rate = 2 * np.pi * speed / LAP_M + 0.001
        observations.append(Observation(t_s, DT_S, speed * units_per_m, yaw_rate, frame))
        ways_m.append(way_m)
    return observations, np.array(ways_m)


@pytest.fixture(scope="module")
def drive():
    return ring_drive(2.5)


@pytest.fixture(scope="module")
def ring_map(drive):
    return map_drive(drive[0], CONFIG)


def closures_of(cognitive_map):
    closing = cognitive_map.edges.kind == EdgeKind.CLOSURE
    return cognitive_map.edges.source[closing], cognitive_map.edges.target[closing], cognitive_map.edges.motion[closing]


def way_of_vertices(cognitive_map, drive):
    observations, ways_m = drive
    return np.interp(cognitive_map.t_s, [o.t_s for o in observations], ways_m)


def test_second_laps_are_recognised_where_they_are(ring_map, drive):
    source, target, motion = closures_of(ring_map)
    way_m = way_of_vertices(ring_map, drive)
    ahead_m = way_m[target] - way_m[source]
    offset_m = ahead_m - LAP_M * np.round(ahead_m / LAP_M)
    assert (np.round(ahead_m / LAP_M) >= 1).all()
    assert np.abs(offset_m).max() < 5.0
    assert np.median(np.abs(motion[:, 0] / 0.5 - offset_m)) < 0.7
    revisits = np.count_nonzero(way_m > LAP_M)
    assert len(set(target.tolist())) > 0.85 * revisits


def test_a_recognised_visit_shares_the_view_cell_and_stays_a_vertex(ring_map):
    source, target, _ = closures_of(ring_map)
    assert_array_equal(ring_map.view_cell[target], ring_map.view_cell[source])
    assert len(ring_map.poses) == len(ring_map.t_s) == len(ring_map.visits.vertex) == len(ring_map.view_cell)
    assert len(ring_map.view_cells.templates) < 0.55 * len(ring_map.poses)
    assert ring_map.view_cell.max() == len(ring_map.view_cells.templates) - 1


def test_frames_of_noise_close_no_loop():
    rng = np.random.default_rng(7)
    observations, _ = ring_drive(2.5, look=lambda _: rng.integers(0, 256, (120, 160), dtype=np.uint8))
    source, _, _ = closures_of(map_drive(observations, CONFIG))
    assert len(source) == 0


def test_an_unchanging_frame_closes_no_loop():
    source, _, _ = closures_of(map_drive(ring_drive(2.0, look=lambda _: PANORAMA[:, :160])[0], CONFIG))
    assert len(source) == 0


def test_visits_hold_the_raw_motion(ring_map, drive):
    observations, _ = drive
    last = [o.t_s for o in observations].index(ring_map.t_s[-1])
    first = [o.t_s for o in observations].index(ring_map.t_s[0])
    turned = sum(o.yaw_rate_radps * o.dt_s for o in observations[first + 1 : last + 1])
    travelled = sum(o.speed * o.dt_s for o in observations[first + 1 : last + 1])
    assert_allclose(ring_map.visits.motion[:, 2].sum(), turned, rtol=1e-9)
    assert_allclose(np.hypot(*ring_map.visits.motion[:, :2].T).sum(), travelled, rtol=1e-3)
    assert_allclose(ring_map.visits.motion[0], 0.0)


def test_the_unit_of_length_changes_lengths_only(ring_map):
    tripled = map_drive(ring_drive(2.5, units_per_m=1.5)[0], CONFIG)
    unit = np.array([3.0, 3.0, 1.0])
    assert_array_equal(tripled.view_cell, ring_map.view_cell)
    assert_array_equal(tripled.edges.source, ring_map.edges.source)
    assert_array_equal(tripled.edges.target, ring_map.edges.target)
    assert_allclose(tripled.visits.motion, ring_map.visits.motion * unit, rtol=1e-9, atol=1e-9)
    assert_allclose(tripled.edges.sigma, ring_map.edges.sigma * unit, rtol=1e-9)
    assert_allclose(tripled.poses, ring_map.poses * unit, atol=1e-5)
    assert_allclose(tripled.attractors.grid_mean_rad, ring_map.attractors.grid_mean_rad, atol=1e-3)


def test_the_same_drive_gives_the_same_map(ring_map, drive):
    again = map_drive(drive[0], CONFIG)
    assert again.poses.tobytes() == ring_map.poses.tobytes()
    assert again.view_cells.templates.tobytes() == ring_map.view_cells.templates.tobytes()
    assert again.attractors.grid_mean_rad.tobytes() == ring_map.attractors.grid_mean_rad.tobytes()


def test_a_standing_vehicle_makes_no_vertices(ring_map):
    assert not np.any((ring_map.t_s > 51.0) & (ring_map.t_s < 59.5))


def test_the_map_begins_at_its_origin(ring_map):
    assert ring_map.frame == "semi-metric"
    assert_allclose(ring_map.poses[0], 0.0, atol=1e-12)
    assert ring_map.attractors.head_mean_rad.shape == (len(ring_map.poses), 2)
    assert ring_map.attractors.grid_mean_rad.shape == (len(ring_map.poses), 3, 2, 2)


def test_injections_hold_the_head_direction_that_drift_turns_away(ring_map):
    """The gyro's bias adds 0.05 rad a lap; a recognised view speaks for the heading of the first lap."""
    source, target, _ = closures_of(ring_map)
    late = target > np.quantile(target, 0.8)
    heading = ring_map.attractors.head_mean_rad[:, 0]
    reckoned = np.cumsum(ring_map.visits.motion[:, 2])

    def off(headings):
        return np.abs(np.angle(np.exp(1j * (headings[target[late]] - headings[source[late]])))).mean()

    assert off(heading) < 0.6 * off(reckoned)


def test_frames_slower_than_odometry_are_waited_for(drive):
    sparse = [o if i % 3 == 0 else replace(o, frame=None) for i, o in enumerate(drive[0])]
    cognitive_map = map_drive(sparse, CONFIG)
    with_frame = {o.t_s for o in sparse if o.frame is not None}
    assert set(cognitive_map.t_s.tolist()) <= with_frame
    assert len(closures_of(cognitive_map)[0]) > 20


def test_ratslam_s_templates_and_relaxation_are_a_mode(drive):
    memory = PlaceMemoryConfig(view_cells=ViewCellConfig(kind="grey"))
    config = MapperConfig(memory=memory, experience_map=ExperienceMapConfig(relaxation="ratslam"))
    cognitive_map = map_drive(drive[0], config)
    assert cognitive_map.view_cells.kind == "grey"
    assert cognitive_map.view_cells.templates.dtype == np.uint8
    assert len(closures_of(cognitive_map)[0]) > 20


def test_a_drive_without_views_is_an_error():
    with pytest.raises(MappingError, match="no view"):
        Mapper(CONFIG).finish()


def test_the_constants_have_defaults(drive):
    by_default, mapper = map_drive(drive[0][:400]), Mapper()
    for observation in drive[0][:400]:
        mapper.step(observation)
    assert len(by_default.poses) > 10
    assert mapper.finish().poses.tobytes() == by_default.poses.tobytes() == map_drive(drive[0][:400], CONFIG).poses.tobytes()


def test_progress_hears_every_observation(drive):
    heard = []
    map_drive(drive[0][:50], CONFIG, heard.append)
    assert heard == list(range(1, 51))


def blind_drive(count=400):
    """A drive in a circle without any frame."""
    return [Observation(t_s=0.1 * (i + 1), dt_s=0.1, speed=5.0, yaw_rate_radps=0.05, frame=None) for i in range(count)]


def test_a_drive_without_frames_has_keyframes_by_its_motion_and_no_views():
    mapper = MotionMapper()
    for observation in blind_drive():
        mapper.step(observation)
    found = mapper.finish()
    assert len(found.view_cells.templates) == 0
    assert (found.view_cell == -1).all()
    assert len(found.edges.source) == len(found.t_s) - 1
    assert found.visits.motion[1:, 2] == pytest.approx(np.diff(found.t_s) * 0.05)


def test_frames_that_come_late_begin_the_map():
    frame = np.random.default_rng(1).integers(0, 256, (24, 32, 3), np.uint8)
    late = blind_drive(200) + [
        Observation(t_s=20.0 + 0.1 * (i + 1), dt_s=0.1, speed=5.0, yaw_rate_radps=0.05, frame=frame) for i in range(100)
    ]
    found = map_drive(late)
    assert found.t_s[0] > 20.0
    assert (found.view_cell >= 0).all()
