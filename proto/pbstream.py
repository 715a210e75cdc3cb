"""The pbstream container: framed, compressed records with a count and a checksum. It knows nothing of what they hold.

    magic (8 bytes) | format version (u32)
    per record: compressed length (u32, > 0) | raw length (u32) | zlib stream
    0 (u32) | record count (u32) | CRC-32 of all bytes before it (u32)

Integers are little-endian. A reader allocates nothing that the limits below do not allow.
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError

MAGIC = b"\x89HIPPO\r\n"  # high bit and line end, as in PNG: a transfer in text mode breaks it visibly
COMPRESSION_LEVEL = 6  # fixed: the same map gives the same bytes; 9 saves little and takes several times as long
MAX_FILE_BYTES = 512 << 20  # a map of 100,000 vertices takes about 120 MB
MAX_RAW_BYTES = 512 << 20  # all records together, decompressed
MAX_RECORDS = 64
MAX_INFLATION = 1032  # zlib cannot expand more; a record that claims to is hostile

_U32 = struct.Struct("<I")
_FRAME = struct.Struct("<II")


class PbstreamError(HippodromeError):
    """A file that is not a readable pbstream. The message names file, place and reason."""


def write_stream(path: Path, version: int, records: Sequence[bytes]) -> int:
    """Write all or nothing (a temporary file beside ``path``, synced, then renamed over it) and return the size in bytes."""
    if len(records) > MAX_RECORDS or sum(map(len, records)) > MAX_RAW_BYTES:
        raise PbstreamError(f"{path}: too large to be read back: at most {MAX_RECORDS} records, {MAX_RAW_BYTES >> 20} MiB in all")
    data = stream_bytes(version, records)
    write_atomically(path, data)
    return len(data)


def stream_bytes(version: int, records: Sequence[bytes]) -> bytes:
    """The whole file."""
    parts = [MAGIC, _U32.pack(version)]
    for record in records:
        packed = zlib.compress(record, COMPRESSION_LEVEL)
        parts += [_FRAME.pack(len(packed), len(record)), packed]
    parts.append(_FRAME.pack(0, len(records)))
    body = b"".join(parts)
    return body + _U32.pack(zlib.crc32(body))


def read_stream(path: Path, newest_version: int) -> tuple[int, list[bytes]]:
    """Format version and decompressed records. Every byte of the file is accounted for and checked before any is inflated."""
    data = _read_file(path)
    version = _version(path, data, newest_version)
    frames = _frames(path, data)
    (stored,) = _U32.unpack_from(data, len(data) - _U32.size)
    if zlib.crc32(memoryview(data)[: -_U32.size]) != stored:
        raise PbstreamError(f"{path}: byte {len(data) - _U32.size}: checksum differs, the file is damaged; restore or rebuild it")
    if sum(raw_size for _, _, raw_size in frames) > MAX_RAW_BYTES:
        raise PbstreamError(f"{path}: its records claim more than {MAX_RAW_BYTES >> 20} MiB decompressed, the limit")
    return version, [_inflate(path, number, data, frame) for number, frame in enumerate(frames)]


def _read_file(path: Path) -> bytes:
    try:
        with open(path, "rb", opener=_open_without_waiting) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise PbstreamError(f"{path}: not a regular file")
            if status.st_size > MAX_FILE_BYTES:
                raise PbstreamError(f"{path}: {status.st_size} bytes, the limit is {MAX_FILE_BYTES}")
            magic = file.read(len(MAGIC))
            if magic != MAGIC:
                raise PbstreamError(
                    f"{path}: byte 0: not a hippodrome map (it begins with {magic!r}, expected {MAGIC!r}); "
                    f"name one that `hippodrome map` or `hippodrome refine` wrote"
                )
            return magic + file.read(status.st_size)  # never more than was just measured
    except OSError as error:
        raise PbstreamError(
            f"{path}: cannot be read: {error.strerror or error}; name a map that `hippodrome map` or `hippodrome refine` wrote"
        ) from error


def _open_without_waiting(name: str, flags: int) -> int:
    """A named pipe would block until someone writes to it."""
    return os.open(name, flags | os.O_NONBLOCK)


def _version(path: Path, data: bytes, newest_version: int) -> int:
    version = _u32(path, data, len(MAGIC), "the format version")
    if not 1 <= version <= newest_version:
        raise PbstreamError(
            f"{path}: byte {len(MAGIC)}: format version {version}, this program reads 1 to {newest_version}; "
            "the file is damaged or needs a newer hippodrome"
        )
    return version


def _frames(path: Path, data: bytes) -> list[tuple[int, int, int]]:
    """(offset, compressed length, raw length) of each record, down to the last byte of the file."""
    place, frames = len(MAGIC) + _U32.size, list[tuple[int, int, int]]()
    while (size := _u32(path, data, place, f"the length of record {len(frames)}")) > 0:
        raw_size = _u32(path, data, place + 4, f"the length of record {len(frames)}")
        start = place + _FRAME.size
        if start + size > len(data):
            missing = start + size - len(data)
            raise PbstreamError(f"{path}: byte {start}: truncated or damaged: record {len(frames)} lacks {missing} bytes")
        if raw_size > MAX_INFLATION * size or len(frames) == MAX_RECORDS:
            raise PbstreamError(f"{path}: byte {place}: record {len(frames)} claims an impossible size or is one too many")
        frames.append((start, size, raw_size))
        place = start + size
    count = _u32(path, data, place + 4, "the record count")
    if count != len(frames):
        raise PbstreamError(f"{path}: byte {place + 4}: {len(frames)} records, its footer says {count}; the file is damaged")
    _u32(path, data, place + 8, "the checksum")
    if (excess := len(data) - place - 12) > 0:
        raise PbstreamError(f"{path}: byte {place + 12}: {excess} bytes after the end of the map; the file is damaged")
    return frames


def _inflate(path: Path, number: int, data: bytes, frame: tuple[int, int, int]) -> bytes:
    start, size, raw_size = frame
    inflater = zlib.decompressobj()
    try:
        raw = inflater.decompress(memoryview(data)[start : start + size], raw_size + 1)  # + 1: reach the end, see any excess
    except zlib.error as error:
        raise PbstreamError(f"{path}: byte {start}: record {number} is not a zlib stream: {error}") from error
    if len(raw) != raw_size or not inflater.eof or inflater.unused_data:
        raise PbstreamError(f"{path}: byte {start}: record {number} does not inflate to the {raw_size} bytes it declares")
    return raw


def _u32(path: Path, data: bytes, place: int, what: str) -> int:
    if place + _U32.size > len(data):
        raise PbstreamError(f"{path}: byte {len(data)}: truncated inside {what}")
    (value,) = _U32.unpack_from(data, place)
    return int(value)
