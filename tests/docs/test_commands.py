"""Every command that the documents tell a reader to type is one, and those that take seconds are run as they stand there.

Commands are parsed by the real parser: each command, option and choice exists. What stands for a file in the documents is then
replaced by a real one, of the small town that the end-to-end tests drive.
"""

import argparse
import re
import shlex
import shutil
import tomllib
from datetime import UTC, datetime
from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks.same.__main__ import _parser as parser_of_same
from hippodrome.eval.cli import main, make_parser
from hippodrome.eval.sweep.grid import make_grid, parse_parameter
from hippodrome.sim.georeference import read_georeference
from hippodrome.sim.recording import open_recording
from tests.docs.documents import ROOT, documents

DOCUMENTS = pytest.mark.parametrize("page", documents(), ids=str)
PREFIX = re.compile(r"^(?:\.venv/bin/)?hippodrome (?=[a-z-])")
EXPENSIVE = {  # parsed only; what runs them instead
    "eval": "a minute a town; the fixture `run` is one, tests/e2e has others",
    "sweep": "an evaluation a cell; tests/eval/sweep runs small ones",
    "stress": "half a minute a case; tests/eval/trials/stress runs its parts",
    "robustness": "minutes; tests/eval/trials/robustness runs its parts",
    "baselines": "most of an hour; tests/eval/trials/rivals and tests/eval/rivals run short drives",
    "method": "half a minute a method; tests/eval/contest runs its parts",
    "drive": "a map and missions; tests/eval/drive has one in a tiny town",
    "run": "a drive and a map; tests/eval/real runs small ones",
    "serve": "goes on until it is interrupted; tests/eval/report asks it",
    "gate": "an evaluation a seed; tests/eval/gate judges stored results. `gate --power` is run",
}
VALUES = {"N": "1", "MIN": "5", "WxH": "64x48", "FORMAT": "tum"}  # of placeholders that are no files
OF_OTHERS = {  # options of evo and Dask
    "--align", "--align_origin", "--correct_scale", "--delta", "--delta_unit", "--all_pairs", "--pairs_from_reference",
    "--nthreads", "--nworkers",
}  # fmt: skip


# --- reading the documents


def code_lines(page):
    """Lines of code blocks, a command over several lines as one, without comments; and inline code."""
    for block in [*page.blocks, *(text for language, text in page.fences if language not in {"python", "yaml"})]:
        joined = re.sub(r"\n {4,}(?=[\[-])", " ", block)
        yield from (re.sub(r"(^|\s+)# .*", "", line).rstrip() for line in joined.splitlines())
    yield from page.inline


def commands(page):
    """What follows ``hippodrome`` in each command of a page; a diagram's line is none."""
    for line in code_lines(page):
        if PREFIX.match(line) and "->" not in line:
            yield PREFIX.sub("", line.partition(" > ")[0])


def variants(usage):
    """The argument lists that a line of usage stands for: without the optional parts, then with each of them, and each choice."""
    optional = re.findall(r"\[([^\]]*)\]", usage)
    bare = re.sub(r"\s*\[[^\]]*\](\.\.\.)?", "", usage)
    texts = [bare, *(f"{bare} {part}" for group in optional for part in _alternatives(group))]
    for text in texts:
        for one in _choices(text.replace("...", "")):
            yield [VALUES.get(word, word) for word in shlex.split(one)]


def _alternatives(group):
    """``--workers N | --scheduler ADDRESS``; ``--odometry FILE.csv | truth``, where the option is said once."""
    first, *others = group.split(" | ")
    option = first.split()[0]
    return [first, *(other if other.startswith("--") else f"{option} {other}" for other in others)]


def _choices(text):
    """``--from {tum,kitti}`` and ``--axes body|camera``, once for each."""
    if not (found := re.search(r"\{(\w+(?:,\w+)+)\}|(?<= )(\w+(?:\|\w+)+)", text)):
        return [text]
    words = re.split(r"[,|]", found[1] or found[2])
    return [one for word in words for one in _choices(text.replace(found[0], word))]


