"""Sequences have their length and are spread over the drive, and a drive that is too short is a named failure."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.sequences import cut

STEPS = 2001
STRAIGHT = SimpleNamespace(
    samples=SimpleNamespace(poses_m=np.column_stack([np.arange(STEPS) * 0.8, np.zeros((STEPS, 2))]), t_s=0.1 * np.arange(STEPS))
)


@pytest.mark.parametrize("length_m", [170.0, 804.3, 1485.3])
def test_sequences_have_their_length_and_lie_on_the_drive(length_m):
    pieces = [cut(STRAIGHT, number, 10, length_m) for number in range(1, 11)]
    for first, end in pieces:
        assert 0 <= first < end <= STEPS
        assert (end - first) * 0.8 == pytest.approx(length_m, abs=0.81)
    starts = [first for first, _ in pieces]
    assert starts[0] == 0
    assert starts == sorted(starts)
    assert np.ptp(np.diff(starts)) <= 1


def test_a_short_drive_is_named():
    with pytest.raises(HippodromeError, match="1600 m long, the sequence 1700 m"):
        cut(STRAIGHT, 1, 10, 1700.0)
