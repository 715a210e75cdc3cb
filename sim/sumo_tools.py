"""SUMO's own programs, from the ``eclipse-sumo`` package, in processes of their own with bounded time and memory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import IO, Final

import sumo

from hippodrome._folders import temporary_folder
from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError
from hippodrome.sim.xml_head import opened

TOOL_TIMEOUT_S: Final = 120.0  # netconvert takes 0.1 s for a generated town and some 10 s for a city
TOOL_BYTES: Final = 1 << 30  # memory of a program; netconvert takes 0.1 GiB for a generated town
BYTES_PER_INPUT_BYTE: Final = 64  # memory beyond it for large maps: netconvert takes some ten times the size of a city's map
PACKED: Final = 20  # a packed network is some ten times smaller than the same unpacked
CONNECTOR: Final = re.compile(rb"""\sfunction=("connector"|'connector')""")
BLOCK_BYTES: Final = 1 << 20  # of a network that is searched
MAX_COMPLAINT: Final = 500  # characters


def sumo_binary(name: str) -> str:
    """Path of one of the programs in the ``eclipse-sumo`` package."""
    binary = Path(sumo.SUMO_HOME) / "bin" / (f"{name}.exe" if os.name == "nt" else name)
    if not binary.is_file():
        raise HippodromeError(f"{binary}: program missing; reinstall the Python package eclipse-sumo")
    return str(binary)


def run_tool(name: str, *options: str, input_bytes: int = 0) -> None:
    """Runs one of SUMO's programs; its complaint becomes the error.

    Args:
        name: netconvert, netgenerate or sumo.
        options: Its options.
        input_bytes: Size of the file that it reads, by which its memory is bounded (on Linux).

    Raises:
        HippodromeError: It failed, crashed, or took too much time or memory.
    """
    environment = {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}
    command = [sumo_binary(name), *options]
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        encoding="utf-8", errors="replace", preexec_fn=dying_with_me(),
    ) as child:  # fmt: skip
        _limit_memory(child.pid, TOOL_BYTES + BYTES_PER_INPUT_BYTE * input_bytes)
        try:
            _, complaint = child.communicate(timeout=TOOL_TIMEOUT_S)
        except subprocess.TimeoutExpired as error:
            child.kill()
            raise HippodromeError(f"{name}: no answer within {TOOL_TIMEOUT_S:.0f} s; make the network smaller") from error
        except BaseException:
            child.kill()
            raise
    if child.returncode < 0:
        raise HippodromeError(f"{name} crashed (signal {-child.returncode}){_told(complaint)}")
    if child.returncode != 0:
        raise HippodromeError(f"{name} failed ({child.returncode}){_told(complaint)}")


def _told(complaint: str) -> str:
    words = " ".join(complaint.split())
    return f": {words[:MAX_COMPLAINT]}" if words else ""


def _limit_memory(pid: int, size: int) -> None:
    """Bounds what a child may take; its first milliseconds, in which it reads its options, are not bounded."""
    if sys.platform == "linux":
        import resource

        try:
            _, most = resource.prlimit(pid, resource.RLIMIT_AS)
            wanted = size if most == resource.RLIM_INFINITY else min(size, most)
            resource.prlimit(pid, resource.RLIMIT_AS, (wanted, most))
        except OSError:  # it has ended already, or the system forbids it
            return


@contextmanager
def without_comma(net_file: Path) -> Iterator[Path]:
    """A name of a network that SUMO does not take for several files: a link elsewhere if there is a comma in its path."""
    if "," not in str(net_file):
        yield net_file
        return
    with temporary_folder() as folder:
        link = folder / f"town{'.net.xml.gz' if net_file.suffix == '.gz' else '.net.xml'}"
        link.symlink_to(net_file.resolve())
        yield link


def _blocks(stream: IO[bytes]) -> Iterator[bytes]:
    """Whole lines, some thousand at a time: line by line takes ten times as long."""
    return iter(lambda: b"".join(stream.readlines(BLOCK_BYTES)), b"")


@contextmanager
def without_connectors(net_file: Path) -> Iterator[Path]:
    """A network whose roads are all driven alike: a copy if some are connectors, which SUMO strips from the ends of routes."""
    with opened(net_file) as stream:
        there = any(b"connector" in block and CONNECTOR.search(block) for block in _blocks(stream))
    if not there:
        yield net_file
        return
    with temporary_folder() as folder, opened(net_file) as stream, (folder / "town.net.xml").open("wb") as copy:
        copy.writelines(CONNECTOR.sub(b"", block) for block in _blocks(stream))
        copy.close()
        yield folder / "town.net.xml"


def check_that_sumo_reads(net_file: Path) -> None:
    """Lets SUMO read a network in a process of its own first: on some broken files it crashes, which would end this process.

    Raises:
        HippodromeError: SUMO refuses the network, with its reason, or crashes on it.
    """
    about = net_file.stat()
    _try_once(net_file, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=64)
def _try_once(net_file: Path, changed_ns: int, size: int) -> None:  # the same file as it was is not tried again
    try:
        with without_comma(net_file) as named:
            run_tool(
                "sumo", f"--net-file={named}", "--end=0.1", "--step-length=0.1", "--xml-validation=never", "--no-warnings",
                "--no-step-log", "--duration-log.disable", input_bytes=PACKED * size if net_file.suffix == ".gz" else size,
            )  # fmt: skip
    except HippodromeError as error:
        cure = f"mend it in netedit, or write it again: netconvert -s {net_file.name} -o NEW.net.xml"
        raise HippodromeError(f"{net_file}: SUMO cannot drive on it: {error}; {cure}") from error
