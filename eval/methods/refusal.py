"""What is to be said of a map that the refinement refused as a whole."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import CognitiveMap, MatchStatus


def refusal_note(cognitive_map: CognitiveMap) -> str | None:
    """The sentence for a topometric map of which no vertex lies on a road; None for every other map."""
    if (cause := _cause(cognitive_map)) is None:
        return None
    return (
        f"nothing vouches for this map: {cause}, so its place on the network is a guess; refine it with the network that was "
        "driven, with --start, or map a longer drive"
    )


def refusal_in_a_row(cognitive_map: CognitiveMap) -> str | None:
    """The same for the row of an evaluation, whose network is the one that was driven, and whose cure is in the scenario."""
    if (cause := _cause(cognitive_map)) is None:
        return None
    return f"{cause}: its place on the network is a guess; drive farther (mapping.tour.length_m), or give a start pose"


def _cause(cognitive_map: CognitiveMap) -> str | None:
    match = cognitive_map.road_match
    if match is None or len(match.status) == 0 or (match.status == MatchStatus.MATCHED).any():
        return None
    names = ", ".join(MatchStatus(int(value)).name.lower().replace("_", " ") for value in np.unique(match.status))
    return f"the refinement refused all of its {len(match.status)} vertices ({names})"
