"""A program that reads files: what it is given, what it may take, and a row with the cause for whatever it does."""

import stat
import sys
from contextlib import suppress
from pathlib import Path

import pytest

import hippodrome.eval.programs.limits
from hippodrome.eval.contest.entry import Added, entries_of, with_methods
from hippodrome.eval.contest.perform import perform
from hippodrome.eval.programs.containment import can_contain
from hippodrome.sim.method_spec import MethodSpec

INTEGRATE = """\
import csv, math, sys
sequence, out = sys.argv[1:3]
x = y = heading = before = 0.0
with open(out + "/trajectory.tum", "w") as trajectory:
    for row in csv.reader(open(sequence + "/odometry.csv")):
        if row[0].startswith("#"):
            continue
        t, speed, yaw_rate = map(float, row)
        heading, dt, before = heading + yaw_rate * (t - before), t - before, t
        x, y = x + speed * dt * math.cos(heading), y + speed * dt * math.sin(heading)
        trajectory.write(f"{t!r} {x!r} {y!r} 0 0 0 {math.sin(heading / 2)!r} {math.cos(heading / 2)!r}\\n")
"""


@pytest.fixture
def row(materials, tmp_path, monkeypatch):
    """Runs a program, a script's text, and gives the row of it alone."""
    monkeypatch.chdir(tmp_path)

    def run(text, command="./program {sequence} {out}", **settings):
        (tmp_path / "program").write_text(text)
        (tmp_path / "program").chmod(stat.S_IRWXU)
        added = Added("mine", MethodSpec(command=command, **settings))
        entry = entries_of(with_methods(materials.scenario, [added]))[-1]
        return perform(materials, [entry]).rows[0]

    return run


def python(text):
    return f"#!/usr/bin/env python3\n{text}"


@pytest.mark.parametrize("layout", ["tum", "euroc", "kitti", "rosbag2", "mcap"])
def test_a_program_has_a_row_with_errors_and_costs(row, layout):
    found = row(python(f"{INTEGRATE}import time\ntime.sleep(0.2)\n"), input=layout)  # long enough to be seen
    assert found.failure is None
    assert found.ape.mean_m < 1.0
    assert found.cpu_percent > 0.0
    assert found.peak_rss_bytes > 1_000_000
    assert found.latency_ms is None
    assert found.covered == 1.0


ODOMETRY_OF_A_BAG = """\
import math, sys
from pathlib import Path
sequence, out = map(Path, sys.argv[1:])
rows = []
if (sequence / "drive.mcap").exists():
    from mcap_protobuf.reader import read_protobuf_messages
    kept = [m for m in read_protobuf_messages(str(sequence / "drive.mcap"), log_time_order=True)]
    assert {m.topic for m in kept} == {"/camera", "/self_motion"}, {m.topic for m in kept}
    rows = [(m.log_time_ns / 1e9, m.proto_msg.linear_velocity.x, m.proto_msg.angular_velocity.z)
            for m in kept if m.topic == "/self_motion"]
else:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore
    types = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(sequence / "drive") as bag:
        assert {one.topic for one in bag.connections} == {"/camera/image/compressed", "/odometry"}
        for connection, stamp, raw in bag.messages():
            if connection.topic == "/odometry":
                twist = types.deserialize_cdr(raw, connection.msgtype).twist.twist
                rows.append((stamp / 1e9, twist.linear.x, twist.angular.z))
x = y = heading = before = 0.0
with (out / "trajectory.tum").open("w") as stream:
    for t_s, speed, yaw_rate in rows:
        heading += yaw_rate * (t_s - before)
        x, y = x + speed * (t_s - before) * math.cos(heading), y + speed * (t_s - before) * math.sin(heading)
        before = t_s
        stream.write(f"{t_s} {x} {y} 0 0 0 {math.sin(heading / 2)} {math.cos(heading / 2)}\\n")
"""


@pytest.mark.parametrize("layout", ["rosbag2", "mcap"])
def test_a_bag_holds_the_frames_and_the_self_motion_and_no_truth(row, layout):
    found = row(f"#!{sys.executable}\n{ODOMETRY_OF_A_BAG}", input=layout)
    assert found.failure is None
    assert found.ape.mean_m < 1.0


