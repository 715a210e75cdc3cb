"""Cognitive maps to and from pbstream files. Wire types stop here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from google.protobuf.message import DecodeError, Message

from hippodrome.core.types import (
    AttractorStates,
    CognitiveMap,
    Edges,
    HippodromeError,
    LaneReadings,
    RoadMatch,
    ViewCells,
    Visits,
)
from hippodrome.proto import cognitive_map_pb2 as wire
from hippodrome.proto.arrays import FieldError, pack, unpack
from hippodrome.proto.checks import MAX_DESCRIPTOR_DIMENSIONS, check_map
from hippodrome.proto.layout import (
    ATTRACTORS,
    EDGES,
    LANE_EXTRAS,
    LANE_READINGS,
    REFINED_VERTICES,
    ROAD_MATCH,
    TEMPLATE_TYPES,
    VERTICES,
    VISITS,
    Layout,
)
from hippodrome.proto.migrate import migrate
from hippodrome.proto.pbstream import PbstreamError, read_stream, write_stream

FORMAT_VERSION: Final = 2
MAX_HEADER_BYTES = 1 << 20  # provenance is names and versions, not data

_FRAMES: Final = {"semi-metric": wire.Header.SEMI_METRIC, "network": wire.Header.NETWORK}
_KINDS: Final = {"gradient": wire.ViewCells.GRADIENT, "grey": wire.ViewCells.GREY}


def save_map(path: Path | str, cognitive_map: CognitiveMap, provenance: Mapping[str, str] | None = None) -> int:
    """Write a map atomically and return its size in bytes. The same map and provenance give the same bytes."""
    path = Path(path)
    try:
        check_map(cognitive_map)
        messages = encode_map(cognitive_map, provenance or {})
    except FieldError as error:
        raise HippodromeError(f"{path}: not written, the map is invalid: {error}") from error
    return write_stream(path, FORMAT_VERSION, [message.SerializeToString(deterministic=True) for message in messages])


def load_map(path: Path | str) -> tuple[CognitiveMap, dict[str, str]]:
    """The map exactly as it was saved, and its provenance. Anything else raises one ``HippodromeError`` naming file and place."""
    path = Path(path)
    version, records = read_stream(path, FORMAT_VERSION)
    try:
        cognitive_map, provenance = decode_map(migrate(_parse(records), version))
        check_map(cognitive_map)
    except (DecodeError, HippodromeError, UnicodeDecodeError) as error:
        raise PbstreamError(f"{path}: format version {version}: {error}; the file is damaged or hostile") from error
    return cognitive_map, provenance


def encode_map(cognitive_map: CognitiveMap, provenance: Mapping[str, str]) -> list[Message]:
    """The messages of format version 2, in file order."""
    header = _encode_header(cognitive_map, provenance)
    if header.ByteSize() > MAX_HEADER_BYTES:
        raise FieldError(f"provenance takes {header.ByteSize()} bytes, the limit is {MAX_HEADER_BYTES}")
    vertices = wire.Vertices(**_packed(cognitive_map, VERTICES, header))
    for field, dtype, dimensions in REFINED_VERTICES:
        if (array := getattr(cognitive_map, field)) is not None:
            setattr(vertices, field, pack(array, dtype, _shape(dimensions, header), field))
    messages: list[Message] = [
        header,
        _encode_view_cells(cognitive_map.view_cells, header),
        wire.Attractors(**_packed(cognitive_map.attractors, ATTRACTORS, header)),
        vertices,
        wire.Edges(**_packed(cognitive_map.edges, EDGES, header)),
        _encode_visits(cognitive_map.visits, header),
    ]
    if (match := cognitive_map.road_match) is not None:
        names = b"".join(lane_id.encode() + b"\0" for lane_id in match.lane_ids)
        messages.append(wire.RoadMatch(lane_ids=names, **_packed(match, ROAD_MATCH, header)))
    return messages


def decode_map(messages: Sequence[Any]) -> tuple[CognitiveMap, dict[str, str]]:
    """The inverse of ``encode_map``."""
    header, view_cells, attractors, vertices, edges, visits = messages[:6]
    refined: dict[str, Any] = {
        field: unpack(getattr(vertices, field), dtype, _shape(dimensions, header), field) if vertices.HasField(field) else None
        for field, dtype, dimensions in REFINED_VERTICES
    }
    cognitive_map = CognitiveMap(
        frame=_named(_FRAMES, header.frame, "frame"),
        **_unpacked(vertices, VERTICES, header),
        view_cells=_decode_view_cells(view_cells, header),
        edges=Edges(**_unpacked(edges, EDGES, header)),
        visits=_decode_visits(visits, header),
        attractors=AttractorStates(**_unpacked(attractors, ATTRACTORS, header)),
        **refined,
        road_match=_decode_road_match(messages[6], header) if header.has_road_match else None,
    )
    return cognitive_map, dict(header.provenance)


def _parse(records: Sequence[bytes]) -> list[Message]:
    if not records or len(records[0]) > MAX_HEADER_BYTES:
        raise FieldError(f"no header, or one larger than {MAX_HEADER_BYTES} bytes")
    header = wire.Header.FromString(records[0])
    types: list[type[Message]] = [wire.ViewCells, wire.Attractors, wire.Vertices, wire.Edges, wire.Visits]
    if header.has_road_match:
        types.append(wire.RoadMatch)
    if len(records) != len(types) + 1:
        raise FieldError(f"{len(records)} records, its header announces {len(types) + 1}")
    return [header, *(kind.FromString(record) for kind, record in zip(types, records[1:], strict=True))]


def _encode_header(cognitive_map: CognitiveMap, provenance: Mapping[str, str]) -> wire.Header:
    match = cognitive_map.road_match
    return wire.Header(
        frame=_FRAMES[cognitive_map.frame],
        provenance=provenance,
        vertices=len(cognitive_map.t_s),
        view_cells=len(cognitive_map.view_cells.templates),
        descriptor_size=len(cognitive_map.view_cells.mean),
        edges=len(cognitive_map.edges.source),
        visits=len(cognitive_map.visits.t_s),
        grid_modules=len(cognitive_map.attractors.grid_period),
        lanes=len(match.lane_ids) if match else 0,
        has_road_match=match is not None,
    )


def _encode_view_cells(cells: ViewCells, header: wire.Header) -> wire.ViewCells:
    templates = pack(cells.templates, TEMPLATE_TYPES[cells.kind], (header.view_cells, header.descriptor_size), "templates")
    mean = pack(cells.mean, "float32", (header.descriptor_size,), "mean")
    return wire.ViewCells(kind=_KINDS[cells.kind], templates=templates, mean=mean, shape=cells.shape)


def _decode_view_cells(message: wire.ViewCells, header: wire.Header) -> ViewCells:
    kind = _named(_KINDS, message.kind, "kind of view cells")
    shape = (header.view_cells, header.descriptor_size)
    if len(message.shape) > MAX_DESCRIPTOR_DIMENSIONS:  # before a tuple of them is made
        raise FieldError(f"descriptor shape has {len(message.shape)} dimensions, the limit is {MAX_DESCRIPTOR_DIMENSIONS}")
    return ViewCells(
        kind=kind,
        templates=unpack(message.templates, TEMPLATE_TYPES[kind], shape, "templates"),
        mean=unpack(message.mean, "float32", (header.descriptor_size,), "mean"),
        shape=tuple(message.shape),
    )


def _encode_visits(visits: Visits, header: wire.Header) -> wire.Visits:
    message = wire.Visits()
    for field, data in _packed(visits, VISITS, header).items():
        setattr(message, field, data)
    if visits.lane is not None:
        known = LANE_READINGS + tuple(extra for extra in LANE_EXTRAS if getattr(visits.lane, extra[0]) is not None)
        message.lane.CopyFrom(wire.LaneReadings(**_packed(visits.lane, known, header)))
    return message


def _decode_visits(message: wire.Visits, header: wire.Header) -> Visits:
    visits = Visits(**_unpacked(message, VISITS, header))
    if message.HasField("lane"):
        known = LANE_READINGS + tuple(extra for extra in LANE_EXTRAS if message.lane.HasField(extra[0]))
        visits = replace(visits, lane=LaneReadings(**_unpacked(message.lane, known, header)))
    return visits


def _decode_road_match(message: wire.RoadMatch, header: wire.Header) -> RoadMatch:
    if message.lane_ids.count(b"\0") != header.lanes or not (message.lane_ids.endswith(b"\0") or header.lanes == 0):
        raise FieldError(f"lane_ids does not hold the {header.lanes} names that the header announces")
    names = message.lane_ids.decode().split("\0")[:-1]
    return RoadMatch(lane_ids=tuple(names), **_unpacked(message, ROAD_MATCH, header))


def _packed(source: object, layout: Layout, header: wire.Header) -> dict[str, bytes]:
    return {field: pack(getattr(source, field), dtype, _shape(dims, header), field) for field, dtype, dims in layout}


def _unpacked(message: Message, layout: Layout, header: wire.Header) -> dict[str, Any]:
    return {field: unpack(getattr(message, field), dtype, _shape(dims, header), field) for field, dtype, dims in layout}


def _shape(dimensions: tuple[str | int, ...], header: wire.Header) -> tuple[int, ...]:
    return tuple(getattr(header, size) if isinstance(size, str) else size for size in dimensions)


def _named(numbers: Mapping[str, int], number: int, what: str) -> Any:
    for name, known in numbers.items():
        if known == number:
            return name
    raise FieldError(f"{what} {number} is unknown")
