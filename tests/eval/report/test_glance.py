"""The five answers that a reader wants first, from the results alone."""

from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.glance import at_a_glance, best_method
from hippodrome.eval.results.model import LocalizationSummary, Results, Row
from tests.eval.report.test_report import HOSTILE, Page, evidence, row, scenario

NOTHING = ScenarioFiles((), None, None)
FINE = {"configuration": {}}


def town(name, *rows):
    return scenario(name, rows=rows, **FINE)


def localized(drive_s, error_m):
    success = drive_s is not None
    return LocalizationSummary(definition="d", success=success, error_mean_m=error_m, initial_drive_s=drive_s)


def words(results, found=None):
    return Page(at_a_glance(results, found or [NOTHING] * len(results.scenarios))).text()


def test_the_best_method_is_the_one_that_wins_most_towns_and_is_vouched_for():
    guess = row("guess", 0.1, refused="nothing fits")
    results = Results(
        scenarios=(town("a", row("x", 3.0), row("y", 2.0), guess), town("b", row("x", 1.0), row("y", 2.0)),
                   town("c", row("x", 3.0), row("y", 0.5)))
    )  # fmt: skip
    assert best_method(results) == "y"
    said = words(results)
    assert "y has the smallest mean APE in 2 of 3 towns, 0.50 to 2.00" in said
    assert "a: guess: map refused: nothing fits" in said


def test_what_failed_is_said_with_its_cause_and_nothing_else_is():
    assert "Nothing: every method has a map" in words(Results(scenarios=(town("a", row("x", 1.0)),)))
    said = words(Results(scenarios=(town("a", row("x", 1.0), Row(method="z", failure=f"no {HOSTILE}")),)))
    assert f"a: z failed: no {HOSTILE}" in said
    limited = scenario("b", configuration={"thresholds": {"method": "topometric", "ape_mean_m": 0.4}})
    assert "b: limit missed: topometric: APE mean, m is 0.5" in words(Results(scenarios=(limited,)))


def test_no_map_at_all_is_no_best_method():
    results = Results(scenarios=(town("a", Row(method="z", failure="no road")),))
    assert best_method(results) is None
    assert "None: no map was scored" in words(results)


def test_the_second_drive_is_told_for_the_best_method():
    rows = [row("x", 1.0, localization=localized(2.5, 0.4)), row("w", 9.0, localization=localized(90.0, 7.0))]
    lost = row("x", 1.0, localization=localized(None, None))
    said = words(Results(scenarios=(town("a", *rows), town("b", lost)))).replace("\N{NO-BREAK SPACE}", " ")
    assert "In the map of x, it was localized from an unknown start after 2.5 s" in said
    assert "while it declared itself localized, it was 0.40 m off in the mean; it was never localized in b" in said


def test_the_worst_place_is_a_link_that_plays_there():
    page = Page(at_a_glance(Results(scenarios=(town("a & b", row("topometric", 0.5)),)), [ScenarioFiles((), evidence(), None)]))
    assert [link["href"] for link in page.all("a")] == ["#town=a%20%26%20b&drive=1&t=60.0&map=topometric"]
    assert "60.0 s into the first drive, topometric is 29.00 m off" in page.text().replace("\N{NO-BREAK SPACE}", " ")


def test_one_command_makes_all_towns_again():
    said = words(Results(scenarios=(town("a", row("x", 1.0)), town("b c", row("x", 1.0)))))
    assert "hippodrome eval a/scenario.json 'b c/scenario.json' --out again" in said
