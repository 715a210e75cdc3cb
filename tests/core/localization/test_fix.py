"""The automaton of the fix, transition by transition, on hand-made views."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.fix import (
    Fix,
    PlaceCheck,
    RecognisedView,
    Relation,
    challenger_wins,
    checked,
    faded,
    recognised,
    status,
)
from hippodrome.core.types import LocalizationStatus

CONFIG = LocalizerConfig()  # a fix at 5, doubt at 1.5, z-scores of 2, lost at 6 m
MAP_ERROR = np.diag([1.0, 2.0, 0.1])
NEAR_M, FAR_M = 0.5, 7.0  # standard deviations of the position
LOCALIZED = Fix(adopted=True, support=4.0, place_z=6.0)
SEEN, UNSEEN = PlaceCheck(True, True, 6.0), PlaceCheck(True, True, 0.0)
UNMAPPED_ROAD, FIELD = PlaceCheck(False, True, None), PlaceCheck(False, False, None)


def view(relation, margin=3.0, weight=1.0, sq_lateral_m2=0.0):
    return RecognisedView(relation, margin, weight, MAP_ERROR, sq_lateral_m2)


def seen(fix, *views):
    for one in views:
        fix = recognised(fix, one, CONFIG)
    return fix


def status_of(fix, sigma_m=NEAR_M, config=CONFIG):
    return status(fix, sigma_m, config)


def test_unknown_becomes_localized_when_a_challenger_has_the_evidence_of_a_fix():
    first = seen(Fix(), view(Relation.NEITHER))
    assert (first.challenge, first.adopted) == (3.0, False)
    assert status_of(first) is LocalizationStatus.UNKNOWN
    assert challenger_wins(first, view(Relation.CHALLENGER, margin=2.0), CONFIG)
    second = seen(first, view(Relation.CHALLENGER, margin=2.0))
    assert (second.adopted, second.support, second.challenge, second.place_z) == (True, 5.0, 0.0, None)
    assert second.map_covariance is MAP_ERROR
    assert status_of(second) is LocalizationStatus.LOCALIZED


def test_a_challenger_gathers_evidence_until_it_wins():
    fix = seen(Fix(), view(Relation.NEITHER, margin=2.0), view(Relation.CHALLENGER, margin=2.0))
    assert (fix.challenge, fix.adopted) == (4.0, False)
    assert not challenger_wins(fix, view(Relation.CHALLENGER, margin=0.5), CONFIG)
    assert not challenger_wins(fix, view(Relation.NEITHER, margin=9.0), CONFIG)


def test_another_conflict_begins_a_new_challenge():
    assert seen(Fix(), view(Relation.NEITHER, margin=4.0), view(Relation.NEITHER, margin=2.0)).challenge == 2.0


def test_views_close_together_count_less():
    assert seen(Fix(), view(Relation.NEITHER, margin=4.0, weight=0.25)).challenge == 1.0


def test_old_evidence_fades():
    fix = faded(Fix(support=5.0, challenge=2.0, total=4.0), CONFIG)
    assert (fix.support, fix.challenge, fix.total) == (3.0, 1.2, 4.0)


def test_localized_is_doubted_when_a_challenger_has_more_than_the_incumbent_until_it_fades():
    fix = seen(LOCALIZED._replace(support=1.0), view(Relation.NEITHER, margin=2.0))
    assert status_of(fix) is LocalizationStatus.DOUBTED
    assert status_of(faded(fix, CONFIG)) is LocalizationStatus.LOCALIZED  # 1.2 is less than 1.5
    assert status_of(seen(LOCALIZED, view(Relation.NEITHER, margin=3.9))) is LocalizationStatus.LOCALIZED  # support holds


def test_doubted_becomes_localized_when_a_view_agrees_with_the_incumbent():
    fix = seen(LOCALIZED, view(Relation.NEITHER, margin=4.5), view(Relation.INCUMBENT, margin=3.0))
    assert (fix.challenge, fix.support) == (0.0, 5.0)  # bounded by the evidence of a fix
    assert status_of(fix) is LocalizationStatus.LOCALIZED


def test_doubted_becomes_localized_elsewhere_when_the_challenger_beats_the_incumbents_evidence_too():
    fix = seen(LOCALIZED, view(Relation.NEITHER, margin=4.5), view(Relation.CHALLENGER, margin=4.4))
    assert (fix.challenge, status_of(fix)) == (8.9, LocalizationStatus.DOUBTED)
    fix = seen(fix, view(Relation.CHALLENGER, margin=0.2))  # 9.1 is more than 5 and 4
    assert (fix.challenge, fix.support, fix.place_z, fix.off_roads) == (0.0, 5.0, None, False)
    assert status_of(fix) is LocalizationStatus.LOCALIZED


def test_a_place_that_is_not_what_is_seen_is_doubted_until_it_is_seen_again():
    fix = LOCALIZED
    for _ in range(4):
        fix = checked(fix, UNSEEN, CONFIG)
    assert fix.place_z == pytest.approx(6.0 * 0.8**4)
    assert status_of(fix) is LocalizationStatus.LOCALIZED
    for _ in range(2):
        fix = checked(fix, UNSEEN, CONFIG)
    assert status_of(fix) is LocalizationStatus.DOUBTED
    assert status_of(fix, config=replace(CONFIG, mode="paper")) is LocalizationStatus.LOCALIZED
    assert status_of(checked(fix, SEEN, CONFIG)) is LocalizationStatus.LOCALIZED


def test_the_first_frame_after_a_fix_counts_in_full_and_frames_that_do_not_score_the_place_not_at_all():
    assert checked(LOCALIZED._replace(place_z=None), PlaceCheck(True, True, 3.0), CONFIG).place_z == 3.0
    assert checked(LOCALIZED, PlaceCheck(True, True, None), CONFIG).place_z == 6.0
    assert checked(LOCALIZED._replace(place_z=None), PlaceCheck(True, True, None), CONFIG).place_z is None


def test_localized_and_off_map_follow_the_mapped_roads():
    off = checked(LOCALIZED, UNMAPPED_ROAD, CONFIG)
    assert (status_of(off), off.off_roads, off.place_z) == (LocalizationStatus.OFF_MAP, False, 6.0)
    assert status_of(checked(off, SEEN, CONFIG)) is LocalizationStatus.LOCALIZED


def test_a_place_that_was_just_adopted_is_on_the_map():
    fix = checked(LOCALIZED._replace(place_z=None), FIELD, CONFIG)
    assert (fix.on_map, fix.off_roads) == (True, False)


def test_dead_reckoning_off_all_roads_is_doubted_until_a_view_agrees():
    fix = checked(LOCALIZED, FIELD, CONFIG)
    assert status_of(fix) is LocalizationStatus.DOUBTED
    assert status_of(checked(fix, UNMAPPED_ROAD, CONFIG)) is LocalizationStatus.DOUBTED  # a road reached across a field
    assert status_of(seen(checked(fix, SEEN, CONFIG), view(Relation.INCUMBENT))) is LocalizationStatus.LOCALIZED


def test_a_fix_is_lost_while_the_position_is_too_uncertain():
    assert status_of(LOCALIZED, FAR_M) is LocalizationStatus.LOST
    assert status_of(checked(LOCALIZED, FIELD, CONFIG), FAR_M) is LocalizationStatus.LOST  # whatever else holds
    assert status_of(Fix(), FAR_M) is LocalizationStatus.UNKNOWN  # nothing to lose
    assert status_of(LOCALIZED, NEAR_M) is LocalizationStatus.LOCALIZED


def test_views_disagree_across_the_road_as_a_running_mean():
    fix = seen(LOCALIZED, view(Relation.INCUMBENT, sq_lateral_m2=4.0), view(Relation.INCUMBENT, sq_lateral_m2=4.0))
    assert fix.sq_lateral_m2 == pytest.approx(4.0 * (1.0 - 0.9**2))
    assert seen(LOCALIZED, view(Relation.CHALLENGER, sq_lateral_m2=4.0)).sq_lateral_m2 == 0.0


def test_a_belief_of_all_hypotheses_has_a_fix_for_good_once_its_margins_reach_it():
    fix = seen(Fix(), view(Relation.ALL_HYPOTHESES, margin=3.0, weight=0.1))
    assert (fix.total, fix.adopted) == (3.0, False)
    assert fix.map_covariance is MAP_ERROR
    fix = seen(faded(fix, CONFIG), view(Relation.ALL_HYPOTHESES, margin=2.0))
    assert status_of(fix) is LocalizationStatus.LOCALIZED
    for _ in range(50):
        fix = faded(fix, CONFIG)
    assert status_of(fix) is LocalizationStatus.LOCALIZED
