"""What is to be said of a map that the refinement refused as a whole."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import CognitiveMap, MatchStatus


def refusal_note(cognitive_map: CognitiveMap) -> str | None:
    """The sentence for a topometric map of which no vertex lies on a road; None for every other map."""
    match = cognitive_map.road_match
    if match is None or len(match.status) == 0 or (match.status == MatchStatus.MATCHED).any():
        return None
    names = ", ".join(MatchStatus(int(value)).name.lower().replace("_", " ") for value in np.unique(match.status))
    return (
        f"nothing vouches for this map: the refinement refused all of its {len(match.status)} vertices ({names}), so its place "
        "on the network is a guess; refine it with the network that was driven, with --start, or map a longer drive"
    )
