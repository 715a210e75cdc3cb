"""The level of the asphalt, by which the ground is read: followed through shade, and not onto the pavement."""

import math

import numpy as np

from hippodrome.core.navigation.asphalt import followed, kinds_of
from hippodrome.core.navigation.border import OTHER, PAINT, ROAD

ASPHALT, PAVEMENT, KERB, LINE = 100.0, 134.0, 150.0, 200.0
SIZE = (20, 30)
ALL = np.ones(SIZE, dtype=np.bool_)
GREY = np.zeros(SIZE)


def after_frames(level, before=ASPHALT, frames=20):
    for _ in range(frames):
        before = followed(before, level, GREY, ALL)
    return before


def sharp_bend(near_rows):
    """A frame of a bend whose edge lies right ahead, ``near_rows`` above the lower rim: line, kerb, pavement."""
    level = np.full(SIZE, PAVEMENT)
    level[SIZE[0] - near_rows :] = ASPHALT
    level[SIZE[0] - near_rows - 1] = LINE
    level[SIZE[0] - near_rows - 2] = KERB
    return level


def test_a_pavement_right_ahead_in_a_sharp_bend_is_not_taken_for_the_asphalt():
    assert float(np.median(sharp_bend(6))) == PAVEMENT  # most of what lies right ahead
    assert after_frames(sharp_bend(6)) == ASPHALT
    assert after_frames(sharp_bend(2)) == ASPHALT  # too little of the patch is left: the level stays


def test_the_level_follows_the_asphalt_itself():
    assert after_frames(np.full(SIZE, 125.0), frames=60) > 124.0
    assert after_frames(np.full(SIZE, 60.0), frames=60) < 61.0
    shade_ahead = np.full(SIZE, 60.0)
    shade_ahead[10:] = ASPHALT
    assert after_frames(shade_ahead) < ASPHALT  # shade is road, and no border


def test_a_stop_line_across_the_patch_and_a_level_that_jumps_change_nothing():
    crossed = np.full(SIZE, ASPHALT)
    crossed[8:12] = LINE
    assert after_frames(crossed) == ASPHALT
    assert after_frames(np.full(SIZE, 3.0 * ASPHALT)) == ASPHALT


def test_the_first_frame_tells_the_level_as_it_is():
    assert followed(math.nan, sharp_bend(12), GREY, ALL) == ASPHALT


def test_kinds_are_told_by_level_and_colour():
    relative = np.array([[1.0, 0.3, 1.5, 2.0, 1.0, 2.0]])
    colour = np.array([[0.0, 0.0, 0.0, 0.0, 0.3, 0.3]])
    assert kinds_of(relative, colour).tolist() == [[ROAD, OTHER, OTHER, PAINT, OTHER, OTHER]]