def test_frames_lie_where_each_layout_has_them(row):
    listing = "import pathlib, sys\nhere = pathlib.Path(sys.argv[1])\n"
    listing += "sys.exit(' '.join(sorted(str(path.relative_to(here)) for path in here.rglob('*'))[:9]))"
    assert "rgb/0.100000.png" in row(python(listing)).failure
    assert "mav0/cam0/data/100000000.png" in row(python(listing), input="euroc").failure
    assert "image_2/000000.png" in row(python(listing), input="kitti").failure


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("#!/bin/sh\nsleep 1000\n", "hung: no end after 1 s"),
        ("#!/bin/sh\nexit 0\n", "left no trajectory.tum in {out}, but nothing"),
        ("#!/bin/sh\necho sorry >&2; exit 7\n", "exit status 7; its last words: sorry"),
        ("#!/bin/sh\nkill -SEGV $$\n", "crashed: signal 11 (SIGSEGV)"),
        ("#!/bin/sh\necho '1 nan 0 0 0 0 0 1' > $2/trajectory.tum\n", "not finite"),
        ("#!/bin/sh\nprintf '2 0 0 0 0 0 0 1\\n1 0 0 0 0 0 0 1\\n' > $2/trajectory.tum\n", "does not increase"),
        ("#!/bin/sh\necho hello > $2/trajectory.tum\n", "trajectory.tum: line 1: 1 columns"),
        ("#!/bin/sh\n: > $2/trajectory.tum\n", "trajectory.tum: no poses"),
        ("#!/bin/sh\nprintf '1 0 0 0 0 0 0 1\\n2 1 0 0 0 0 0 1\\n' > $2/trajectory.tum\n", "cover"),
        ("#!/bin/sh\nhead -c 100000000 /dev/zero | tail | sleep 100 & exit 0\n", "left no trajectory.tum"),
    ],
)
def test_whatever_it_does_wrong_is_in_its_row(row, text, cause):
    found = row(text, time_limit_s=1.0)
    assert cause in found.failure
    assert "/tmp" not in found.failure
    assert found.ape is None


def test_a_program_that_eats_memory_is_stopped(row):
    found = row(python("held = []\nwhile True:\n    held.append(bytearray(20_000_000))\n"), memory_limit_mb=300)
    assert "MemoryError" in found.failure or "memory" in found.failure


def test_what_a_program_reserves_and_does_not_touch_is_no_memory(row):
    """ORB-SLAM3 reserves 53 GB where it holds 4; so do runtimes with a heap of their own."""
    found = row(python(f"import mmap\nreserved = mmap.mmap(-1, 800_000_000)\n{INTEGRATE}"), memory_limit_mb=300)
    assert found.failure is None


def test_several_processes_that_eat_memory_together_are_stopped(row):
    text = "import os, time\nfor _ in range(4):\n    os.fork()\nheld = bytearray(30_000_000)\ntime.sleep(30)\n"
    assert "more than its limit of 300 MB" in row(python(text), memory_limit_mb=300, time_limit_s=20).failure


@pytest.mark.parametrize(
    "text",
    [
        "#!/bin/sh\nfor i in 1 2 3 4 5 6 7 8; do head -c 5000000 /dev/zero > $2/$i; done; sleep 60\n",
        "#!/bin/sh\nfor i in 1 2 3 4 5 6 7 8; do head -c 5000000 /dev/zero > $2/$i; done\n",  # it ends before anybody looks
        "#!/bin/sh\nfor i in 1 2 3 4 5 6 7 8; do head -c 5000000 /dev/zero > $TMPDIR/$i; done\n",
        "#!/bin/sh\nexec 3> $2/a; exec 4> $2/b; rm $2/a $2/b\n"  # files without a name
        "head -c 19000000 /dev/zero >&3; head -c 19000000 /dev/zero >&4; sleep 60\n",
    ],
)
def test_a_program_that_fills_the_disk_is_stopped_and_the_limit_named(row, text):
    found = row(text, disk_limit_mb=20.0, time_limit_s=30.0).failure
    assert "MB on disk, more than its limit of 20 MB, disk_limit_mb" in found


def test_no_file_is_longer_than_the_limit(row, monkeypatch):
    monkeypatch.setattr(hippodrome.eval.programs.limits, "FILE_BYTES", 20_000_000)
    text = "#!/bin/sh\nexec head -c 40000000 /dev/zero > $2/a\n"
    assert "wrote a file of more than 20 MB, the limit" in row(text).failure


