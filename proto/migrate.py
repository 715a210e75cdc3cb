"""Older format versions brought up to date, one step at a time, as messages.

Version 1 wrote arrays as they lie in memory (little-endian, not byte-transposed), and no counts in the header: a
reader had to infer them. Version 2 is what ``cognitive_map.proto`` describes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from google.protobuf.message import Message

from hippodrome.proto import cognitive_map_pb2 as wire
from hippodrome.proto.arrays import FieldError, pack
from hippodrome.proto.layout import ATTRACTORS, EDGES, REFINED_VERTICES, ROAD_MATCH, VERTICES, VISITS, Layout


def migrate(messages: Sequence[Message], version: int) -> list[Message]:
    """The messages of a file of format ``version`` as those of the newest."""
    current = list(messages)
    if version < 2:
        current = _from_1_to_2(current)
    return current


def _from_1_to_2(messages: Sequence[Any]) -> list[Message]:
    header, view_cells, attractors, vertices, edges, visits, *road_match = messages
    counted = wire.Header(
        frame=header.frame,
        provenance=header.provenance,
        vertices=len(vertices.t_s) // 8,
        view_cells=len(view_cells.templates) // max(len(view_cells.mean) // 4, 1),
        descriptor_size=len(view_cells.mean) // 4,
        edges=len(edges.kind),
        visits=len(visits.t_s) // 8,
        grid_modules=len(attractors.grid_period) // 4,
        lanes=road_match[0].lane_ids.count(b"\0") if road_match else 0,
        has_road_match=bool(road_match),
    )
    return [
        counted,
        _transposed(view_cells, (("mean", "float32", ()),)),  # templates are single bytes: nothing to transpose
        _transposed(attractors, ATTRACTORS),
        _transposed(vertices, VERTICES + REFINED_VERTICES),
        _transposed(edges, EDGES),
        _transposed(visits, VISITS),
        *(_transposed(match, ROAD_MATCH) for match in road_match),
    ]


def _transposed(message: Any, layout: Layout) -> Any:
    """A copy with each array of the layout that is present byte-transposed."""
    upgraded = type(message)()
    upgraded.CopyFrom(message)
    for field, dtype, _ in layout:
        if data := getattr(message, field):
            array = _flat(data, dtype, field)
            setattr(upgraded, field, pack(array, dtype, array.shape, field))
    return upgraded


def _flat(data: bytes, dtype: str, name: str) -> Any:
    if len(data) % np.dtype(dtype).itemsize:
        raise FieldError(f"{name} has {len(data)} bytes, no multiple of {np.dtype(dtype)}")
    return np.frombuffer(data, dtype=np.dtype(dtype).newbyteorder("<")).astype(dtype)
