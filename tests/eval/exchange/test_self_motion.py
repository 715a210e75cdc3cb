"""Tables of self-motion as loggers write them: names, units and clocks are understood, nonsense is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.eval.exchange.drives.clock import UNIT_S, disjoint, in_seconds, unit_of
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import Motion
from hippodrome.eval.exchange.drives.plausible import require_plausible
from hippodrome.eval.exchange.drives.steps import begin_s
from hippodrome.eval.exchange.readers.motion_csv import read_motion

ROWS = [(0.1, 5.0, 0.0), (0.2, 5.5, 0.25), (0.3, 6.0, -0.5)]


def table(tmp_path, head, lines):
    (tmp_path / "o.csv").write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")
    return tmp_path / "o.csv"


@pytest.mark.parametrize(
    ("head", "line"),
    [
        ([], "{t},{v},{w}"),
        (["t_s,speed,yaw_rate"], "{t},{v},{w}"),
        (["#t_s,speed [map units/s],yaw_rate [rad/s], means since the line before"], "{t},{v},{w}"),
        (["# made by hand"], "{t},{v},{w}"),
        (["# t_s, speed, yaw_rate"], "{t},{v},{w}"),
        (["yaw_rate,time,speed"], "{w},{t},{v}"),
        (["Timestamp (s);GPS speed [m/s];acc_x;Gyro-Z (rad/s)"], "{t};{v};9.8;{w}"),
        (["seconds_elapsed\tvelocity\twz"], "{t}\t{v}\t{w}"),
        (["t v omega"], "{t} {v} {w}"),
        (['"time","speed","gyro_z","latitude"'], '"{t}","{v}","{w}","49"'),
    ],
)
def test_columns_are_found_by_their_names(tmp_path, head, line):
    found = read_motion(table(tmp_path, head, [line.format(t=t, v=v, w=w) for t, v, w in ROWS]))
    assert np.allclose(np.column_stack([found.t_s, found.speed, found.yaw_rate_radps]), ROWS)


def test_units_of_the_header_are_used(tmp_path):
    rows = [f"{1000 * t},{3.6 * v},{np.degrees(w)}" for t, v, w in ROWS]
    for head in ("t_ms,speed_kmh,yaw_rate_deg_s", "t [ms],speed [km/h],yaw_rate [deg/s]"):
        found = read_motion(table(tmp_path, [head], rows))
        assert np.allclose(np.column_stack([found.t_s, found.speed, found.yaw_rate_radps]), ROWS)


def test_rows_where_a_sensor_had_nothing_new_are_counted(tmp_path, capsys):
    found = read_motion(table(tmp_path, ["time,speed,gyro_z,note"], ["0.1,5,0,a", "0.2,,0,b", "0.3,5,0,c"]))
    assert found.t_s.tolist() == [0.1, 0.3]
    assert "1 row(s) without" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("head", "lines", "complaint"),
    [
        (["time,acc_x,acc_y"], ["0,1,2"], "names no column of time, speed and yaw rate"),
        ([], ["0.1,5"], "line 1: 2 columns, expected 3"),
        ([], ["0.1,5,0,7"], "line 1: 4 columns, expected 3"),
        (["t_s,speed,yaw_rate"], ["0.1,5,soon"], "line 2: not a number"),
        (["t_s,speed,yaw_rate"], ["0.1,5,nan", "0.2,5,0"], "data row 1 is not finite"),
        (["t_s,speed,yaw_rate"], [], "no data"),
        ([], [], "no data"),
        ([], ["0.2,5,0", "0.1,5,0"], "does not increase"),
    ],
)
def test_what_is_no_self_motion_is_refused_with_its_line(tmp_path, head, lines, complaint):
    with pytest.raises(ExchangeError, match=complaint):
        read_motion(table(tmp_path, head, lines))


@given(unit=st.sampled_from(list(UNIT_S)), rate_hz=st.floats(1.0, 250.0), begin_s=st.sampled_from([0.0, 3.5, 1.6e9]))
@settings(deadline=None)
def test_the_unit_of_time_is_recognised(unit, rate_hz, begin_s):
    t_s = begin_s + np.arange(50) / rate_hz
    if unit == "ms" and begin_s < 1e9 and rate_hz > 400.0:
        return
    assert unit_of(t_s / UNIT_S[unit]) == unit
    assert np.allclose(in_seconds(t_s / UNIT_S[unit], unit, "test"), t_s, rtol=0.0, atol=1e-6)


def test_a_unit_that_is_recognised_is_said_and_one_that_is_named_is_not_doubted(capsys):
    stamps = 1e8 * np.arange(1.0, 5.0)
    assert in_seconds(stamps, None, "o.csv") == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert "o.csv: time stamps taken for nanoseconds" in capsys.readouterr().out
    assert in_seconds(stamps, "us", "o.csv") == pytest.approx([100.0, 200.0, 300.0, 400.0])


def test_clocks_that_do_not_meet_are_told_the_offset():
    said = str(disjoint("seq", (0.1, 12.0), (1000.1, 1012.0)))
    assert "from 0.100 to 12.000 s" in said
    assert "from 1000.100 to 1012.000 s" in said
    assert "--time-offset -1000.000" in said


def motion(**changed):
    values = {"t_s": 0.1 * np.arange(1.0, 61.0), "speed": np.full(60, 5.0), "yaw_rate_radps": np.full(60, 0.1)}
    for name, (row, value) in changed.items():
        values[name][row:] = values[name][row:] + value if name == "t_s" else values[name][row:]
        if name != "t_s":
            values[name][row] = value
    return Motion(**values)


def test_self_motion_that_no_vehicle_has_is_refused():
    require_plausible(motion(), "o.csv")
    require_plausible(motion(t_s=(30, 4.0)), "o.csv")
    for changed, complaint in (
        ({"speed": (40, 1e300)}, r"row 41, 4.100 s: speed 1e\+300"),
        ({"yaw_rate_radps": (3, -40.0)}, "row 4, 0.400 s: yaw rate -40"),
        ({"t_s": (40, 60.0)}, "row 41, 64.100 s, comes 60.1 s after"),
        ({"t_s": (1, 60.0)}, "row 2, 60.200 s, comes 60.1 s after"),
    ):
        with pytest.raises(ExchangeError, match=complaint):
            require_plausible(motion(**changed), "o.csv")


def test_degrees_taken_for_radians_are_refused():
    turning = Motion(0.1 * np.arange(1.0, 61.0), np.full(60, 5.0), np.full(60, 6.0))
    with pytest.raises(ExchangeError, match="yaw_rate_deg_s"):
        require_plausible(turning, "o.csv")


def test_a_vehicle_that_stood_may_have_a_hole():
    stood = motion(t_s=(30, 600.0), speed=(30, 0.0))
    require_plausible(stood, "o.csv")


def test_the_first_row_lasts_a_median_interval():
    assert begin_s(motion(t_s=(1, 60.0))) == pytest.approx(0.0)
