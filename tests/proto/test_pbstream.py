import os
import resource
import stat
import struct
import subprocess
import sys
import zlib

import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.proto import pbstream
from hippodrome.proto.pbstream import MAGIC, PbstreamError, read_stream, stream_bytes, write_stream


def framed(*records, count=None, version=1):
    """A file of (raw length, zlib stream) records with a right checksum, whatever they claim."""
    body = MAGIC + struct.pack("<I", version)
    for raw_size, packed in records:
        body += struct.pack("<II", len(packed), raw_size) + packed
    body += struct.pack("<II", 0, len(records) if count is None else count)
    return body + struct.pack("<I", zlib.crc32(body))


def read(tmp_path, data):
    path = tmp_path / "file"
    path.write_bytes(data)
    return read_stream(path, 1)


def test_layout_is_as_documented(tmp_path):
    write_stream(tmp_path / "file", 1, [b"one", b"", b"three"])
    records = [(len(raw), zlib.compress(raw, pbstream.COMPRESSION_LEVEL)) for raw in (b"one", b"", b"three")]
    assert (tmp_path / "file").read_bytes() == framed(*records)
    assert read_stream(tmp_path / "file", 1) == (1, [b"one", b"", b"three"])


def test_wrong_count_is_found(tmp_path):
    with pytest.raises(PbstreamError, match="1 records, its footer says 2"):
        read(tmp_path, framed((3, zlib.compress(b"one")), count=2))


@pytest.mark.parametrize("raw_size", [0, 2, 4])
def test_a_record_must_inflate_to_its_declared_size(tmp_path, raw_size):
    with pytest.raises(PbstreamError, match=f"does not inflate to the {raw_size} bytes"):
        read(tmp_path, framed((raw_size, zlib.compress(b"one"))))


def test_bytes_after_a_zlib_stream_are_found(tmp_path):
    with pytest.raises(PbstreamError, match="does not inflate"):
        read(tmp_path, framed((3, zlib.compress(b"one") + b"x")))


def test_a_record_that_is_no_zlib_stream_is_named(tmp_path):
    with pytest.raises(PbstreamError, match="byte 20: record 0 is not a zlib stream"):
        read(tmp_path, framed((3, b"abcdef")))


def test_an_impossible_inflation_is_refused(tmp_path):
    with pytest.raises(PbstreamError, match="impossible size"):
        read(tmp_path, framed((1 << 30, zlib.compress(b"one"))))


def test_too_many_records_are_refused(tmp_path):
    with pytest.raises(PbstreamError, match="one too many"):
        read(tmp_path, framed(*[(0, zlib.compress(b""))] * (pbstream.MAX_RECORDS + 1)))


def test_records_may_not_claim_more_than_the_limit_in_all(tmp_path):
    packed = b"\0" * 400_000
    with pytest.raises(PbstreamError, match="512 MiB"):
        read(tmp_path, framed((300 << 20, packed), (300 << 20, packed)))


def test_a_bomb_costs_no_more_memory_than_it_declares(tmp_path):
    """A stream that inflates to 400 MiB but declares 1 MiB is refused within 150 MiB of address space beyond the imports."""
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(400)) + packer.flush()
    (tmp_path / "bomb").write_bytes(framed((1 << 20, packed)))
    script = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from hippodrome.proto.pbstream import PbstreamError, read_stream\n"
        "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + (150 << 20),) * 2)\n"
        "try:\n    read_stream(Path(sys.argv[1]), 1)\n"
        "except PbstreamError as error:\n    print(error)\n"
    )
    result = subprocess.run([sys.executable, "-c", script, str(tmp_path / "bomb")], capture_output=True, text=True, check=True)
    assert "does not inflate to the 1048576 bytes" in result.stdout


@pytest.mark.parametrize("make", ["missing", "folder", "pipe", "device"])
def test_what_is_not_a_regular_file_is_refused(tmp_path, make):
    path = tmp_path / "file"
    if make == "folder":
        path.mkdir()
    elif make == "pipe":
        os.mkfifo(path)
    elif make == "device":
        path = type(path)("/dev/zero")
    with pytest.raises(PbstreamError, match=f"{path}: (cannot be read|not a regular file)"):
        read_stream(path, 1)


def test_a_file_over_the_limit_is_not_read(tmp_path):
    path = tmp_path / "file"
    with path.open("wb") as file:
        file.truncate(pbstream.MAX_FILE_BYTES + 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(PbstreamError, match="the limit is"):
        read_stream(path, 1)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_stream(path, 1, [b"old"])
    before = path.read_bytes()
    monkeypatch.setattr(os, "fsync", lambda descriptor: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(HippodromeError, match="file: cannot be written: No space left on device"):
        write_stream(path, 1, [b"new"])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_written_file_is_readable_by_others_and_its_folder_is_made(tmp_path):
    path = tmp_path / "deep" / "er" / "file"
    write_stream(path, 1, [b"x"])
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_stream_bytes_are_the_same_each_time():
    assert stream_bytes(1, [b"abc" * 1000]) == stream_bytes(1, [b"abc" * 1000])
