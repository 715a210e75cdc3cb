"""JSON that is read back: no object of it names a key twice. For all parts of the package; not public."""

from __future__ import annotations

import json
from typing import Any, Final

LONGEST: Final = 60  # characters of a key that an error repeats


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text. Where an object named a key twice, readers would take one of the two without a word.

    Args:
        text: The text, or its bytes in UTF-8. Its length is bounded by who read it.

    Raises:
        ValueError: It is no UTF-8, no JSON, has a number of thousands of digits, or names a key twice.
        RecursionError: It is nested too deeply.
    """
    return json.loads(text if isinstance(text, str) else text.decode("utf-8"), object_pairs_hook=_once_each)


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [key for key, _ in pairs]
        twice = next(key for number, key in enumerate(names) if key in names[:number])
        raise ValueError(f"the key {twice[:LONGEST]!r} is given twice; remove one")
    return found
