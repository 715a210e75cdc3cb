"""A table with a word where a number belongs says which word, and what people mean by such."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.readers.motion_csv import is_motion, read_motion
from hippodrome.eval.exchange.readers.self_motion import read_self_motion
from hippodrome.eval.exchange.readers.text import read_table
from hippodrome.eval.files.fixes import read_fixes
from hippodrome.eval.files.number_words import first_that_is_none, no_number, with_commas
from hippodrome.eval.files.spatial import read_poses


@pytest.mark.parametrize(
    ("word", "heads", "words"),
    [
        ("0,1", False, "'0,1' is no number; numbers have a point, as 1.5"),
        ("2024-05-17T10:00:00Z", True, "times are seconds, not dates or times of day"),
        ("17.05.2024", False, "times are seconds"),
        ("10:00:01.5", False, "times are seconds"),
        ("timestamp", True, "'timestamp' is no number; a heading begins with #"),
        ("timestamp", False, "'timestamp' is no number"),
        ("\x1b[31m" + "x" * 500, False, f"'[31m{36 * 'x'}' is no number"),
    ],
)
def test_a_word_that_is_no_number_is_told_with_what_is_meant(word, heads, words):
    assert words in no_number(word, heads)
    assert no_number(word, heads).isprintable()


def test_the_word_at_fault_is_found():
    assert first_that_is_none(["1", "nan", "-2e3", "x", "y"]) == "x"
    assert first_that_is_none(["1"]) == ""
    assert with_commas("1,2,3", 3) and not with_commas("1 2,3", 3)


def file(folder, text, name="a.txt"):
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize(
    ("read", "text", "words"),
    [
        (read_poses, "0,1,2,0,0,0,0,1\n", "1 columns, expected 8 .*; write spaces in place of commas"),
        (read_poses, "0 1 2 0 0 0 0 1\n1 1 2 0 0 0 0 one\n", "line 2: 'one' is no number"),
        (read_poses, "t x y z qx qy qz qw\n", "line 1: 't' is no number; a heading begins with #"),
        (lambda path: read_table(path, 8), "0,1,2,0,0,0,0,1\n", "1 columns, expected 8; write spaces in place of commas"),
        (lambda path: read_table(path, 2), "a b\n", "not a number in 'a b': 'a' is no number; a heading begins with #"),
        (read_motion, "t_s;speed;yaw_rate\n0,1;5,0;0,01\n", "'0,1' is no number; numbers have a point, as 1.5"),
        (read_motion, "0,1;5,0;0,01\n", "4 columns, expected 3; numbers have a point, as 1.5"),
        (read_motion, "t_s,speed,yaw_rate\n2024-05-17 10:00,5,0\n", "times are seconds, not dates or times of day"),
        (read_fixes, "t_s;lat;lon\n1;49,01;8,38\n", "'49,01' is not a number; numbers have a point, as 1.5"),
    ],
)
def test_every_reader_says_it(tmp_path, read, text, words):
    with pytest.raises(HippodromeError, match=words):
        read(file(tmp_path, text))


def test_comments_may_begin_after_blanks(tmp_path):
    assert read_table(file(tmp_path, " # a comment\n1 2\n"), 2).tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("0.1 5 0.0\n0.2 5 0.0\n0.3 5 0.0\n", True),
        ("# t_s speed yaw_rate\n0.1 5 0.0\n0.2 5 0.0\n0.3 5 0.0\n", True),
        ("time\tspeed\tyaw_rate\tnote\n0.1\t5\t0\ta\n0.2\t5\t0\tb\n0.3\t5\t0\tc\n", True),
        ("0 1 2 0 0 0 0 1\n", False),
        ("", False),
    ],
)
def test_self_motion_is_known_by_its_columns_whatever_its_name(tmp_path, text, known):
    path = file(tmp_path, text, "wheels.txt")
    assert is_motion(path) == known
    if known:
        motion, words = read_self_motion(path, "body", None, None)
        np.testing.assert_allclose(motion.speed, 5.0)
        assert "speed and yaw rate" in words
