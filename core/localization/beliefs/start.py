"""The belief before the first observation, by mode."""

from __future__ import annotations

from hippodrome.core.localization.beliefs.attractor import AttractorBelief
from hippodrome.core.localization.beliefs.belief import PoseBelief
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.kalman import KalmanBelief
from hippodrome.core.localization.beliefs.lanes import LaneBelief
from hippodrome.core.localization.beliefs.paper import PaperBelief
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError


def start_belief(start_m: FloatArray, log_scale: float, network: RoadNetwork | None, config: BeliefConfig) -> PoseBelief:
    """The belief before the first observation, which knows nothing of the pose.

    Args:
        start_m: any point of the map (2,), from which phases are unwrapped.
        log_scale: ln(metres per map unit) that this drive is expected to have.
        network: the road network; mode "lanes" needs it.
        config: its ``mode`` picks the kind of belief.

    Raises:
        HippodromeError: mode "lanes" without a network.
    """
    if config.mode == "paper":
        return PaperBelief.uniform(start_m, log_scale, config)
    if config.mode == "kalman":
        return KalmanBelief.uniform(start_m, log_scale, config)
    if config.mode == "lanes":
        if network is None:
            raise HippodromeError("localizer mode 'lanes' is a filter on the road network's lanes: give the network (--network)")
        return LaneBelief.uniform(network, log_scale, config)
    return AttractorBelief.uniform(start_m, log_scale, config)
