import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from maps import assert_same, random_map

from hippodrome.core.types import HippodromeError, LaneReadings
from hippodrome.proto import cognitive_map_pb2 as wire
from hippodrome.proto.codec import FORMAT_VERSION, load_map, save_map
from hippodrome.proto.pbstream import MAGIC, read_stream, stream_bytes

ON_DISK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
PROVENANCE = {"seed": "7", "recording": "rural", "straße": "ä"}

sizes = st.integers(0, 6)
maps = st.builds(
    random_map,
    seed=st.integers(0, 2**32 - 1),
    vertices=st.integers(1, 6),
    cells=st.integers(1, 6),
    edges=sizes,
    visits=sizes,
    modules=st.integers(0, 3),
    shape=st.lists(st.integers(1, 4), min_size=1, max_size=3).map(tuple),
    kind=st.sampled_from(["gradient", "grey"]),
    refined=st.booleans(),
    lanes=st.integers(1, 4),
    read=st.booleans(),
)


@given(cognitive_map=maps, provenance=st.dictionaries(st.text(max_size=5), st.text(max_size=5), max_size=3))
@ON_DISK
def test_a_loaded_map_equals_the_saved_one_exactly(tmp_path, cognitive_map, provenance):
    path = tmp_path / "map.pbstream"
    size = save_map(path, cognitive_map, provenance)
    loaded, loaded_provenance = load_map(path)
    assert_same(loaded, cognitive_map)
    assert loaded_provenance == provenance
    assert path.stat().st_size == size


def test_an_empty_map_round_trips(tmp_path):
    empty = random_map(vertices=0, cells=0, edges=0, visits=0, modules=0)
    save_map(tmp_path / "map", empty, {})
    assert_same(load_map(tmp_path / "map")[0], empty)


def test_same_map_same_bytes_whatever_the_order_of_provenance(tmp_path):
    save_map(tmp_path / "a", random_map(refined=True), PROVENANCE)
    save_map(tmp_path / "b", random_map(refined=True), dict(reversed(PROVENANCE.items())))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_every_truncation_is_rejected_with_file_and_place(tmp_path):
    path, data = saved(tmp_path, vertices=2, cells=1, edges=1, visits=1, modules=1, shape=(2,))
    for length in range(len(data)):
        path.write_bytes(data[:length])
        with pytest.raises(HippodromeError, match=r"map\.pbstream: byte \d+: "):
            load_map(path)


def test_a_flipped_bit_in_any_byte_is_rejected(tmp_path):
    path, data = saved(tmp_path, vertices=2, cells=1, edges=1, visits=1, modules=1, shape=(2,))
    for place in range(len(data)):
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8
        path.write_bytes(damaged)
        with pytest.raises(HippodromeError, match=r"map\.pbstream: byte \d+: "):
            load_map(path)


@given(flips=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 7)), min_size=1, max_size=6, unique=True))
@ON_DISK
def test_several_flipped_bits_are_rejected(tmp_path, flips):
    path, data = saved(tmp_path)
    damaged = bytearray(data)
    for place, bit in flips:
        damaged[place % len(data)] ^= 1 << bit
    if bytes(damaged) == data:
        return
    path.write_bytes(damaged)
    with pytest.raises(HippodromeError, match=r"map\.pbstream: byte \d+: "):
        load_map(path)


@given(tail=st.binary(min_size=1, max_size=20))
@ON_DISK
def test_appended_bytes_are_rejected(tmp_path, tail):
    path, data = saved(tmp_path)
    path.write_bytes(data + tail)
    with pytest.raises(HippodromeError, match="after the end of the map"):
        load_map(path)


@given(data=st.binary(max_size=200).filter(lambda data: not data.startswith(MAGIC)))
@ON_DISK
def test_foreign_files_are_rejected(tmp_path, data):
    path = tmp_path / "map.pbstream"
    path.write_bytes(data)
    with pytest.raises(HippodromeError, match="not a hippodrome map"):
        load_map(path)


