"""HTML into which nothing can be injected: all text is escaped, except markup that was made here."""

from __future__ import annotations

import html
from collections.abc import Iterable
from typing import TypeAlias

from pydantic import BaseModel

# Characters that turn the direction of what follows, beyond the name that they stand in: shown by their numbers.
TURNING = {code: f"\\u{code:04x}" for code in (0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))}
VOID = frozenset({"img", "meta", "input", "br"})  # elements without an end tag


class Html(str):
    """Markup. Every other string is text and is escaped when it enters an element."""

    __slots__ = ()


Child: TypeAlias = "str | Html | Iterable[str | Html] | None"


def element(tag: str, /, *children: Child, **attributes: str | int | bool | None) -> Html:
    """One element.

    Args:
        tag: Its name.
        *children: Its content.
        **attributes: Its attributes; a trailing ``_`` of a name is dropped, any other stands for ``-``. False and None leave an
            attribute out.
    """
    start = f"<{tag}{''.join(_attribute(key, value) for key, value in attributes.items())}>"
    return Html(start if tag in VOID else f"{start}{joined(*children)}</{tag}>")


def joined(*children: Child) -> Html:
    """Markup and escaped text, one after the other."""
    return Html("".join(_text(child) for child in children))


def data_script(model: BaseModel) -> Html:
    """A model as JSON for the page's own script, in which no text can end the element."""
    text = model.model_dump_json()
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Html(f'<script type="application/json">{text}</script>')


def _text(child: Child) -> str:
    if child is None:
        return ""
    if isinstance(child, Html):
        return str(child)
    if isinstance(child, str):
        return html.escape(child.translate(TURNING))
    return "".join(_text(part) for part in child)


def _attribute(name: str, value: str | int | bool | None) -> str:
    if value is None or value is False:
        return ""
    key = name.rstrip("_").replace("_", "-")
    return f" {key}" if value is True else f' {key}="{html.escape(str(value))}"'
