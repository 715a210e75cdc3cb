"""Images on disk between the log that they come from and the recording: those of a long drive do not fit in memory."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from functools import partial


class Spool:
    """A file without a name in the system's temporary folder (``TMPDIR``): it is gone with the last frame that refers to it."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  # closed when nobody refers to it any more

    def keep(self, image: bytes) -> Callable[[], bytes]:
        """Put an encoded image on disk; the answer is a function that reads it back."""
        begin = self._file.seek(0, io.SEEK_END)
        self._file.write(image)
        return partial(self._read, begin, len(image))

    def _read(self, begin: int, count: int) -> bytes:
        self._file.seek(begin)
        return self._file.read(count)