@given(place=st.integers(0, 6), record=st.binary(max_size=60))
@ON_DISK
def test_records_of_junk_with_a_right_checksum_are_rejected(tmp_path, place, record):
    path, _ = saved(tmp_path, refined=True)
    records = read_stream(path, FORMAT_VERSION)[1]
    if record == records[place]:
        return
    records[place] = record
    path.write_bytes(stream_bytes(FORMAT_VERSION, records))
    with pytest.raises(HippodromeError, match=r"map\.pbstream: format version 2: "):
        load_map(path)


@pytest.mark.parametrize("field", ["vertices", "view_cells", "descriptor_size", "edges", "visits", "grid_modules", "lanes"])
@pytest.mark.parametrize("count", [0, 2**31, 2**64 - 1])
def test_hostile_counts_are_rejected_without_allocation(tmp_path, field, count):
    path, _ = saved(tmp_path, refined=True)
    records = read_stream(path, FORMAT_VERSION)[1]
    header = wire.Header.FromString(records[0])
    setattr(header, field, count)
    path.write_bytes(stream_bytes(FORMAT_VERSION, [header.SerializeToString(), *records[1:]]))
    with pytest.raises(HippodromeError, match=r"needs|announces|does not make"):
        load_map(path)


def test_record_count_must_be_what_the_header_announces(tmp_path):
    path, _ = saved(tmp_path, refined=True)
    records = read_stream(path, FORMAT_VERSION)[1]
    path.write_bytes(stream_bytes(FORMAT_VERSION, records[:-1]))
    with pytest.raises(HippodromeError, match="6 records, its header announces 7"):
        load_map(path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda m: replace(m, view_cell=m.view_cell + 99), r"view_cell\[0\] is outside 0..3"),
        (lambda m: replace(m, edges=replace(m.edges, source=m.edges.source - 99)), r"edges.source\[0\] is outside 0..4"),
        (lambda m: replace(m, edges=replace(m.edges, target=m.edges.target + 5)), r"edges.target\[\d\] is outside"),
        (lambda m: replace(m, edges=replace(m.edges, kind=m.edges.kind + np.uint8(2))), r"edges.kind\[0\] is outside 0..1"),
        (lambda m: replace(m, visits=replace(m.visits, vertex=m.visits.vertex - 9)), r"visits.vertex\[0\] is outside"),
        (lambda m: replace(m, poses=np.where(m.poses == m.poses[2, 1], np.nan, m.poses)), r"poses\[2, 1\] is not finite"),
        (lambda m: replace(m, t_s=m.t_s + np.inf), r"t_s\[0\] is not finite"),
        (lambda m: replace(m, log_scale=m.log_scale * np.nan), r"log_scale\[0\] is not finite"),
        (lambda m: replace(m, poses=m.poses[:, :2]), r"poses is float64 \(5, 2\), a map holds float64 \(5, 3\)"),
        (lambda m: replace(m, poses=m.poses.astype(np.float32)), r"poses is float32"),
        (
            lambda m: replace(m, road_match=replace(m.road_match, lane=m.road_match.lane + 9)),
            r"road_match.lane\[\d\] is outside -1..2",
        ),
        (
            lambda m: replace(m, road_match=replace(m.road_match, status=m.road_match.status + np.uint8(4))),
            r"status\[0\] is outside",
        ),
        (lambda m: replace(m, road_match=replace(m.road_match, lane_ids=("a\0b", "c", "d"))), "zero byte"),
        (lambda m: replace(m, view_cells=replace(m.view_cells, shape=(5, 5))), r"shape"),
    ],
)
def test_an_invalid_map_is_not_written(tmp_path, change, complaint):
    path = tmp_path / "map.pbstream"
    path.write_bytes(b"before")
    with pytest.raises(HippodromeError, match=f"map.pbstream: not written.*{complaint}"):
        save_map(path, change(random_map(refined=True)), {})
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_bad_indices_in_a_file_are_rejected_too(tmp_path):
    path, _ = saved(tmp_path)
    records = read_stream(path, FORMAT_VERSION)[1]
    visits = wire.Visits.FromString(records[5])
    visits.vertex = b"\xff" * len(visits.vertex)
    path.write_bytes(stream_bytes(FORMAT_VERSION, [*records[:5], visits.SerializeToString()]))
    with pytest.raises(HippodromeError, match=r"map\.pbstream: .*visits\.vertex\[0\] is outside 0\.\.4"):
        load_map(path)


