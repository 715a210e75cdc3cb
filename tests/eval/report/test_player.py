"""The player in a real browser: every control, addresses that open a place, and data that comes back as it was."""

import json
import re

import cv2
import numpy as np
import pytest

from hippodrome.eval.report.belief import Belief, SecondDrive
from hippodrome.eval.report.report import write_report
from hippodrome.eval.results.model import Results, write_results
from tests.eval.report.test_report import HOSTILE, VERTICES, Page, evidence, scenario

FIX = 6  # sample at which the drive is localized
LIMIT_BYTES = 12_000_000


def second_drive():
    path = evidence().truth.model_dump()
    known = [step >= FIX for step in range(VERTICES)]
    belief = Belief(
        name="topometric", periods_m=(97.0, 131.0, 173.0), **path, heading_rad=[0.1] * VERTICES,
        covariance_m2=[(1.0, 0.2, 2.0) if now else (1e6, 0.0, 1e6) for now in known],
        error_m=[1.5 if now else 80.0 for now in known], localized=known,
        status=[int(now) for now in known], confidence=[2.0] * VERTICES,
        view_s=[30.0] * VERTICES, view_m=[(5.0, 6.0)] * VERTICES,
        head_rad=[[0.1, 0.2]] * VERTICES, head_reliability=[[5.0, 6.0]] * VERTICES,
        grid_rad=[[0.5] * 12] * VERTICES, grid_reliability=[[float(3 + step)] * 12 for step in range(VERTICES)],
    )  # fmt: skip
    tiles = {"t_s": [0.0, 30.0, 60.0], "columns": 2, "width": 16, "height": 12}
    views = [{"view_s": 30.0, "score": 4.5, "off_m": 0.5}, {"view_s": 0.0, "score": 2.0, "off_m": None}]
    looks = [{"method": "topometric", "t_s": path["t_s"][FIX], "views": views}]
    whole = {"truth": path, "frames": tiles, "beliefs": [belief.model_dump()], "looks": looks}
    return SecondDrive.model_validate(whole)


@pytest.fixture
def report(tmp_path):
    write_results(tmp_path / "results.json", Results(scenarios=(scenario("town & co"), scenario(HOSTILE))))
    folder = tmp_path / "town & co"
    folder.mkdir()
    for name in ("thumbnails.jpg", "frames-second.jpg"):
        cv2.imwrite(str(folder / name), np.full((24, 32, 3), 90, np.uint8))
    (folder / "map.json").write_text(evidence().model_dump_json())
    (folder / "belief.json").write_text(second_drive().model_dump_json())
    return write_report(tmp_path)


def after(browser, report, script, address=""):
    """What a script said in the page, by key, and what the console said."""
    tab = browser.open(f"{report.as_uri()}#{address}" if address else report.as_uri())
    said = tab.run(f"""(async () => {{ const said = {{}}, panel = document.querySelector(".panel:not([hidden])");
        const wait = () => new Promise((done) => setTimeout(done, 100)), say = (key, value) => {{ said[key] = String(value); }};
        await wait(); {script}; return said; }})()""")
    console = tab.complaints()
    tab.close()
    return said, console


def test_the_data_comes_back_as_it_was(report):
    page = Page(report.read_text(encoding="utf-8"))
    found = [json.loads(text) for parent, text in page.texts if parent == "script" and text.startswith('{"')]
    assert [SecondDrive.model_validate(one) for one in found if "beliefs" in one] == [second_drive()]
    assert report.stat().st_size < LIMIT_BYTES


def test_a_belief_in_the_map_of_another_method_is_a_choice_of_its_own(browser, report):
    content = second_drive()
    printed = content.beliefs[0].model_copy(update={"name": "as printed", "map": "topometric", "error_m": [7.0] * VERTICES})
    both = content.model_copy(update={"beliefs": [printed, *content.beliefs]})
    (report.parent / "town & co" / "belief.json").write_text(both.model_dump_json())
    script = """const choice = panel.querySelector(".choice"), words = () => panel.querySelector(".moment").textContent;
        say("choices", [...choice.options].map((one) => one.value).join("|")); say("first", words());
        choice.value = "as printed"; choice.dispatchEvent(new Event("change")); await wait(); say("then", words());"""
    said, console = after(browser, write_report(report.parent), script, "town=town%20%26%20co&drive=2&t=40")
    assert console == []
    assert said["choices"].split("|") == ["as printed", "topometric"]
    assert "truly 1.50 m off" in said["first"] and "truly 7.00 m off" in said["then"]


