"""Bad input: one clear line, exit status 2, no traceback, nothing overwritten."""

import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT

SCENARIO = "name: tiny\ntown: {kind: grid, width_m: 150, height_m: 150, road_km: 0.8}\n"


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(SCENARIO)
    return path


def refused(capsys, *arguments):
    """The single line that the command prints while refusing."""
    assert main([str(argument) for argument in arguments]) == BAD_INPUT
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert "Traceback" not in lines[0]
    return lines[0]


def test_unknown_key(tmp_path, scenario, capsys):
    scenario.write_text(SCENARIO + "speed: 3\n")
    assert "tiny.yaml:3: speed: unknown key" in refused(capsys, "eval", scenario, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_missing_scenario(tmp_path, capsys):
    assert "none.yaml" in refused(capsys, "eval", tmp_path / "none.yaml", "--out", tmp_path / "out")


def test_two_scenarios_of_one_name(tmp_path, scenario, capsys):
    assert "'tiny'" in refused(capsys, "eval", scenario, scenario, "--out", tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("missing.net.xml", None),
        ("broken.net.xml", "<net><edge id='a'"),
        ("foreign.net.xml", "<html><body/></html>"),
        ("empty.net.xml", ""),
        ("notgzip.net.xml.gz", "plain"),
        ("text.txt", "hello"),
    ],
)
def test_unusable_network(tmp_path, scenario, capsys, name, content):
    network = tmp_path / name
    if content is not None:
        network.write_text(content)
    line = refused(capsys, "eval", scenario, "--network", network, "--workers", 1, "--out", tmp_path / "out")
    assert name in line


@pytest.mark.parametrize("content", [None, b"", b"hello", b"\x00" * 1000])
def test_unusable_map(tmp_path, capsys, content):
    source, out = tmp_path / "in.pbstream", tmp_path / "out.pbstream"
    out.write_bytes(b"precious")
    if content is not None:
        source.write_bytes(content)
    line = refused(capsys, "refine", source, "--network", tmp_path / "x.net.xml", "--out", out)
    assert "in.pbstream" in line
    assert out.read_bytes() == b"precious"


def test_paper_mode_needs_a_start(tmp_path, capsys):
    line = refused(capsys, "refine", tmp_path / "m", "--network", tmp_path / "n", "--mode", "paper", "--out", tmp_path / "o")
    assert "--start" in line


def test_unusable_recording(tmp_path, capsys):
    assert "not a finished recording" in refused(capsys, "map", tmp_path, "--out", tmp_path / "m.pbstream")
