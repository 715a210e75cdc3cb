"""The folder that an export or an import makes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hippodrome._files import allowed
from hippodrome._folders import unfinished_folder
from hippodrome.eval.exchange.drives.errors import ExchangeError


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder to fill, which takes the name ``out`` when all is there. Nothing that exists is touched."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ExchangeError(f"{out}: exists already; remove it or choose another --out")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(out) as building:
            yield building
            building.chmod(allowed(0o777))
            building.replace(out)
    except OSError as error:
        raise ExchangeError(f"{out}: cannot be written: {error.strerror or error}") from error