def parsers():
    """The parser of each command, by its words: ``eval``, ``scenario new``."""
    found = {}
    waiting = [((), make_parser())]
    while waiting:
        words, parser = waiting.pop()
        actions = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        waiting += [((*words, name), sub) for action in actions for name, sub in action.choices.items()]
        found[words] = parser
    return {" ".join(words): parser for words, parser in found.items()}


PARSERS = parsers()


def is_bare(command):
    """Whether it is named without arguments, as in "see `hippodrome eval`"."""
    return command in PARSERS or command.endswith("--help")


# --- parsing


@DOCUMENTS
def test_every_command_is_accepted_by_the_parser(page, capsys):
    for command in commands(page):
        if is_bare(command):
            assert command.removesuffix("--help").strip() in PARSERS
            continue
        for words in variants(command):
            try:
                PARSERS[""].parse_args(words)
            except SystemExit:
                pytest.fail(f"{page}: hippodrome {' '.join(words)}: {capsys.readouterr().err}")
            known = PARSERS[" ".join(words[:2])] if " ".join(words[:2]) in PARSERS else PARSERS[words[0]]
            assert {word for word in words if word.startswith("--")} <= set(known._option_string_actions), f"{page}: {command}"


@DOCUMENTS
def test_every_parameter_of_a_sweep_is_one_and_takes_the_values_shown(page):
    for command in commands(page):
        shown = [parameter for words in variants(command) for parameter in words if re.match(r"[a-z][\w.]*=", parameter)]
        if command.startswith("sweep "):
            make_grid([ROOT / "scenarios/paper.yaml"], None, [parse_parameter(text) for text in dict.fromkeys(shown)])


@DOCUMENTS
def test_every_option_named_alone_is_one(page):
    known = {option for parser in (*PARSERS.values(), parser_of_same()) for option in parser._option_string_actions}
    for code in page.inline:
        words = code.split()
        if words[0].startswith("--") or (len(words) > 1 and words[0] in PARSERS):
            options = [word for word in words if re.match(r"--[a-z]", word)]
            assert set(options) <= known | OF_OTHERS, f"{page}: {code}"


def test_every_command_is_in_the_documents():
    named = {command.split()[0] for page in documents() for command in commands(page)}
    assert {words.split()[0] for words in PARSERS if words} == named


@DOCUMENTS
def test_every_make_target_and_variable_exists(page):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, flags=re.MULTILINE))
    for line in code_lines(page):
        if found := re.match(r"make ([a-z]+)((?: \w+=\S+)*)$", line):
            assert found[1] in targets, f"{page}: {line}"
            for variable in re.findall(r"(\w+)=", found[2]):
                assert f"$({variable})" in makefile, f"{page}: {line}"


def test_the_help_of_make_lists_every_target():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (phony,) = re.findall(r"^\.PHONY: (.*)$", makefile, flags=re.MULTILINE)
    assert set(phony.split()) == set(re.findall(r"^([a-z]+):.*## ", makefile, flags=re.MULTILINE))


@DOCUMENTS
def test_every_module_run_and_every_extra_installed_exists(page):
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for line in code_lines(page):
        for module, arguments in re.findall(r"python -m ([\w.]+) ?(.*)", line):
            assert find_spec(module), f"{page}: {line}"
            if module == "benchmarks.same":
                parser_of_same().parse_args(shlex.split(arguments))
        for named in re.findall(r"hippodrome\[([\w,]+)\]", line):
            assert set(named.split(",")) <= set(extras), f"{page}: {line}"


# --- running


