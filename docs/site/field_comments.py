"""Griffe extension: the comments behind the fields of a class become the section "Attributes" of its docstring.

Fields are described where they are declared, ``points_m: FloatArray  # (P, 2)``; ``docs/scenarios.md`` takes the meaning of a key
from the same place.
"""

from __future__ import annotations

import io
import tokenize
from typing import Any

import griffe

INDENT = "    "


class FieldComments(griffe.Extension):
    """Describes fields by the comment at the end of their line."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Called by Griffe when the members of a class are known."""
        comments = {name: _comment(member) for name, member in cls.members.items() if isinstance(member, griffe.Attribute)}
        lines = [f"{INDENT}{name}: {comment}" for name, comment in comments.items() if comment]
        if not lines or (cls.docstring and "Attributes:" in cls.docstring.value):
            return
        text = cls.docstring.value.rstrip() + "\n\n" if cls.docstring else ""
        cls.docstring = griffe.Docstring(text + "\n".join(["Attributes:", *lines]), parent=cls, parser="google")


def _comment(attribute: griffe.Attribute) -> str:
    """The last comment of a field's declaration."""
    if attribute.is_alias or attribute.lineno is None or attribute.endlineno is None:
        return ""
    lines = attribute.lines_collection[attribute.filepath][attribute.lineno - 1 : attribute.endlineno]
    try:
        tokens = list(tokenize.generate_tokens(io.StringIO("\n".join(lines).strip()).readline))
    except (tokenize.TokenError, IndentationError):
        return ""
    comments = [token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT]
    return comments[-1] if comments else ""
