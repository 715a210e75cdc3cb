"""JSON that is read back names no key twice, wherever it lies: one of the two would be believed without a word."""

import json
import os
import re

import pytest

from hippodrome._json import parse_json
from hippodrome.eval.gate.baseline import GateError, baseline_of, read_baseline, write_baseline
from hippodrome.eval.report.belief import read_second_drive
from hippodrome.eval.report.evidence import read_map_evidence
from hippodrome.eval.report.files import read_picture
from hippodrome.eval.report.why import read_why
from hippodrome.eval.results.model import ResultsError, read_results, write_results
from hippodrome.eval.trials.stress.run import _kept_row
from tests.eval.exchange import subjects
from tests.eval.results.test_model import results
from tests.test_more_inputs import answer

KEPT = {"why.json": read_why, "belief.json": read_second_drive, "map.json": read_map_evidence, "row.json": _kept_row}


@pytest.mark.parametrize(("text", "said"), [
    ('{"a": 1, "a": 2}', "the key 'a' is given twice; remove one"),
    ('[{"b": {"c": 1, "d": [], "c": 1}}]', "the key 'c' is given twice"),
    ('{"\\u0061": 1, "a": 1}', "the key 'a' is given twice"),
    ('{"' + 500 * "x" + '": 1, "' + 500 * "x" + '": 1}', "^.{0,120}$"),
    ('{"\\u001b[31m": 1, "\\u001b[31m": 1}', r"\\x1b"),
    (b"\xff{}", "utf-8"),
])  # fmt: skip
def test_a_key_twice_is_refused_with_its_name(text, said):
    with pytest.raises(ValueError, match=said):
        parse_json(text)


def test_the_same_key_in_two_objects_is_none_twice():
    text = '{"a": {"a": 1}, "b": [{"a": 1}, {"a": 2}]}'
    assert parse_json(text.encode()) == json.loads(text)


def doubled(path, key):
    """The key's first entry once more, with its value: nothing else differs."""
    text = path.read_text()
    found, entry = re.subn(rf'("{key}": *[^,\n}}]+)', r"\1, \1", text, count=1), path
    assert found[1] == 1
    entry.write_text(found[0])


def test_results_and_baselines(tmp_path, capsys):
    for folder in "ab":
        write_results(tmp_path / folder / "results.json", results())
    doubled(tmp_path / "b" / "results.json", "mean_m")
    for command in (("compare", tmp_path / "a", tmp_path / "b"), ("report", tmp_path / "b"),
                    ("board", tmp_path / "b", "--out", tmp_path / "x.html")):  # fmt: skip
        status, said = answer(capsys, *command)
        assert status == 2 and "the key 'mean_m' is given twice; remove one" in said
    write_baseline(tmp_path / "base.json", baseline_of([results()]))
    doubled(tmp_path / "base.json", "value")
    status, said = answer(capsys, "gate", "--power", "--baseline", tmp_path / "base.json")
    assert status == 2 and "the key 'value' is given twice" in said


@pytest.mark.parametrize("value", ["true", "false"])
def test_true_and_false_are_no_figures(tmp_path, value):
    path = tmp_path / "results.json"
    write_results(path, results())
    path.write_text(re.sub(r'("mean_m": ?)[-0-9.e]+', rf"\g<1>{value}", path.read_text()))
    with pytest.raises(ResultsError, match=r"mean_m: must be a number"):
        read_results(path)
    write_baseline(path, baseline_of([results()]))
    path.write_text(re.sub(r'("value": ?)[-0-9.e]+', rf"\g<1>{value}", path.read_text()))
    with pytest.raises(GateError, match=r"value: must be a number"):
        read_baseline(path)


@pytest.mark.parametrize("name", KEPT)
def test_what_lies_beside_results(tmp_path, name):
    path = tmp_path / name
    path.write_text('{"places": [], "places": []}')
    with pytest.raises(ResultsError, match=rf"{name}: .*the key 'places' is given twice; remove one; .* again|makes it anew"):
        KEPT[name](path)
    path.write_text('{"nobody": 1}')
    with pytest.raises(ResultsError, match=rf"{name}: not "):
        KEPT[name](path)
    for text in ("[" * 100_000, "9" * 5000, "\ud800".encode("utf-8", "surrogatepass")):
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(ResultsError):
            KEPT[name](path)


@pytest.mark.parametrize("name", [*KEPT, "maps.png"])
def test_devices_and_named_pipes_beside_results_keep_nobody_waiting(tmp_path, name):
    read = KEPT.get(name, read_picture)
    os.mkfifo(tmp_path / name)
    with pytest.raises(ResultsError, match=r"not a regular file|Invalid"):
        read(tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(ResultsError, match=r"not a regular file|Invalid"):
        read(tmp_path / name)


def test_other_tools_too(tmp_path, capsys):
    subjects._tub(tmp_path / "tub")
    catalog = tmp_path / "tub" / "catalog_0.catalog"
    catalog.write_text(catalog.read_text().replace('{"', '{"_index": 0, "', 1))
    status, said = answer(capsys, "import", tmp_path / "tub", "--out", tmp_path / "out")
    assert status == 2 and "line 1: not a JSON record: the key '_index' is given twice" in said
