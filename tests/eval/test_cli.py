"""The command line speaks to its user: every command and argument says what it is, and every example is a command that exists."""

import argparse
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import get_args

import pytest

from hippodrome.core.localization.beliefs.config import Mode
from hippodrome.eval.cli import main, make_parser
from hippodrome.eval.commands import exchange, trials
from hippodrome.eval.commands.arguments import BAD_INPUT, print_listed
from hippodrome.eval.exchange.export import FORMATS
from hippodrome.eval.exchange.importing import READERS
from hippodrome.eval.exchange.readers.layouts import LAYOUTS
from hippodrome.eval.trials.robustness.conditions import CONDITIONS
from hippodrome.eval.trials.stress.cases import CASES

ROOT = Path(__file__).parents[2]


def parsers(parser, words=("hippodrome",)):
    """Every parser with the words that call it."""
    yield words, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                yield from parsers(inner, (*words, name))


PARSERS = dict(parsers(make_parser()))
EVERY = pytest.mark.parametrize("words", PARSERS, ids=" ".join)


def arguments(parser):
    return [action for action in parser._actions if not isinstance(action, argparse._SubParsersAction)]


def examples(parser):
    return [line.strip() for line in parser.epilog.splitlines() if line.startswith("  hippodrome ")]


def test_all_commands_are_walked():
    assert len(PARSERS) == 1 + 21 + 7


@EVERY
def test_a_command_says_what_it_does_and_shows_how(words):
    parser = PARSERS[words]
    assert len(parser.description.split()) >= 8
    assert parser.description.rstrip().endswith(".")
    assert 1 <= len(examples(parser)) <= 7
    shown = parser.format_help()
    for line in parser.description.splitlines():
        assert "".join(line.split()) in "".join(shown.split())  # wrapped at most
    assert set(shown.splitlines()) >= {f"  {line}" for line in examples(parser)}  # each on a line of its own, to be copied


@EVERY
def test_an_argument_says_what_it_is_and_what_it_is_without_being_given(words):
    for action in arguments(PARSERS[words]):
        assert action.help, action.dest
        assert len(action.help.split()) >= 3, action.dest
        flag = not action.option_strings or action.required or action.nargs == 0
        assert flag or "default:" in action.help, action.dest


@EVERY
@pytest.mark.parametrize("text", ["?!", "", "-1e999", "nan", "9" * 5000])
def test_a_value_that_cannot_be_read_is_answered_with_what_is_wanted(words, text):
    for action in arguments(PARSERS[words]):
        if action.type in (None, Path) or action.choices:  # argparse names the choices itself
            continue
        try:
            action.type(text)
        except argparse.ArgumentTypeError as error:
            assert " is n" in str(error), action.dest  # is not, is neither, is none of
            assert repr(text)[1:40] in str(error), action.dest


@EVERY
def test_examples_are_commands_that_exist(words):
    for line in examples(PARSERS[words]):
        before_redirection = shlex.split(line.split(" > ")[0])
        assert tuple(before_redirection[: len(words)]) == words
        options = make_parser().parse_args(before_redirection[1:])
        named = [*getattr(options, "scenarios", []), *filter(None, [getattr(options, "scenario", None)])]
        for path in named:
            assert path.name == "my-town.yaml" or (ROOT / path).is_file(), line


@pytest.mark.parametrize("given", [[], ["scenario"]])
def test_without_a_command_the_help_is_shown(given, capsys):
    assert main(given) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == PARSERS["hippodrome", *given].format_help()
    assert said.err == ""


def test_version_is_the_packages(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"hippodrome {version('hippodrome')}\n"


def test_names_in_the_help_are_those_of_the_parts():
    assert tuple(FORMATS) == exchange.EXPORTS
    assert {layout.name for layout in LAYOUTS} == set(exchange.IMPORTS) >= set(READERS)
    assert set(get_args(Mode)) == set(trials.MODES)
    assert tuple(CONDITIONS) == trials.CONDITIONS
    assert tuple(case.name for case in CASES) == trials.CASES


def test_modes_by_their_present_and_former_names():
    refine = ["refine", "a", "--network", "n", "--out", "b"]
    for given, mode in (("route", "route"), ("default", "route"), ("paper", "paper")):
        assert make_parser().parse_args([*refine, "--mode", given]).mode == mode
    assert make_parser().parse_args(refine).mode == "route"
    given = make_parser().parse_args(["robustness", "a.yaml", "--modes", "default", "lanes"])
    assert given.modes == ["coupled", "lanes"]
    with pytest.raises(SystemExit):
        make_parser().parse_args([*refine, "--mode", "kalman"])


def test_help_waits_for_no_simulator():
    heavy = {"cv2", "numba", "scipy", "pyrender", "libsumo", "matplotlib", "pydantic"}
    code = f"from hippodrome.eval.cli import make_parser; import sys; make_parser(); print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("text", ["name: [", "name: a\nseeed: 3\ncamera: {rate_hz: fast}\n"])
@pytest.mark.parametrize("words", [["scenario", "validate"], ["eval"], ["render"], ["sweep"]])
def test_faults_of_a_scenario_wait_for_no_algorithm_and_no_simulator(words, text, tmp_path):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    heavy = {"cv2", "google.protobuf", "highway_env", "libsumo", "matplotlib", "numba", "pyproj", "pyrender", "rich", "scipy",
             "shapely", "sumolib", "trimesh"}  # fmt: skip
    call = f"from hippodrome.eval.cli import main; status = main({[*words, str(path)]})"
    code = f"import sys; {call}; print(status, sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.strip() == f"{BAD_INPUT} []" and f"{path}:" in done.stderr


@pytest.mark.parametrize("command", ["eval", "render", "stress", "robustness", "sweep"])
def test_faults_of_a_scenario_are_said_as_validate_says_them_all_at_once(command, tmp_path, capsys):
    path = tmp_path / "broken.yaml"
    path.write_text("name: broken\nseeed: 3\ncamera: {rate_hz: fast}\n")
    said = []
    for words in (["scenario", "validate"], [command]):
        assert main([*words, str(path), *(["--out", str(tmp_path / "out")] if words == [command] else [])]) == BAD_INPUT
        said.append(capsys.readouterr().err)
    assert said[0] == said[1]
    assert "did you mean seed?" in said[0] and "rate_hz" in said[0] and len(said[0].splitlines()) >= 2


def test_a_port_that_is_no_number_is_refused_in_words(capsys):
    with pytest.raises(SystemExit):
        main(["serve", "out", "--port", "abc"])
    assert "'abc' is not a whole number" in capsys.readouterr().err


@pytest.mark.parametrize("columns", [20, 80])
def test_a_list_fits_its_terminal_and_keeps_a_line_elsewhere(capsys, monkeypatch, columns):
    words = "one of ours, with words that go on below it " * 3
    print_listed("name" + " " * 20, words)
    assert capsys.readouterr().out == f"name{' ' * 21}{words.rstrip()}\n"
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    print_listed("name" + " " * 20, words)
    lines = capsys.readouterr().out.splitlines()
    assert all(len(line) <= columns for line in lines) and len(lines) > 1
    assert " ".join(" ".join(lines).split()) == f"name {words.rstrip()}"
