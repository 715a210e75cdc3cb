"""Native libraries: their complaints, which go to the process's standard error past Python, and the memory that they keep.
Not public."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

STANDARD_ERROR: Final = 2


@contextmanager
def unheard() -> Iterator[None]:
    """Within the block nothing arrives at the process's standard error.

    libpng and ffmpeg say there what they think of a broken image, in words of their own, before our error says it with its place
    and cure. What other threads write there meanwhile is lost, too, so blocks are short.
    """
    try:
        kept = os.dup(STANDARD_ERROR)
    except OSError:  # closed by who started the process: there is nothing to silence
        yield
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, STANDARD_ERROR)
        os.close(nowhere)
        yield
    finally:
        os.dup2(kept, STANDARD_ERROR)
        os.close(kept)


def give_back_memory() -> None:
    """Give what was freed back to the system, where the C library can (glibc); elsewhere nothing happens.

    glibc keeps what lies below anything that is still in use: after a simulation of 1,000 km of road that is 400 MB, on top of
    which the next stage would take its own. Results do not depend on it. It takes some 10 ms.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
