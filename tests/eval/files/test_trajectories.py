import numpy as np
import pytest
from evo.tools import file_interface
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.files.trajectories import read_tum, write_tum
from hippodrome.eval.metrics.association import TrajectoryError


def random_trajectory(seed, count=20):
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.normal(0.0, 1e4, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    return Trajectory(np.cumsum(rng.uniform(1e-3, 1.0, count)), poses)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_round_trip(tmp_path, seed):
    trajectory = random_trajectory(seed)
    write_tum(tmp_path / "a.tum", trajectory)
    back = read_tum(tmp_path / "a.tum")
    assert np.array_equal(back.t_s, trajectory.t_s)
    assert np.array_equal(back.poses[:, :2], trajectory.poses[:, :2])
    assert np.abs(se2.wrap(back.poses[:, 2] - trajectory.poses[:, 2])).max() < 1e-14


def test_evo_reads_what_we_write(tmp_path):
    trajectory = random_trajectory(1)
    write_tum(tmp_path / "a.tum", trajectory)
    read = file_interface.read_tum_trajectory_file(str(tmp_path / "a.tum"))
    assert np.array_equal(read.timestamps, trajectory.t_s)
    assert np.array_equal(read.positions_xyz[:, :2], trajectory.poses[:, :2])
    assert np.allclose(read.get_orientations_euler()[:, 2], trajectory.poses[:, 2])


def test_we_read_what_evo_writes(tmp_path):
    write_tum(tmp_path / "a.tum", random_trajectory(2))
    file_interface.write_tum_trajectory_file(
        str(tmp_path / "b.tum"), file_interface.read_tum_trajectory_file(str(tmp_path / "a.tum"))
    )
    ours, theirs = read_tum(tmp_path / "a.tum"), read_tum(tmp_path / "b.tum")
    assert np.allclose(ours.poses, theirs.poses, atol=1e-9)


def test_ends_of_lines_marks_and_comments_of_other_systems_are_read(tmp_path):
    (tmp_path / "a.tum").write_bytes(b"\xef\xbb\xbf# t x y z qx qy qz qw\r\n0 1 2 0 0 0 0 1\r\n\r\n \t1\t1 2 0 0 0 0 1")
    assert read_tum(tmp_path / "a.tum").t_s.tolist() == [0.0, 1.0]


def test_a_quaternion_needs_no_exact_norm(tmp_path):
    (tmp_path / "a.tum").write_text("0 1 2 0 0 0 0.7 0.7\n")
    assert read_tum(tmp_path / "a.tum").poses[0].tolist() == [1.0, 2.0, pytest.approx(np.pi / 2)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no poses"),
        ("# only a comment\n", "no poses"),
        ("0 1 2 3\n", "line 1: 4 columns, expected 8"),
        ("# t\n0 1 2 0 0 0 0 one\n", "line 2: 'one' is no number"),
        ("t x y z qx qy qz qw\n0 1 2 0 0 0 0 1\n", "line 1: 't' is no number; a heading begins with #"),
        ("0,1,2,0,0,0,0,1\n", "line 1: 1 columns, expected 8 .*; write spaces in place of commas"),
        ("0,1 1 2 0 0 0 0 1\n", "line 1: '0,1' is no number; numbers have a point, as 1.5"),
        ("0 1 2 0 0 0 0 1\n\n1 1 2 0 0 0 0 \x1b[31m1\n", "line 3: '.31m1' is no number$"),
        ("0 1 2 0 0 0 0 0\n", "line 1: qx qy qz qw is not a unit quaternion"),
        ("0 nan 2 0 0 0 0 1\n", "sample 0 is not finite"),
        ("1 1 2 0 0 0 0 1\n0 1 2 0 0 0 0 1\n", "does not increase"),
    ],
)
def test_bad_files_are_named_with_line_and_reason(tmp_path, text, complaint):
    path = tmp_path / "bad.tum"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=rf"bad\.tum: .*{complaint}"):
        read_tum(path)


def test_binary_and_missing_files_are_errors_too(tmp_path):
    (tmp_path / "b").write_bytes(b"\xff\xfe\x00\x80")
    for name in ("b", "missing"):
        with pytest.raises(TrajectoryError, match="cannot be read as text"):
            read_tum(tmp_path / name)
