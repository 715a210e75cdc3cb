"""How a measured pose enters a belief: with the incumbent, with the challenger, or as a new challenger.

The belief keeps one pose, the incumbent. A measurement that conflicts with it may be an outlier, or tell that the incumbent is
wrong. It is therefore kept as a challenger beside it, until further measurements decide (``core.localization.fix``).
"""

from __future__ import annotations

from hippodrome.core.localization.beliefs.belief import PoseBelief, competes
from hippodrome.core.localization.beliefs.motion import PoseMeasurement
from hippodrome.core.localization.fix import Relation
from hippodrome.core.localization.places import is_same_place
from hippodrome.core.types import FloatArray


def relation_of(
    measurement: PoseMeasurement, belief: PoseBelief, adopted: bool, gate: float, sq_distance: float | None = None
) -> Relation:
    """Which hypothesis of the belief a measured pose agrees with.

    A measurement in the same place as the incumbent agrees with it at any Mahalanobis distance: the difference is then noise,
    and no sign of another hypothesis.

    Args:
        measurement: the measured pose.
        belief: the belief before the measurement.
        adopted: whether the belief has an incumbent yet.
        gate: squared Mahalanobis distance up to which a measurement agrees with a hypothesis.
        sq_distance: that distance of the measurement from the incumbent, where the caller knows it; None computes it here.
    """
    if not competes(belief):
        return Relation.ALL_HYPOTHESES
    if adopted:
        own = belief.sq_distance(measurement) if sq_distance is None else sq_distance
        if own <= gate or is_same_place(belief.pose, measurement.pose):
            return Relation.INCUMBENT
    if belief.challenged and belief.sq_distance(measurement, challenger=True) <= gate:
        return Relation.CHALLENGER
    return Relation.NEITHER


def updated(
    belief: PoseBelief,
    measurement: PoseMeasurement,
    relation: Relation,
    challenger_wins: bool,
    gate: float,
    sq_distance: float | None = None,
) -> PoseBelief:
    """The belief after a measured pose that stands in the given ``relation`` to it.

    ``gate`` and ``sq_distance`` are those of ``relation_of``.
    """
    if not competes(belief):
        return belief.inject(measurement)
    if relation is Relation.INCUMBENT:
        own = belief.sq_distance(measurement) if sq_distance is None else sq_distance
        return belief.inject(_bounded(measurement, own, gate))
    if relation is Relation.CHALLENGER:
        reinforced = belief.reinforce(measurement)
        return reinforced.adopt() if challenger_wins else reinforced
    return belief.challenge(measurement)


def _bounded(measurement: PoseMeasurement, sq_distance: float, gate: float) -> PoseMeasurement:
    """Grow the covariance of a measurement beyond the gate, so that an outlier moves the incumbent only a little.

    ``sq_distance`` is the squared Mahalanobis distance of the measurement from the incumbent. The covariance grows by its ratio
    to ``gate``. The weight of the measurement therefore falls with the squared distance, as under a Student-t likelihood.
    """
    excess = max(1.0, sq_distance / gate)
    covariance: FloatArray = excess * measurement.covariance
    return PoseMeasurement(measurement.pose, covariance)