def test_a_log_that_is_replaced_by_what_never_ends_holds_nobody_up(row):
    text = "#!/bin/sh\nrm $(dirname $2)/log.txt; mkfifo $(dirname $2)/log.txt; exit 3\n"
    assert row(text).failure == "exit status 3; its last words: none"
    text = python("import sys\nif len(sys.argv) > 3:\n    sys.exit('a second call')\n" + INTEGRATE)
    text += "import os\nlog = os.path.dirname(out) + '/log.txt'\nos.remove(log)\nos.mkfifo(log)\n"
    found = row(text, frame="network", localize="./program {sequence} {out} {map}")
    assert "its folder cannot be used for another call" in found.failure


def test_a_program_that_is_not_there_is_named(row):
    assert "there is no program './absent'" in row("", command="./absent {sequence} {out}").failure


def test_a_file_that_is_no_program_is_a_row(row):
    assert row("not a program\n").failure.startswith(("exit status 127", "'./program' cannot be started"))


def test_no_truth_can_be_reached(row, tmp_path):
    if not can_contain():
        pytest.skip("this system has no mount namespaces for users")
    text = f"#!/bin/sh\ncat {tmp_path}/recordings/one/truth.txt; ls -A {tmp_path}/recordings; echo end; exit 1\n"
    assert "its last words: end" in row(text).failure
    spy = f'#!/bin/sh\nfound=$(cat {tmp_path}/recordings/one/truth.txt 2>/dev/null)\necho "found $found."; exit 1\n'
    assert "found ." in row(spy).failure


STEAL = """\
import os, subprocess, sys
here = "{here}"
for folder in ("recordings", "results"):
    subprocess.run(["umount", f"{{here}}/{{folder}}"], capture_output=True)
    subprocess.run(["unshare", "--mount", "umount", "-l", f"{{here}}/{{folder}}"], capture_output=True)
places = [f"/proc/{{pid}}/root" for pid in os.listdir("/proc") if pid.isdigit()] + [""]
found = [place for place in places if os.path.exists(f"{{place}}{{here}}/recordings/one/truth.txt")]
sys.exit(f"it sees {{len(places) - 1}} processes and the truth at {{len(found)}} places")
"""


def test_the_covers_cannot_be_taken_away_and_no_other_process_is_seen(row, tmp_path):
    if not can_contain():
        pytest.skip("this system has no namespaces for users")
    assert "it sees 2 processes and the truth at 0 places" in row(python(STEAL.format(here=tmp_path))).failure


@pytest.mark.parametrize(
    "link", ["ln -s $HERE/recordings/one/truth.tum $2/trajectory.tum", "rmdir $2; ln -s $HERE/recordings/one $2"]
)
def test_what_it_leaves_is_a_file_and_no_way_to_one(row, tmp_path, link):
    for name in ("truth", "trajectory"):
        (tmp_path / f"recordings/one/{name}.tum").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    assert "as a link, which is not followed" in row(f"#!/bin/sh\nHERE={tmp_path}\n{link}\n").failure


@pytest.mark.parametrize("gone", ["rm -r $2", "rm -r $(dirname $2)"])
def test_a_folder_that_it_takes_away_is_nothing_left(row, gone):
    assert "left no trajectory.tum in {out}, but nothing" in row(f"#!/bin/sh\n{gone} 2>/dev/null; exit 0\n").failure


def test_a_file_of_too_many_lines_is_not_taken_apart(row):
    assert "lines, the limit is" in row("#!/bin/sh\nyes 1 | head -n 5000000 > $2/trajectory.tum\n").failure


def test_daemons_end_with_it_and_its_last_words_are_its_own(row):
    if not can_contain():
        pytest.skip("this system has no namespaces for users")
    text = "#!/bin/sh\nenv -i setsid sleep 1234567 &\necho last words; kill -SEGV $$\n"
    assert row(text).failure == "crashed: signal 11 (SIGSEGV); its last words: last words"
    assert not any(b"1234567" in one for one in commands())


def commands():
    """The command lines of all processes."""
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            yield (entry / "cmdline").read_bytes() if entry.name.isdigit() else b""


def test_a_second_drive_is_localized_in_what_the_program_left(row, materials):
    text = python("import sys\nif len(sys.argv) > 3:\n    open(sys.argv[3] + '/trajectory.tum')\n" + INTEGRATE)
    found = row(text, frame="network", localize="./program {sequence} {out} {map}")
    assert found.failure is None
    assert found.localization.success
    assert found.localization.localized_share == 1.0
    assert found.localization.false_fixes == 0
