"""What a finished mission leaves is believed only as it was written: what is cut, changed, swapped or lost is driven anew."""

import json
import shutil

import numpy as np
import pytest

from hippodrome.eval.drive.task import SEAL, _kept, _seal
from tests.changes import change

TIMED = {"figures": {"success": True, "time_s": 74.3, "cause": "arrived", "events": {}}, "cpu_s": 12.5}


@pytest.fixture
def mission(tmp_path):
    file, trace = tmp_path / "a.json", tmp_path / "a.npz"
    np.savez_compressed(trace, columns=np.array(["t_s"]), trace=np.arange(40.0).reshape(-1, 1))
    file.write_text(json.dumps(TIMED | {SEAL: _seal(TIMED, trace)}))
    return file, trace


def test_what_is_whole_is_kept(mission):
    assert _kept(*mission) == TIMED


@pytest.mark.parametrize("text", ["", "[]", "null", "[" * 100_000, "{}", '{"figures": {}}', "\ud800", json.dumps(TIMED),
                                  json.dumps(TIMED | {SEAL: None}), json.dumps({**TIMED, SEAL: "0" * 64})])  # fmt: skip
def test_a_broken_file_is_driven_anew(mission, text):
    mission[0].write_bytes(text.encode("utf-8", "surrogatepass"))
    assert _kept(*mission) is None


def test_changes_of_every_kind_are_found(mission, tmp_path):
    """Either of the two files, broken by the changes of the campaign."""
    whole = [path.read_bytes() for path in mission]
    for seed in range(120):
        rng = np.random.default_rng(seed)
        change(rng, mission[seed % 2])
        now = [path.read_bytes() for path in mission]
        as_it_was = now[1] == whole[1] and same_json(now[0], whole[0])
        assert (_kept(*mission) is not None) == as_it_was, seed
        for path, content in zip(mission, whole, strict=True):
            path.write_bytes(content)
    mission[1].unlink()
    assert _kept(*mission) is None
    shutil.copy(mission[0], mission[1])  # another file in its place
    assert _kept(*mission) is None


def same_json(one, other):
    try:
        return json.dumps(json.loads(one)) == json.dumps(json.loads(other))
    except ValueError:
        return False
