"""What the means do not say: limits, places that nothing vouches for, doubts after the first fix, false fixes."""

from hippodrome.eval.report.belief import AS_PRINTED
from hippodrome.eval.report.caveats import doubt_lines, false_fix_lines, limit_lines, town_caveats, unvouched_lines
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.results.model import LocalizationSummary, Row
from tests.eval.report.test_player import second_drive
from tests.eval.report.test_report import VERTICES, Page, evidence, row, scenario

NOTHING = ScenarioFiles((), None, None)
NBSP = "\N{NO-BREAK SPACE}"


def drive(known, error_m=1.0, name="topometric", **changes):
    content = second_drive()
    times_s = [float(step) for step in range(VERTICES)]
    columns = {"name": name, "t_s": times_s, "localized": known, "error_m": [error_m] * VERTICES, **changes}
    belief = content.beliefs[0].model_copy(update=columns)
    return ScenarioFiles((), evidence(), None, second=content.model_copy(update={"beliefs": [belief], "looks": ()}))


def plain(words):
    return Page(words).text().replace(NBSP, " ")


def test_limits_are_said_in_words_with_the_towns_in_which_they_hold():
    limits = {"thresholds": {"method": "x", "ape_mean_m": 2.0, "false_fixes": 0, "localization_success": True}}
    sure = LocalizationSummary(definition="d", success=True, false_fixes=0)
    towns = [
        scenario(name, configuration=limits, rows=(row("x", ape_m, localization=sure),))
        for name, ape_m in (("a", 1.0), ("b", 3.0))
    ]
    asked = "x: mean APE at most 2\N{NO-BREAK SPACE}m, false fixes at most 0, second drive localized"
    assert limit_lines(towns) == [f"{asked}: held in a; missed in b."]
    assert limit_lines([scenario("c", configuration={"thresholds": {"method": "x"}}, rows=(row("x", 1.0),))]) == []


def test_vertices_that_nothing_vouches_for_are_counted_with_their_times():
    breaks = [
        {"first_vertex": 3, "last_vertex": 3, "status": "AMBIGUOUS"},
        {"first_vertex": 20, "last_vertex": 29, "status": "AMBIGUOUS"},
    ]
    one = scenario("a", rows=(row("topometric", 1.0, vertices=VERTICES, breaks=breaks),))
    (said,) = unvouched_lines(one, ScenarioFiles((), evidence(), None))
    assert said.replace(NBSP, " ") == (
        f"topometric: 11 of {VERTICES} vertices (numbers 3, 20–29; from 6 to 60 s of the first drive): ambiguous; "
        "the worst place of this map is among them."
    )
    assert unvouched_lines(scenario("a", rows=(row("x", 1.0, breaks=[]),)), NOTHING) == []
    assert unvouched_lines(scenario("a", rows=(row("x", 1.0),)), NOTHING) is None
    assert unvouched_lines(scenario("a", rows=(row("x", 1.0, breaks=[3, {"first_vertex": "x"}]),)), NOTHING) == []


def test_doubts_after_the_first_fix_are_told_with_their_length():
    known = [step >= 5 and not 10 <= step < 14 for step in range(VERTICES)]
    one = scenario("a")
    assert [line.replace(NBSP, " ") for line in doubt_lines(one, drive(known))] == [
        "topometric: 10.0 to 14.0 s into the second drive (4.0 s)."
    ]
    twice = [now and step != 20 for step, now in enumerate(known)]
    assert "2 times, 5.0 s in all, the longest 10.0 to 14.0 s" in doubt_lines(one, drive(twice))[0].replace(NBSP, " ")
    forever = [5 <= step < 10 for step in range(VERTICES)]
    assert "10.0 to 29.0 s into the second drive, its end" in doubt_lines(one, drive(forever))[0].replace(NBSP, " ")
    assert doubt_lines(one, drive([step >= 5 for step in range(VERTICES)])) == []
    assert doubt_lines(one, NOTHING) is None


def test_false_fixes_of_every_localizer_are_counted_and_linked():
    fine = LocalizationSummary(definition="d", success=True, false_fixes=0)
    wrong = LocalizationSummary(definition="d", success=False, false_fixes=3)
    one = scenario("a", rows=(row("topometric", 1.0, localization=fine),), as_printed=Row(method=AS_PRINTED, localization=wrong))
    assert [plain(line) for line in false_fix_lines([one], [NOTHING])] == ["topometric: none.", f"{AS_PRINTED}: 3 in a."]
    files = drive([step >= 5 for step in range(VERTICES)], 29.5, AS_PRINTED, map="topometric")
    said = false_fix_lines([one], [files])[1]
    assert "3 in a, up to 29.50 m off ( see it there )" in plain(said)
    assert [link["href"] for link in Page(said).all("a")] == ["#town=a&drive=2&t=5.0&map=topometric%2C%20networks%20as%20printed"]
    older = scenario("a", rows=one.rows)
    assert "1 in a" in plain(false_fix_lines([older], [files])[1]), "results that lack the figures: what the samples show"
    assert "False fixes: topometric, networks as printed: 3 in a" in plain(town_caveats(one, files))


def test_a_town_without_caveats_says_nothing():
    assert town_caveats(scenario("a", rows=(row("x", 1.0),)), NOTHING) is None
