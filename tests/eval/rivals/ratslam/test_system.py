"""RatSLAM on a ring road: loop closures pull the map together; without them drift grows. As published, and deterministic."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.types import EdgeKind, HippodromeError, Observation
from hippodrome.eval.rivals.ratslam.system import RatSlam, RatSlamConfig
from hippodrome.eval.rivals.ratslam.views import ViewConfig, ViewTemplates

LAP_M, DT_S, PIXELS_PER_M = 300.0, 0.2, 8
RADIUS_M = LAP_M / (2 * np.pi)


def ring_panorama():
    rng, width = np.random.default_rng(5), int(LAP_M * PIXELS_PER_M)
    image = np.full((120, width), 200, dtype=np.uint8)
    x = 0
    while x < width:
        step = int(rng.integers(10, 40))
        image[int(rng.integers(20, 80)) : 90, x : x + step] = rng.integers(30, 230)
        x += step
    return np.concatenate([image, image[:, :200]], axis=1)


PANORAMA = ring_panorama()


def drive(laps, blind=False):
    """Observations and true positions (N, 2) of a drive round the ring whose gyro is biased by 0.1 rad a lap."""
    rng, observations, places = np.random.default_rng(1), [], []
    for i in range(int(laps * LAP_M / (8.0 * DT_S))):
        way_m = 8.0 * DT_S * (i + 1)
        left = int(way_m % LAP_M * PIXELS_PER_M)
        frame = rng.integers(0, 256, (120, 160), dtype=np.uint8) if blind else PANORAMA[:, left : left + 160]
        turn = 8.0 / RADIUS_M + 0.1 / (LAP_M / 8.0)
        observations.append(Observation(DT_S * (i + 1), DT_S, 4.0, turn, frame))
        angle = way_m / RADIUS_M
        places.append((RADIUS_M * np.sin(angle), RADIUS_M * (1 - np.cos(angle))))
    return observations, np.array(places)


def mapped(observations):
    system = RatSlam(RatSlamConfig())
    for observation in observations:
        system.step(observation)
    return system.finish()


def lap_gaps(found, laps):
    """Mean distance (map units) between the map's places of the same spot in the first lap and in each later one."""
    trajectory, lap_s = found.trajectory, LAP_M / 8.0
    at = np.arange(5.0, lap_s - 5.0, 1.0)
    place = [np.column_stack([np.interp(at + k * lap_s, trajectory.t_s, trajectory.poses[:, a]) for a in (0, 1)])
             for k in range(laps)]  # fmt: skip
    return [float(np.linalg.norm(place[k] - place[0], axis=1).mean()) for k in range(1, laps)]


@pytest.fixture(scope="module")
def seen():
    return mapped(drive(3)[0])


def test_without_views_that_return_drift_grows():
    found = mapped(drive(3, blind=True)[0])
    assert np.count_nonzero(found.links.kind == EdgeKind.CLOSURE) == 0
    gaps = lap_gaps(found, 3)
    assert gaps[0] > 1.0
    assert gaps[1] > 1.5 * gaps[0]


def test_closures_pull_the_map_together(seen):
    assert np.count_nonzero(seen.links.kind == EdgeKind.CLOSURE) >= 1
    blind = lap_gaps(mapped(drive(3, blind=True)[0]), 3)
    gaps = lap_gaps(seen, 3)
    assert gaps[1] < 0.35 * blind[1]


def test_returning_to_a_place_activates_its_experience_again(seen):
    visits_of_last_lap = seen.visit[seen.visit_t_s > 2 * LAP_M / 8.0 + 5.0]
    made_in_last_lap = np.count_nonzero(visits_of_last_lap > np.max(seen.visit[seen.visit_t_s <= 2 * LAP_M / 8.0]))
    assert made_in_last_lap < 0.3 * len(visits_of_last_lap)
    assert len(seen.poses) < len(seen.visit)


def test_revisited_experiences_are_where_they_were_made(seen):
    _, places = drive(3)
    true = np.column_stack([np.interp(seen.visit_t_s, DT_S * np.arange(1, len(places) + 1), places[:, a]) for a in (0, 1)])
    first = {int(v): k for k, v in reversed(list(enumerate(seen.visit)))}
    off_m = [np.linalg.norm(true[k] - true[first[int(v)]]) for k, v in enumerate(seen.visit)]
    assert max(off_m) < 8.0


def test_the_map_begins_at_its_origin_and_the_same_drive_gives_the_same_map(seen):
    again = mapped(drive(3)[0])
    assert_allclose(seen.poses[0], 0.0, atol=1e-12)
    assert again.poses.tobytes() == seen.poses.tobytes()
    assert again.images.tobytes() == seen.images.tobytes()
    assert np.all(np.diff(seen.visit_t_s) > 0)


def test_the_unit_of_length_changes_lengths_only(seen):
    tripled = mapped([Observation(o.t_s, o.dt_s, 3 * o.speed, o.yaw_rate_radps, o.frame) for o in drive(3)[0]])
    assert_allclose(tripled.poses, seen.poses * np.array([3.0, 3.0, 1.0]), atol=1e-6)


def test_a_template_that_stays_active_tires_and_recovers():
    templates, rng = ViewTemplates(ViewConfig(recent=1)), np.random.default_rng(0)
    frames = rng.integers(0, 256, (4, 120, 160), dtype=np.uint8)
    for frame in frames:
        assert templates.energy(templates.recognise(frame, np.zeros(3))) == 0.0  # new templates inject nothing
    energies = [templates.energy(templates.recognise(frames[0], np.zeros(3))) for _ in range(4)]
    assert_allclose(energies[0], 0.1 * (30 - np.exp(1.2)) / 30)
    assert np.all(np.diff(energies[:3]) < 0)
    assert energies[3] == 0.0
    for _ in range(120):
        templates.energy(templates.recognise(frames[1], np.zeros(3)))
    assert_allclose(templates.energy(templates.recognise(frames[0], np.zeros(3))), energies[0])


def test_a_drive_without_frames_is_an_error():
    with pytest.raises(HippodromeError, match="no frame"):
        RatSlam(RatSlamConfig()).finish()