def test_a_newer_version_asks_for_a_newer_program(tmp_path):
    path, data = saved(tmp_path)
    body = data[:8] + struct.pack("<I", FORMAT_VERSION + 1) + data[12:-4]
    path.write_bytes(body + struct.pack("<I", zlib.crc32(body)))
    with pytest.raises(HippodromeError, match="format version 3, this program reads 1 to 2"):
        load_map(path)


def test_too_much_provenance_is_refused(tmp_path):
    with pytest.raises(HippodromeError, match="provenance takes"):
        save_map(tmp_path / "map", random_map(), {"config": "x" * (2 << 20)})


def test_arrays_cost_little_beyond_the_templates(tmp_path):
    """1,417 vertices and 1,567 edges: all but the templates in 350 kB even if every number is random."""
    cognitive_map = random_map(vertices=1417, cells=1, edges=1567, visits=1417, modules=3, shape=(8, 16, 8))
    assert save_map(tmp_path / "map", cognitive_map, {}) < 350_000


def with_match(cognitive_map, **changes):
    return replace(cognitive_map, road_match=replace(cognitive_map.road_match, **changes))


def saved(tmp_path, **shape):
    path = tmp_path / "map.pbstream"
    save_map(path, random_map(**shape), PROVENANCE)
    return path, path.read_bytes()


def test_a_map_with_readings_is_read_by_programs_that_know_none(tmp_path):
    """Nothing but one field, which they skip, tells such a map from one without; the version is the same."""
    read = random_map(read=True)
    plain = replace(read, visits=replace(read.visits, lane=None))
    save_map(tmp_path / "read", read, PROVENANCE)
    save_map(tmp_path / "plain", plain, PROVENANCE)
    version, records = read_stream(tmp_path / "read", FORMAT_VERSION)
    visits = wire.Visits.FromString(records[5])
    assert visits.HasField("lane")
    visits.ClearField("lane")
    stripped = [*records[:5], visits.SerializeToString(deterministic=True)]
    assert (version, stripped) == read_stream(tmp_path / "plain", FORMAT_VERSION)


@pytest.mark.parametrize("later", [("edge_percent", "paint"), ("paint",)])
def test_readings_from_before_kinds_of_borders_and_paint_were_kept_are_read(tmp_path, later):
    read = random_map(read=True)
    older = replace(read, visits=replace(read.visits, lane=replace(read.visits.lane, **dict.fromkeys(later))))
    save_map(tmp_path / "older", older, PROVENANCE)
    loaded = load_map(tmp_path / "older")[0].visits.lane
    assert all(getattr(loaded, name) is None for name in later)
    save_map(tmp_path / "newer", read, PROVENANCE)
    loaded = load_map(tmp_path / "newer")[0].visits.lane
    assert all(getattr(loaded, name).tobytes() == getattr(read.visits.lane, name).tobytes() for name in later)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("offset_variance_m2", 0.0, r"visits\.lane\.offset_variance_m2\[1\] is not above zero"),
        ("end_variance_m2", np.nan, r"visits\.lane\.end_variance_m2\[1\] is not above zero"),
        ("heading_rad", np.inf, r"visits\.lane\.heading_rad\[1\] is not finite"),
        ("offset_m", 1e9, r"visits\.lane\.offset_m\[1\] is farther"),
        ("end", 3, r"visits\.lane\.end\[1\] is outside 0\.\.2"),
        ("edge_percent", 101, r"visits\.lane\.edge_percent\[1, 0\] is outside 0\.\.100"),
    ],
)
def test_readings_of_no_camera_are_refused(tmp_path, field, value, message):
    read = random_map(read=True, visits=3)
    lane = LaneReadings(*(np.ones(3, np.float32) for _ in range(8)), np.zeros(3, np.uint8), np.zeros((3, 2), np.uint8))
    wrong = getattr(lane, field).copy()
    wrong[1] = value
    broken = replace(read, visits=replace(read.visits, lane=replace(lane, **{field: wrong})))
    with pytest.raises(HippodromeError, match=message):
        save_map(tmp_path / "map", broken, {})