def test_candidates_stand_below_the_worst_moments(report):
    text = Page(report.read_text(encoding="utf-8")).text().replace("\N{NO-BREAK SPACE}", " ")
    assert "This frame alone resembles the views of 30.0 s (score 4.5, 0.5 m off); 0.0 s (score 2.0, no truth)" in text


def test_no_script_makes_markup_of_data(report):
    scripts = "".join(text for parent, text in Page(report.read_text(encoding="utf-8")).texts if parent == "script")
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", scripts)


def test_an_address_opens_a_time_of_the_second_drive(browser, report):
    script = """say("town", panel.dataset.town); say("words", panel.querySelector(".moment").textContent);
        say("part", panel.querySelector(".player").dataset.part);
        say("fired", panel.querySelector(".fired figcaption").textContent);"""
    said, console = after(browser, report, script, "town=town%20%26%20co&drive=2&t=40")
    assert console == []
    assert (said["town"], said["part"]) == ("town & co", "find")
    half_axis_m = 2.4477 * np.sqrt(np.linalg.eigvalsh([[1.0, 0.2], [0.2, 2.0]])[-1])
    assert "Second drive, 40.0 s" in said["words"] and f"95 % sure within {half_axis_m:.2f} m" in said["words"]
    assert "truly 1.50 m off" in said["words"]
    assert said["fired"] == "view of 30.0 s fired; kept frame of 30.0\u00a0s"


WORDS = """const words = () => panel.querySelector(".moment").textContent, choice = panel.querySelector(".choice"),
    playing = () => panel.querySelector(".play").getAttribute("aria-pressed");"""


def test_a_link_shows_the_map_that_it_names_and_its_error(browser, report):
    """On the first drive, too, where the finished map is shown, be it one of a method without a second drive."""
    for name, error in (("topometric", "29.00"), ("dead reckoning", "29.00")):
        script = f"""{WORDS} say("words", words()); say("plays", playing());
            say("part", panel.querySelector(".player").dataset.part);
            panel.querySelector('button[data-part="map"]').click(); await wait(); say("grows", words());"""
        address = f"town=town%20%26%20co&drive=1&t=60.0&map={name.replace(' ', '%20')}"
        said, console = after(browser, report, script, address)
        assert console == [] and said["words"] == f"First drive, 60.0 s{name} is {error} m off here"
        assert (said["part"], said["plays"]) == ("made", "false")
        assert said["grows"].startswith("First drive") and name not in said["grows"]


def test_play_from_here_plays_and_a_link_that_was_followed_before_works_again(browser, report):
    script = f"""{WORDS} const link = panel.querySelectorAll('.place a')[1]; link.click(); await wait(); say("plays", playing());
        say("first", words()); panel.querySelector('.play').click(); panel.querySelector('button[data-part="find"]').click();
        link.click(); await wait(); say("again", words());"""
    said, console = after(browser, report, script, "scenario-1")
    assert console == [] and said["plays"] == "true"
    assert said["first"].startswith("First drive") and said["again"].startswith("First drive")
    tab = browser.open(f"{report.as_uri()}#scenario-1", still=True)
    tab.run("document.querySelectorAll('.place a')[1].click()")
    tab.until("document.querySelector('.moment').textContent.startsWith('First drive')")
    assert tab.run("document.querySelector('.play').ariaPressed") == "false", "less motion is asked for"
    tab.close()


def test_the_parts_have_the_same_names_on_buttons_and_curves_and_the_fourth_begins_with_the_fix(browser, report):
    script = f"""{WORDS} const buttons = [...panel.querySelectorAll("button[data-part]")];
        say("same", buttons.every((one) => PARTS[one.dataset.part] === one.textContent));
        buttons.at(-1).click(); await wait(); panel.querySelector(".play").click(); await wait(); say("words", words());
        say("speeds", [...panel.querySelector(".speed").options].every((one) => /^[\\d.]+× real time$/.test(one.textContent)));
        const story = storyOf(panel), drive = secondDrive(story, "topometric"), fix = drive.localized.indexOf(true);
        say("fix", makeSegments(story, "topometric").find((one) => one.kind === "settled").t0 === drive.t_s[fix]);
        const drives = [{{ ...drive, localized: drive.localized.map(() => false) }}];
        const lost = {{ ...story, second: null, data: {{ ...story.data, drives }} }};
        say("lost", makeSegments(lost, "topometric").map((one) => one.kind).join(" "));"""
    said, console = after(browser, report, script, "scenario-1")
    assert console == [] and (said["same"], said["speeds"], said["fix"]) == ("true", "true", "true")
    assert said["words"].startswith("Second drive") and "localized, 95 % sure" in said["words"]
    assert said["lost"] == "map roads find"


