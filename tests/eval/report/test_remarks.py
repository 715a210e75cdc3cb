"""Sentences for somebody who has not read the paper."""

from hippodrome.eval.report.remarks import given, lede, names, surprises, title
from hippodrome.eval.results.model import ErrorSummary, Results
from tests.eval.report.test_report import Page, row, scenario


def shaped(method, ape_m, shape_m):
    return row(method, ape_m, ape_sim2=ErrorSummary(definition="d", mean_m=shape_m))


def test_the_title_counts_methods_and_towns():
    rows = (row("x", 1.0), row("y", 2.0))
    assert title(Results(scenarios=(scenario("a", rows=rows), scenario("b", rows=rows)))) == (
        "Two mapping methods compared on two simulated towns"
    )
    assert title(Results(scenarios=(scenario("a", rows=rows[:1]),))) == "One mapping method compared on one simulated town"
    assert title(Results(scenarios=())) == "Missions in simulated towns"


def test_the_first_sentence_says_how_much_of_the_roads_was_driven():
    tour = {"mapping": {"coverage": 0.25}}
    assert "on 0.5 of the 2.0\N{NO-BREAK SPACE}km of road" in lede(Results(scenarios=(scenario("a", tours=tour),)))
    assert "in 2.0\N{NO-BREAK SPACE}km of road" in lede(Results(scenarios=(scenario("a"),)))


def test_equal_rows_and_a_better_dead_reckoning_are_explained():
    rows = (shaped("dead reckoning", 10.0, 9.0), shaped("semi-metric", 12.0, 2.0), shaped("semi-metric, no attractor", 12.0, 2.0))
    said = Page(surprises([scenario("a", rows=rows)])).text()
    assert "have the same errors" in said
    assert "nearer to the truth than semi-metric in a (10.00 against 12.00 m; Sim(2): 9.00 against 2.00 m)" in said
    assert surprises([scenario("a", rows=(shaped("dead reckoning", 13.0, 9.0), rows[1]))]) is None


def test_every_row_is_told_what_it_is_given():
    results = Results(scenarios=(scenario("a"),))
    said = Page(given(results)).text()
    assert "topometric: camera, wheels and the road network, but neither start nor scale." in said
    assert "topometric (paper): camera, wheels, the road network and the true starting pose." in said
    assert "semi-metric: camera and wheels, no roads" in said and "dead reckoning: wheels alone" in said
    assert "Taiping Zeng" in names(results, has_printed=True) and "networks as printed" in names(results, has_printed=True)
    assert "networks as printed" not in names(results, has_printed=False)
