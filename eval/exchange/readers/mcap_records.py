"""The records of an MCAP file one by one: sizes are bounded before memory is taken, checksums verified, and a file that was cut
short is read as far as it goes.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, cast

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from hippodrome._files import open_regular
from hippodrome.eval.exchange.drives.errors import ExchangeError

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")  # opcode and length of a record
MAX_CHUNK_BYTES: Final = 128 << 20  # a chunk unpacked; writers make them of 1 to 4 MB, or of one image
MAX_RECORD_BYTES: Final = 160 << 20  # a record as it lies in the file
MAX_GROWTH: Final = 200  # all chunks unpacked are at most so many times the file, or ``FREE_BYTES`` where that is more
FREE_BYTES: Final = 1 << 30
MAX_RECORDS: Final = 5_000_000  # of all kinds: an hour of a hundred topics at 14 Hz
MALFORMED: Final = (McapError, struct.error, ValueError, KeyError, EOFError, RuntimeError, zstandard.ZstdError, OverflowError)


@dataclass(slots=True)
class Reach:
    """How far a file could be read."""

    bytes: int = 0
    records: int = 0
    cut: bool = False  # the file ends before its end record does


def records(path: Path, reach: Reach) -> Iterator[Schema | Channel | Message]:
    """The schemas, channels and messages of the file, in the order in which they lie in it.

    Raises ExchangeError where a record is damaged, and OSError where the file cannot be read. ``reach`` tells afterwards how far
    the file went.
    """
    size = path.stat().st_size
    with open_regular(path) as stream:
        if (begin := stream.read(len(MAGIC))) != MAGIC:
            raise ExchangeError(f"{path}: not an MCAP file, it begins with {begin!r}")
        checksum, unpacked = zlib.crc32(MAGIC), 0
        while True:
            at = stream.tell()
            reach.bytes = at
            head = stream.read(HEAD.size)
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, size)
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                _require_whole(path, opcode, stream.read(4), checksum)
                _require_end(path, stream, at, size)
                return
            whole = at + HEAD.size + length <= size
            if length > MAX_RECORD_BYTES and whole:
                raise ExchangeError(f"{path}: byte {at}: a record of {length} bytes, the limit is {MAX_RECORD_BYTES}")
            if not whole:
                if _ends_with_magic(stream, size):
                    raise damaged(path, at, f"a record of {length} bytes reaches beyond the end of the file, which is whole")
                stream.seek(at + HEAD.size)
                reach.cut = True
                if opcode == Opcode.CHUNK and size - at < MAX_RECORD_BYTES:
                    yield from _inside(path, at, _unpacked_part(stream.read()), reach, whole=False)
                return
            body = stream.read(length)
            checksum = zlib.crc32(body, zlib.crc32(head, checksum))
            if opcode == Opcode.CHUNK:
                data = _unpacked(path, at, body)
                unpacked += len(data)
                if unpacked > max(FREE_BYTES, MAX_GROWTH * size):
                    raise ExchangeError(
                        f"{path}: unpacked it is more than {unpacked} bytes, {MAX_GROWTH} times its size: no log of a drive"
                    )
                yield from _inside(path, at, data, reach, whole=True)
            elif (record := _record(path, at, opcode, body, reach)) is not None:
                yield record


def _ends_with_magic(stream: IO[bytes], size: int) -> bool:
    """Whether the last bytes are those of a file that was finished."""
    stream.seek(max(0, size - len(MAGIC)))
    return size > 2 * len(MAGIC) and stream.read() == MAGIC


def _require_whole(path: Path, opcode: int, body: bytes, checksum: int) -> None:
    """Raise ExchangeError if the data before the end record are not those that its checksum was made of; 0 is none."""
    if opcode != Opcode.DATA_END or len(body) < 4:
        return
    (said,) = struct.unpack("<I", body)
    if said not in (0, checksum):
        raise damaged(path, len(MAGIC), f"checksum {checksum:08x} of the data, {said:08x} stands at their end")


def _require_end(path: Path, stream: IO[bytes], at: int, size: int) -> None:
    """Raise ExchangeError if something follows the end of the file: a second one, of which nothing would be read.

    Args:
        path: The file, for the error.
        stream: The same, open.
        at: Where its end record begins; a summary may follow it, then the footer and the magic number.
        size: Its bytes.
    """
    for _ in range(MAX_RECORDS):
        stream.seek(at)
        if len(head := stream.read(HEAD.size)) < HEAD.size:
            return  # cut short behind the data, which are whole
        opcode, length = HEAD.unpack(head)
        at += HEAD.size + length
        if opcode == Opcode.FOOTER:
            if (more := size - at - len(MAGIC)) > 0:
                why = "are these two files in one? cut them apart, and import each"
                raise ExchangeError(f"{path}: {more} bytes after its end, which nobody would read; {why}")
            return


def damaged(path: Path, at: int, why: str) -> ExchangeError:
    """The error of a record that is not what was written."""
    return ExchangeError(f"{path}: damaged at byte {at} ({why}); copy it anew, or `mcap recover {path.name}` keeps what is whole")


def _unpacked(path: Path, at: int, body: bytes) -> bytes:
    """The records of a chunk, whose size and checksum hold. Raises ExchangeError."""
    try:
        chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
    except MALFORMED as error:
        raise damaged(path, at, f"no chunk: {one_line(error)}") from None
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise ExchangeError(
            f"{path}: byte {at}: a chunk of {chunk.uncompressed_size} bytes when unpacked, the limit is {MAX_CHUNK_BYTES}; "
            "write it with smaller chunks"
        )
    try:
        data = _decompressed(chunk.compression, chunk.data, chunk.uncompressed_size + 1)
    except MALFORMED as error:
        raise damaged(path, at, f"{chunk.compression or 'plain'}: {one_line(error)}") from None
    if len(data) != chunk.uncompressed_size:
        raise damaged(path, at, f"a chunk of {chunk.uncompressed_size} bytes unpacks to {len(data)} or more")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise damaged(path, at, "the checksum of a chunk does not hold")
    return data


def _unpacked_part(body: bytes) -> bytes:
    """What can be unpacked of a chunk whose end is not there; nobody can verify it."""
    try:
        chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
        return _decompressed(chunk.compression, chunk.data, min(chunk.uncompressed_size, MAX_CHUNK_BYTES))
    except MALFORMED:
        return b""


def _decompressed(compression: str, data: bytes, limit: int) -> bytes:
    """At most ``limit`` bytes of what was compressed. Raises ValueError for a compression that MCAP does not have."""
    if compression == "":
        return data[:limit]
    if compression == "zstd":
        return _piecewise(zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(data), limit)
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=limit))
    raise ValueError(f"compression '{compression[:20]}'")


def _piecewise(stream: Any, limit: int) -> bytes:
    found = bytearray()
    while len(found) < limit and (piece := stream.read(min(1 << 20, limit - len(found)))):
        found += piece
    return bytes(found)


def _inside(path: Path, at: int, data: bytes, reach: Reach, whole: bool) -> Iterator[Schema | Channel | Message]:
    """The records of a chunk that begins at byte ``at`` of the file; of one that is not whole, those that are."""
    place = 0
    while place + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, place)
        place += HEAD.size
        if place + length > len(data):
            if whole:
                raise damaged(path, at, "a record reaches beyond its chunk")
            return
        if (record := _record(path, at, opcode, data[place : place + length], reach)) is not None:
            yield record
        place += length


def _record(path: Path, at: int, opcode: int, body: bytes, reach: Reach) -> Schema | Channel | Message | None:
    """A record that is of use, else None. Raises ExchangeError if it is damaged, or one too many."""
    reach.records += 1
    if opcode == 0 or reach.records > MAX_RECORDS:
        why = "a record of kind 0, which there is not" if opcode == 0 else f"more than {MAX_RECORDS} records"
        raise damaged(path, at, why)
    stream, found = ReadDataStream(io.BytesIO(body)), cast(Schema | Channel | Message | None, None)
    try:
        if opcode == Opcode.SCHEMA:
            found = Schema.read(stream)
        elif opcode == Opcode.CHANNEL:
            found = Channel.read(stream)
        elif opcode == Opcode.MESSAGE:
            found = Message.read(stream, len(body)) if len(body) > 22 else Message(*_empty(body))
    except MALFORMED as error:
        raise damaged(path, at, f"record {opcode}: {one_line(error)}") from None
    return found


def _empty(body: bytes) -> tuple[int, int, bytes, int, int]:
    """The fields of a message without data, in the order of ``Message``."""
    channel, sequence, log_time, publish_time = struct.unpack("<HIQQ", body)
    return channel, log_time, b"", publish_time, sequence


def one_line(error: BaseException) -> str:
    """What an exception says, short and in one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
