"""What kept results depend on: the patterns find code, and the keys are a scenario's."""

from hippodrome._files import PACKAGE
from hippodrome.eval.reuse import DRIVE_INDEPENDENT_KEYS, FIGURE_CODE, figure_code_sha256
from hippodrome.eval.sweep.grid import cell_code_sha256
from hippodrome.sim.record import RECORDING_CODE, RecordingPlan
from hippodrome.sim.scenario import Scenario


def test_every_pattern_finds_code():
    for pattern in (*FIGURE_CODE, *RECORDING_CODE):
        assert list(PACKAGE.glob(pattern)), pattern


def test_more_code_makes_another_hash():
    assert len({figure_code_sha256(), figure_code_sha256("eval/cli.py"), cell_code_sha256()}) == 3


def test_no_recording_depends_on_the_keys(tmp_path):
    assert set(DRIVE_INDEPENDENT_KEYS) < set(Scenario.model_fields)
    content = RecordingPlan(Scenario(name="a"), "mapping", tmp_path).content()
    assert not set(DRIVE_INDEPENDENT_KEYS) & set(content)
