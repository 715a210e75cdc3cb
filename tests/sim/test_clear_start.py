"""Who is inside the ego when it begins is not there until it has left; all others are, to the last bit."""

import numpy as np
import pytest

from hippodrome.sim.drive import clear_at_start, clear_on_the_way
from hippodrome.sim.types import TrafficLog

STANDING = np.tile([10.0, 20.0, 0.5], (40, 1))
TRUCK, CAR = 2, 0


def log(*vehicles, width=3):
    """A log of 40 steps: (number, kind, poses (40, width)) of each vehicle."""
    poses = np.stack([poses for _, _, poses in vehicles], axis=1).reshape(-1, width)
    count = len(vehicles)
    return TrafficLog(np.arange(40) * 0.1, (np.arange(41) * count).astype(np.int32),
                      np.tile([number for number, _, _ in vehicles], 40).astype(np.int32), poses,
                      np.tile([kind for _, kind, _ in vehicles], 40).astype(np.uint8))  # fmt: skip


def passing(speed_mps, begin_m=1.0):
    """Poses (40, 3) of one that crosses in front of the ego and goes away to its left."""
    t_s, heading = np.arange(40) * 0.1, 0.5 + 0.5 * np.pi
    along = begin_m + speed_mps * t_s
    return np.stack([10.0 + np.cos(heading) * along, 20.0 + np.sin(heading) * along, np.full(40, heading)], axis=1)


def steps_of(found, number):
    owner = np.repeat(np.arange(40), np.diff(found.start))
    return owner[found.vehicle == number].tolist()


def test_a_truck_that_turns_across_the_ego_appears_when_it_has_gone_by():
    whole = log((7, TRUCK, passing(8.0)), (8, CAR, passing(3.0, 9.0)))
    found = clear_at_start(whole, STANDING)
    (first, *others) = steps_of(found, 7)
    assert 3 <= first <= 8 and others == list(range(first + 1, 40)) and steps_of(found, 8) == list(range(40))
    assert np.array_equal(found.poses_m[found.vehicle == 8], whole.poses_m[whole.vehicle == 8])
    assert found.start[-1] == len(found.vehicle) == len(found.kind) and found.start.dtype == whole.start.dtype


@pytest.mark.parametrize("poses", [passing(8.0, 6.0), passing(-3.0, 9.0), passing(0.0, 6.0)], ids=["beside", "later", "parked"])
def test_a_start_that_is_clear_is_as_it_was(poses):
    whole = log((7, TRUCK, poses))
    assert clear_at_start(whole, STANDING) is whole


def test_who_passes_below_a_bridge_is_seen():
    whole = log((7, TRUCK, np.hstack([passing(8.0), np.zeros((40, 2))])), width=5)
    assert clear_at_start(whole, STANDING, np.full(40, 6.0)) is whole
    assert steps_of(clear_at_start(whole, STANDING, np.zeros(40)), 7)[0] > 0


def test_no_traffic_is_no_traffic():
    empty = TrafficLog(np.empty(0), np.zeros(1, np.int32), np.empty(0, np.int32), np.empty((0, 3)), np.empty(0, np.uint8))
    assert clear_at_start(empty, STANDING) is empty


def test_who_comes_inside_on_the_way_is_not_seen_on_that_visit():
    through, beside = passing(4.0, -8.0), passing(4.0, -8.0) + np.array([6.0, 0.0, 0.0])
    whole = log((7, CAR, through), (8, CAR, beside))
    found = clear_on_the_way(whole, STANDING)
    assert steps_of(found, 7) == [] and steps_of(found, 8) == list(range(40))
    gap = log((7, CAR, through))
    earlier = TrafficLog(gap.t_s, np.array([*range(6), *([5] * 10), *range(6, 31)], dtype=np.int32)[:41],
                         gap.vehicle[:30], np.vstack([passing(0.0, 40.0)[:5], through[15:]]), gap.kind[:30])  # fmt: skip
    assert steps_of(clear_on_the_way(earlier, STANDING), 7) == list(range(5)), "an earlier visit stays"
    below = log((7, CAR, np.hstack([through, np.zeros((40, 2))])), width=5)
    assert clear_on_the_way(below, STANDING, np.full(40, 6.0)) is below
