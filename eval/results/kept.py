"""Files beside ``results.json`` that a run keeps as JSON, read back as if anybody had written them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from hippodrome._files import read_bounded, why_unreadable
from hippodrome._json import parse_json
from hippodrome.eval.results.model import MAX_BYTES, ResultsError
from hippodrome.sim.key_words import first_fault


def read_kept(path: Path, kind: Any, complaint: str, cure: str) -> Any:
    """The content of a JSON file.

    Args:
        path: The file; of at most ``MAX_BYTES``.
        kind: The model or type that it holds.
        complaint: What an error says of a file that is none: "not a readable second drive".
        cure: And what makes it anew: "run `hippodrome eval` again".

    Raises:
        ResultsError: It cannot be read, names a key twice, or does not hold what it should.
    """
    try:
        data = read_bounded(path, MAX_BYTES)
        content = parse_json(data)  # the reader below would take one of two keys of a name without a word
        return TypeAdapter(kind).validate_json(data)
    except ValidationError as error:
        raise ResultsError(f"{path}: {complaint}: {first_fault(error, content)}; {cure}") from error
    except (OSError, ValueError, RecursionError) as error:
        raise ResultsError(f"{path}: {complaint}: {why_unreadable(error)}; {cure}") from error