@pytest.mark.parametrize("command", sorted(PARSERS))
def test_every_help_speaks(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*command.split(), "--help"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith("usage: hippodrome")


def cheap_commands():
    """Documented commands with arguments, each once, without its optional parts."""
    found = {}
    for page in documents():
        for command in commands(page):
            words = next(iter(variants(command)))
            if not is_bare(command) and (words[0] not in EXPENSIVE or "--power" in words):
                found.setdefault(tuple(words), str(page))
    return [pytest.param(words, id=f"{page}: {' '.join(words)}") for words, page in found.items()]


def on_earth(network, recording, folder):
    """The network with a place on Earth, and fixes of the drive there, once a second."""
    projection = "+proj=utm +zone=32 +datum=WGS84 +units=m"
    location = (
        f'<location netOffset="-454791,-5425352" projParameter="{projection}" convBoundary="0,0,1,1" origBoundary="0,0,1,1"/>'
    )
    before, _, after = network.read_text().partition("<location")
    (folder / "karlsruhe.net.xml").write_text(before + location + after.partition("/>")[2])
    truth = open_recording(recording).ground_truth()
    keep = np.flatnonzero(np.diff(np.floor(truth.t_s), prepend=-1.0) > 0.0)
    places = read_georeference(folder / "karlsruhe.net.xml").to_lat_lon(truth.poses[keep])
    points = "".join(
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><time>{datetime.fromtimestamp(t_s, UTC).isoformat()}</time></trkpt>'
        for t_s, (lat, lon) in zip(truth.t_s[keep].tolist(), places, strict=True)
    )
    (folder / "phone.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    return folder / "karlsruhe.net.xml", folder / "phone.gpx"


@pytest.fixture(scope="module")
def files(run, tmp_path_factory):
    """What stands for a file in the documents, and a real one."""
    folder = tmp_path_factory.mktemp("documented")
    mapping, drive = (run.recording(role).folder for role in ("mapping", "localization"))
    assert main(["export", str(mapping), "--to", "tum", "--out", str(folder / "tum")]) == 0
    network = next((run.out / "towns").glob("*.net.xml"))
    imported = shutil.copy(
        network, folder / "my_town.net.xml"
    )  # netconvert's own imports are tested in tests/sim/test_map_import.py
    placed, fixes = on_earth(network, mapping, folder)
    return {
        "karlsruhe.net.xml": placed, "phone.gpx": fixes,
        "RECORDING": mapping, "OTHER_RECORDING": drive, "FOLDER": mapping, "DIR": run.out, "A": run.out, "B": run.out,
        "out/eval": run.out, "out/mine": run.out,
        "SOURCE": next(path.parent for path in folder.rglob("rgb.txt")),
        "town.net.xml": network, "FILE": imported, "my_town.osm": imported, "map.osm": imported,
        "semi.pbstream": run.out / "hamlet/semi-metric.pbstream", "topo.pbstream": run.out / "hamlet/topometric-default.pbstream",
        "drive.tum": run.out / "hamlet/topometric-localization.tum",
        "my-town.yaml": run.scenario, "town.yaml": run.scenario, "baseline.json": ROOT / "scenarios/baseline.json",
    }  # fmt: skip


@pytest.mark.parametrize("words", cheap_commands())
def test_a_cheap_command_runs(words, files, run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = [str(files.get(word, word)) for word in words]
    if words[0] == "export" and words[1] != "topo.pbstream":
        arguments[1] = str(files["FOLDER"])
    for place, word in enumerate(words):
        if word == "--figures":
            arguments[place + 1] = str(tmp_path / "figures")
        if word == "--out":  # a new place; a drive that is drawn already is not drawn again
            arguments[place + 1] = str(run.out if words[0] == "render" else tmp_path / words[place + 1])
    assert main(arguments) == 0, capsys.readouterr().err


def test_what_is_not_run_here_says_why():
    assert set(EXPENSIVE) <= {words.split()[0] for words in PARSERS if words}
    for reason in EXPENSIVE.values():
        for path in re.findall(r"tests/[\w/]*\w", reason):
            assert (ROOT / path).exists()


def test_the_program_in_the_readme_runs(run, tmp_path, monkeypatch):
    (program,) = (text for page in documents()[:1] for language, text in page.fences if language == "python")
    shutil.copy(next((run.out / "towns").glob("*.net.xml")), tmp_path / "town.net.xml")
    monkeypatch.chdir(tmp_path)
    names = {
        "observations": run.recording("mapping").observations(),
        "later_observations": run.recording("localization").observations(),
    }
    exec(compile(program, "README.md", "exec"), names)  # the README's own code
    assert any(estimate.localized for estimate in names["estimates"])
