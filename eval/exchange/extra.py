"""Modules that need packages of the extra ``exchange``. They are imported only when their format is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

from hippodrome.eval.exchange.drives.errors import ExchangeError

EXTRA_PACKAGES: Final = ("evo", "foxglove_schemas_protobuf", "lz4", "mcap", "mcap_protobuf", "rerun", "rosbags", "zstandard")


def optional_module(name: str) -> Any:
    """Import a module that may need packages of the extra. Raises ExchangeError that names the missing package and the cure."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in EXTRA_PACKAGES:
            raise
        raise ExchangeError(
            f"the package '{(error.name or '').split('.')[0]}' is missing; install the extra: pip install 'hippodrome[exchange]'"
        ) from None
