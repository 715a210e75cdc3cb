import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT
from hippodrome.eval.sweep.executors import SweepError
from hippodrome.eval.sweep.grid import Parameter, make_grid, parse_parameter, with_value
from hippodrome.sim.scenario import Scenario

TINY = Scenario(name="tiny")


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text("name: tiny\nseed: 5\n")
    return path


def test_values_are_yaml():
    assert parse_parameter("noise=paper,harsh") == Parameter("noise", ("paper", "harsh"))
    assert parse_parameter("a.b=1,2.5,true,null") == Parameter("a.b", (1, 2.5, True, None))
    assert parse_parameter("px=[32, 64],[16, 32]") == Parameter("px", ([32, 64], [16, 32]))


@pytest.mark.parametrize("text", ["noise", "=1", "a b=1", "a=", "a=[1", "a..b=1"])
def test_what_is_no_parameter(text, scenario, tmp_path, capsys):
    with pytest.raises(ValueError, match="is not KEY=VALUE"):
        parse_parameter(text)
    assert main(["sweep", str(scenario), "--set", text, "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_grid_is_the_product_in_order(scenario):
    cells = make_grid([scenario], [1, 2], [parse_parameter("noise=paper,harsh"), parse_parameter("camera.rate_hz=5,10")])
    assert len({cell.key for cell in cells}) == len(cells) == 8
    assert cells[0].name == "tiny, seed 1, noise=paper, camera.rate_hz=5"
    assert cells[1].name == "tiny, seed 1, noise=paper, camera.rate_hz=10"
    assert (cells[7].scenario.seed, cells[7].scenario.noise, cells[7].scenario.camera.rate_hz) == (2, "harsh", 10.0)


def test_without_seeds_and_parameters_it_is_the_scenario(scenario):
    (cell,) = make_grid([scenario], None, [])
    assert (cell.scenario.seed, cell.label) == (5, "as written")


def test_a_cell_that_is_there_twice(scenario):
    with pytest.raises(SweepError, match="tiny, seed 1, noise=paper: twice"):
        make_grid([scenario], [1], [parse_parameter("noise=paper,paper")])


def test_one_value_of_a_noise_level():
    noise = with_value(TINY, "noise.gyro_bias_degps", 0.5).self_motion_noise
    assert (noise.gyro_bias_degps, noise.scale_wander) == (0.5, TINY.self_motion_noise.scale_wander)


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("speed", 3, "unknown key"),
        ("camera.zoom", 3, "unknown key"),
        ("camera.width", 1, "must be a number of at least 16"),
        ("name.first", 1, "'name' has no keys of its own"),
        ("mapper.memory.view_cells.kind", "colour", "gradient"),
    ],
)
def test_bad_values_name_the_option(key, value, reason):
    with pytest.raises(SweepError, match=rf"--set {key}.*{reason}"):
        with_value(TINY, key, value)
