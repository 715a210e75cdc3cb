"""What a foreign program may take of time, memory and disk."""

from __future__ import annotations

import contextlib
import resource
from dataclasses import dataclass
from typing import Final

from hippodrome.sim.method_spec import MethodSpec

MEGABYTE: Final = 1_000_000
# Address space over memory. Programs reserve much that they never touch: ORB-SLAM3 53 GB at once, late in a long drive, where
# it holds 4 GB; runtimes with a heap of their own do so from their start. It is a backstop for what is taken between two looks.
ADDRESS_SPACE: Final = 16
FILE_BYTES: Final = 4 << 30  # the longest file that a program may write, its printed text included


@dataclass(frozen=True, slots=True)
class Limits:
    """What a program may take."""

    time_s: float
    memory_bytes: int  # that all its processes hold together
    disk_bytes: int = 8_000 * MEGABYTE  # that it may keep on disk
    stall_s: float | None = None  # how long it may do no work: its threads wait for one another, say; None: for ever

    @classmethod
    def of(cls, spec: MethodSpec) -> Limits:
        """Those that a scenario sets for a method."""
        memory_bytes, disk_bytes = (round(limit * MEGABYTE) for limit in (spec.memory_limit_mb, spec.disk_limit_mb))
        return cls(spec.time_limit_s, memory_bytes, disk_bytes, spec.stall_limit_s)

    @property
    def address_bytes(self) -> int:
        """The address space that each of its processes may reserve."""
        return ADDRESS_SPACE * self.memory_bytes

    @property
    def file_bytes(self) -> int:
        """The longest file that it may write."""
        return min(FILE_BYTES, self.disk_bytes)


def limit(pid: int, limits: Limits) -> None:
    """Limits of the system for a process that has just begun; it and its children keep them."""
    with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
        resource.prlimit(pid, resource.RLIMIT_AS, (limits.address_bytes, limits.address_bytes))
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (limits.file_bytes, limits.file_bytes))
        resource.prlimit(pid, resource.RLIMIT_CORE, (0, 0))
