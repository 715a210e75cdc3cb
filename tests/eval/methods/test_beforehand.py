"""What is known of the odometry's unit and of the roads' accuracy reaches the refinement, by option or with the map."""

import argparse

import pytest

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.types import HippodromeError
from hippodrome.eval.commands.arguments import accuracy_m, units
from hippodrome.eval.methods.beforehand import UNITS, Beforehand, informed


def test_nothing_known_changes_nothing():
    assert informed(RefineConfig(), Beforehand(), {}) == (RefineConfig(), [])


def test_what_is_known_is_set_where_the_algorithms_look_for_it():
    config, lines = informed(RefineConfig(), Beforehand(0.2778, 0.0), {})
    assert (config.route.search.metres_per_unit, config.route.solver.survey_sigma_m, lines) == (0.2778, 0.0, [])


def test_the_unit_said_at_import_is_taken_over_and_said_and_a_later_word_wins():
    config, lines = informed(RefineConfig(), Beforehand(), {UNITS: "1.0"})
    assert config.route.search.metres_per_unit == 1.0 and "1 m, as was said when the drive was imported" in lines[0]
    assert informed(RefineConfig(), Beforehand(2.0), {UNITS: "1.0"})[0].route.search.metres_per_unit == 2.0


def test_what_mode_paper_cannot_heed_is_refused_and_what_it_need_not_is_left():
    with pytest.raises(HippodromeError, match="neither --units nor --network-accuracy"):
        informed(RefineConfig(mode="paper"), Beforehand(1.0), {})
    assert informed(RefineConfig(mode="paper"), Beforehand(), {UNITS: "1.0"}) == (RefineConfig(mode="paper"), [])


@pytest.mark.parametrize("recorded", ["nan", "-1", "0", "inf", "a metre"])
def test_a_record_that_is_no_unit_is_refused(recorded):
    with pytest.raises(HippodromeError, match="give --units"):
        informed(RefineConfig(), Beforehand(), {UNITS: recorded})


@pytest.mark.parametrize("text", ["metre", "", "nan", "0", "-1", "1e9", "inf"])
def test_words_that_are_no_unit(text):
    with pytest.raises(argparse.ArgumentTypeError, match="neither metres nor a number"):
        units(text)


@pytest.mark.parametrize("text", ["good", "nan", "-0.1", "101"])
def test_words_that_are_no_accuracy(text):
    with pytest.raises(argparse.ArgumentTypeError, match="not a number of metres"):
        accuracy_m(text)


def test_words_that_are():
    assert (units("metres"), units("0.2778"), accuracy_m("0"), accuracy_m("2.5")) == (1.0, 0.2778, 0.0, 2.5)
