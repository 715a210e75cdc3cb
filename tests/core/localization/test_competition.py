"""How measured poses enter a belief: whom they agree with, and who holds them afterwards."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.localization.beliefs.attractor import AttractorBelief
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.kalman import KalmanBelief
from hippodrome.core.localization.beliefs.motion import PoseMeasurement
from hippodrome.core.localization.beliefs.paper import PaperBelief
from hippodrome.core.localization.competition import relation_of, updated
from hippodrome.core.localization.fix import Relation

GATE = 12.0
COMPETING = pytest.mark.parametrize("belief_type", [AttractorBelief, KalmanBelief])


def measured(x_m, y_m=0.0):
    return PoseMeasurement(np.array([x_m, y_m, 0.0]), np.diag([1.0, 1.0, 0.01]))


def unknown(belief_type):
    return belief_type.uniform(np.zeros(2), 0.0, BeliefConfig())


def at_origin(belief_type):
    return unknown(belief_type).challenge(measured(0.0)).adopt()


@COMPETING
def test_the_first_measurement_is_a_challenger_and_the_second_agrees_with_it(belief_type):
    belief = unknown(belief_type)
    assert relation_of(measured(0.0), belief, False, GATE) is Relation.NEITHER
    belief = updated(belief, measured(0.0), Relation.NEITHER, False, GATE)
    assert relation_of(measured(1.0), belief, False, GATE) is Relation.CHALLENGER
    assert relation_of(measured(90.0), belief, False, GATE) is Relation.NEITHER
    assert updated(belief, measured(1.0), Relation.CHALLENGER, False, GATE).challenged
    adopted = updated(belief, measured(1.0), Relation.CHALLENGER, True, GATE)
    assert not adopted.challenged
    assert_allclose(adopted.pose, [0.5, 0.0, 0.0], atol=0.05)


@COMPETING
def test_an_outlier_in_the_same_place_agrees_with_the_incumbent_and_moves_it_little(belief_type):
    belief, near, outlier = at_origin(belief_type), measured(2.0), measured(12.0)
    assert relation_of(near, belief, True, GATE) is Relation.INCUMBENT
    assert belief.sq_distance(outlier) > GATE
    assert relation_of(outlier, belief, True, GATE) is Relation.INCUMBENT
    assert relation_of(measured(30.0), belief, True, GATE) is Relation.NEITHER
    moved_by_near = updated(belief, near, Relation.INCUMBENT, False, GATE).pose[0]
    moved_by_outlier = updated(belief, outlier, Relation.INCUMBENT, False, GATE).pose[0]
    assert moved_by_near == pytest.approx(1.0, abs=0.05)
    assert moved_by_outlier == pytest.approx(12.0 / 7.0, abs=0.1)  # half the way would be 6 m


@COMPETING
def test_a_conflict_leaves_the_incumbent_where_it_is_until_a_view_agrees_with_it(belief_type):
    belief = updated(at_origin(belief_type), measured(90.0), Relation.NEITHER, False, GATE)
    assert belief.challenged
    assert_allclose(belief.pose, np.zeros(3), atol=1e-9)
    assert relation_of(measured(91.0), belief, True, GATE) is Relation.CHALLENGER
    assert relation_of(measured(1.0), belief, True, GATE) is Relation.INCUMBENT
    assert not updated(belief, measured(1.0), Relation.INCUMBENT, False, GATE).challenged


def test_a_belief_without_challenger_takes_every_measurement_in():
    belief = unknown(PaperBelief)
    assert relation_of(measured(9.0), belief, False, GATE) is Relation.ALL_HYPOTHESES
    assert_allclose(updated(belief, measured(9.0), Relation.ALL_HYPOTHESES, False, GATE).pose[:2], [9.0, 0.0], atol=0.1)
