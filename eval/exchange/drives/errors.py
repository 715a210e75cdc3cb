"""The error of all exchange with other tools."""

from __future__ import annotations

from hippodrome.core.types import HippodromeError


class ExchangeError(HippodromeError):
    """A folder that cannot be exported, or a foreign drive that cannot be imported."""
