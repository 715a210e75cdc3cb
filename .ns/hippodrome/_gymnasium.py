"""Makes the environment known to Gymnasium, which calls this when it is imported; hence nothing of ours is imported here."""

from __future__ import annotations

from typing import Final

NAME: Final = "Town-v0"
ENTRY_POINT: Final = "hippodrome.eval.files.town_env:town_env"


def register() -> None:
    """Registers ``hippodrome/Town-v0``; Gymnasium gives the namespace, which is the name of the entry point."""
    from gymnasium.envs.registration import current_namespace, registry
    from gymnasium.envs.registration import register as known

    name = NAME if current_namespace else f"hippodrome/{NAME}"
    if f"hippodrome/{NAME}" not in registry:
        known(id=name, entry_point=ENTRY_POINT)
