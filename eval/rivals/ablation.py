"""The mapper without its attractor networks. What they cost is the difference; what they are for is localization."""

from __future__ import annotations

from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.mapping.memory import Recognition
from hippodrome.core.mapping.networks import NeuralPose
from hippodrome.core.types import Observation


class MapperWithoutAttractor(Mapper):
    """The mapper with head-direction and grid cells left out: all that drives them or reads them does nothing."""

    def _integrate_paths(self, observation: Observation) -> None:
        pass

    def _reactivate(self, recognitions: list[Recognition]) -> None:
        pass

    def _reckoned_states(self) -> list[NeuralPose]:
        return []