def test_headings_are_linked_at_the_top_of_a_town_and_open_by_address(browser, report):
    script = """const links = [...panel.querySelectorAll(".contents a")];
        say("names", links.map((one) => one.textContent).join("|"));
        say("all", links.length === panel.querySelectorAll("h3").length); say("town", panel.dataset.town);"""
    said, console = after(browser, report, script, "scenario-1-2")
    assert console == [] and (said["all"], said["town"]) == ("true", "town & co")
    assert said["names"].startswith("Mapping|Localization|")


def test_every_control_moves_the_story(browser, report):
    script = """const player = panel.querySelector(".player"), chart = player.querySelector(".chart");
        const at = () => Number(chart.getAttribute("aria-valuenow"));
        const press = async (key) => {
            chart.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true })); await wait(); return at(); };
        const play = player.querySelector(".play");
        if (play.getAttribute("aria-pressed") === "true") play.click();
        say("keys", [await press("Home"), await press("PageUp"), await press("ArrowLeft"), await press("End")].join(" "));
        for (const button of player.querySelectorAll("[data-part]")) {
            button.click(); await wait(); play.click(); await wait(); say(button.dataset.part, player.dataset.part); }
        await press("Home"); player.querySelector(".speed").value = "4"; play.click(); await wait(); await wait();
        say("moved", at() > 0);
        await press(" "); say("paused", play.getAttribute("aria-pressed"));"""
    said, console = after(browser, report, script, "scenario-1")
    assert console == []
    assert said["keys"] == "0 50 45 1000"
    assert [said[f"{part}"] for part in ("map", "roads", "find")] == ["map", "roads", "find"]
    assert (said["moved"], said["paused"]) == ("true", "false")


def test_the_first_tab_compares_and_tabs_go_by_keyboard(browser, report):
    script = """say("first", panel.id); const tabs = [...document.querySelectorAll("[role=tab]")];
        tabs[0].dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true })); await wait();
        say("next", document.querySelector(".panel:not([hidden])").id);
        say("selected", tabs.map((tab) => tab.ariaSelected).join(" "));
        say("cards", document.querySelectorAll(".town").length);"""
    said, console = after(browser, report, script)
    assert console == []
    assert (said["first"], said["next"], said["cards"]) == ("compare", "scenario-1", "1")
    assert said["selected"] == "false true false"


def test_tables_sort_filter_and_are_written_in_four_formats(browser, report):
    script = """const box = panel.querySelector('[aria-label$=": mapping"]'), table = box.querySelector("table");
        const names = () => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => textOf(row.cells[0])).join("|");
        table.querySelectorAll(".sort")[1].click(); say("sorted", names());
        say("best", [...table.querySelectorAll("td.best")].map(textOf)[0]);
        const filter = box.nextElementSibling.querySelector("input"); filter.value = "dead";
        filter.dispatchEvent(new Event("input"));
        say("filtered", names()); say("width", document.documentElement.scrollWidth - innerWidth);
        const cells = [["a", "b (m)"], [["x|y_1", "<0.1"], ['=1+1', '-2']]];
        say("csv", asCsv(...cells)); say("json", asJson(...cells)); say("latex", asLatex(...cells));
        say("markdown", asMarkdown(...cells));"""
    said, console = after(browser, report, script, "scenario-1")
    assert console == []
    assert said["sorted"].split("|")[0] == "topometric" and said["best"] == "0.50"
    assert said["filtered"] == "dead reckoning"
    assert said["csv"].splitlines() == ['"a","b (m)"', '"x|y_1","<0.1"', '"\'=1+1","-2"']
    assert json.loads(said["json"]) == [{"a": "x|y_1", "b (m)": "<0.1"}, {"a": "=1+1", "b (m)": "-2"}]
    assert r"x|y\_1 & $<$0.1 \\" in said["latex"]
    assert r"| x\|y_1 | <0.1 |" in said["markdown"]
    assert int(said["width"]) <= 0
