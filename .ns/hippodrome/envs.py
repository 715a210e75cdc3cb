"""Makes ``hippodrome/Town-v0`` known to Gymnasium when it is imported. Nothing else of hippodrome is imported before it is made.

Before version 1.0 Gymnasium asked installed packages itself, by the entry points ``gymnasium.envs``; now one imports this module,
or names it: ``gymnasium.make("hippodrome.envs:hippodrome/Town-v0")``.
"""

from __future__ import annotations

from typing import Final

from gymnasium.envs.registration import register as _known
from gymnasium.envs.registration import registry as _registry

NAME: Final = "hippodrome/Town-v0"
ENTRY_POINT: Final = "hippodrome.eval.files.town_env:town_env"


def register() -> None:
    """Registers the environment; a second call does nothing."""
    if NAME not in _registry:
        _known(id=NAME, entry_point=ENTRY_POINT)


register()
