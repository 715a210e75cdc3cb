"""Version 1 files stay readable. ``map_v1.pbstream`` was written by the small writer below and is never rewritten."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from maps import assert_same, random_map

from hippodrome.core.types import HippodromeError
from hippodrome.proto import cognitive_map_pb2 as wire
from hippodrome.proto.codec import load_map, save_map
from hippodrome.proto.pbstream import stream_bytes, write_stream

GOLDEN = Path(__file__).parent / "map_v1.pbstream"
PROVENANCE = {"seed": "1", "writer": "version 1"}


def write_v1(path, m, provenance):
    """Format version 1: arrays as they lie in memory, no counts in the header."""
    write_stream(path, 1, [message.SerializeToString(deterministic=True) for message in v1_messages(m, provenance)])


def v1_messages(m, provenance):
    frame = {"semi-metric": 1, "network": 2}[m.frame]
    cells, states, edges, visits, match = m.view_cells, m.attractors, m.edges, m.visits, m.road_match
    vertices = wire.Vertices(t_s=m.t_s.tobytes(), poses=m.poses.tobytes(), view_cell=m.view_cell.tobytes())
    if m.log_scale is not None:
        vertices.log_scale, vertices.covariance = m.log_scale.tobytes(), m.covariance.tobytes()
    messages = [
        wire.Header(frame=frame, provenance=provenance, has_road_match=match is not None),
        wire.ViewCells(
            kind={"gradient": 1, "grey": 2}[cells.kind],
            templates=cells.templates.tobytes(),
            mean=cells.mean.tobytes(),
            shape=cells.shape,
        ),
        wire.Attractors(**{name: getattr(states, name).tobytes() for name in type(states).__slots__}),
        vertices,
        wire.Edges(**{name: getattr(edges, name).tobytes() for name in type(edges).__slots__}),
        wire.Visits(**{name: getattr(visits, name).tobytes() for name in ("t_s", "vertex", "motion")}),
    ]
    if match is not None:
        arrays = {name: getattr(match, name).tobytes() for name in ("lane", "position_m", "status")}
        messages.append(wire.RoadMatch(lane_ids=b"".join(name.encode() + b"\0" for name in match.lane_ids), **arrays))
    return messages


def test_the_golden_file_of_version_1_loads():
    cognitive_map, provenance = load_map(GOLDEN)
    assert provenance == PROVENANCE
    assert cognitive_map.frame == "network"
    assert cognitive_map.poses.shape == (5, 3)
    assert cognitive_map.view_cell.tolist() == [0, 3, 0, 1, 1]
    assert cognitive_map.road_match.lane_ids == ("straße0_0", "straße1_0", "straße2_0")


@given(seed=st.integers(0, 2**32 - 1), refined=st.booleans(), kind=st.sampled_from(["gradient", "grey"]), cells=st.integers(1, 4))
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_version_1_map_loads_as_it_was(tmp_path, seed, refined, kind, cells):
    cognitive_map = random_map(seed, refined=refined, kind=kind, cells=cells)
    write_v1(tmp_path / "old", cognitive_map, PROVENANCE)
    loaded, provenance = load_map(tmp_path / "old")
    assert_same(loaded, cognitive_map)
    assert provenance == PROVENANCE
    save_map(tmp_path / "new", loaded, provenance)
    save_map(tmp_path / "direct", cognitive_map, PROVENANCE)
    assert (tmp_path / "new").read_bytes() == (tmp_path / "direct").read_bytes()


def test_an_empty_version_1_map_loads(tmp_path):
    empty = random_map(vertices=0, cells=0, edges=0, visits=0, modules=0)
    write_v1(tmp_path / "old", empty, {})
    assert_same(load_map(tmp_path / "old")[0], empty)


@pytest.mark.parametrize(("record", "field"), [(1, "templates"), (3, "poses"), (4, "sigma"), (5, "t_s")])
def test_version_1_arrays_of_the_wrong_size_are_rejected(tmp_path, record, field):
    messages = v1_messages(random_map(), {})
    setattr(messages[record], field, getattr(messages[record], field)[:-1])
    (tmp_path / "old").write_bytes(stream_bytes(1, [message.SerializeToString() for message in messages]))
    with pytest.raises(HippodromeError, match=f"old: format version 1: {field} has"):
        load_map(tmp_path / "old")


def test_version_1_bytes_are_not_read_as_version_2(tmp_path):
    records = [message.SerializeToString() for message in v1_messages(random_map(), {})]
    (tmp_path / "old").write_bytes(stream_bytes(2, records))
    with pytest.raises(HippodromeError):
        load_map(tmp_path / "old")


def test_the_golden_file_is_what_the_writer_writes(tmp_path):
    write_v1(tmp_path / "again", random_map(1, refined=True), PROVENANCE)
    assert_same(load_map(GOLDEN)[0], load_map(tmp_path / "again")[0])
    assert np.frombuffer(GOLDEN.read_bytes(), np.uint8)[8] == 1
