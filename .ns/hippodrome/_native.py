"""Complaints of native libraries, which write to the process's standard error past Python. Not public."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
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
