import numpy as np
import pytest

from hippodrome.core.matching.search.floor import Floor
from hippodrome.core.matching.search.track import Track


def track(heading_rad):
    arc = np.arange(float(len(heading_rad)))
    return Track(arc, np.asarray(heading_rad, dtype=float), arc, 1.0)


def test_a_floor_is_used_up_half_by_driving_and_half_by_turning():
    """101 samples with one corner of 0.4 rad in the middle: half of the floor is spent by the turn alone."""
    floor = Floor.over(track(np.where(np.arange(101) < 50, 0.0, 0.4)), -100.0)
    assert floor.share[[0, 49, 50, 100]] == pytest.approx([0.0, 0.245, 0.75, 1.0])
    assert floor.from_sample(0)[[0, 49, 100]] == pytest.approx([-12.0, -36.5, -100.0])  # 12 nats of slack, and never below all
    assert floor.from_sample(50, 25) == pytest.approx([-12.0, -24.5, -37.0])
    assert floor.back_from_sample(50)[[0, 1, 50]] == pytest.approx([-12.0, -62.5, -87.0])


def test_a_straight_track_uses_up_half_of_it():
    assert Floor.over(track(np.zeros(11)), -100.0).share[-1] == pytest.approx(0.5)
