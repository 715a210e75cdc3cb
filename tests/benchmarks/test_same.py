"""The comparing command: the same results are the same, and one changed bit of any kind is told by name."""

import json
import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from benchmarks.same import commits
from benchmarks.same.__main__ import BAD_INPUT, DIFFERENT, SAME, main
from hippodrome.proto.codec import load_map, save_map
from tests.eval.exchange.results import make_run

RESULTS = {
    "scenarios": [
        {
            "name": "hamlet",
            "configuration": {"refine": {"mode": "default"}},
            "timings": {"mapping_cpu_s": 1.5},
            "rows": [
                {"method": "topometric", "cpu_percent": 0.3, "map_bytes": 900, "ape": {"mean_m": 0.230003, "definition": "APE"}}
            ],
        }
    ]
}


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    root = tmp_path_factory.mktemp("before")
    make_run(root)
    (root / "results.json").write_text(json.dumps(RESULTS))
    (root / "hamlet" / "map.json").write_text(json.dumps({"recordings": {"mapping": "hamlet-mapping-0123456789abcdef"}}))
    (root / "hamlet" / "robustness.json").write_text(json.dumps({"conditions": [{"mode": "default", "nees": 0.5}]}))
    np.savez(root / "hamlet" / "ratslam.npz", codes=np.zeros((3, 2), np.float32))
    return root


@pytest.fixture
def copy(original, tmp_path):
    """Another run, whose recordings have another content key."""
    shutil.copytree(original, tmp_path / "after")
    for role in ("mapping", "localization"):
        recordings = tmp_path / "after" / "recordings"
        (tmp_path / "after/hamlet/map.json").write_text('{"recordings": {"mapping": "hamlet-mapping-fedcba9876543210"}}')
        (recordings / f"hamlet-{role}-0123").rename(recordings / f"hamlet-{role}-0123-fedcba9876543210")
    return tmp_path / "after"


def compared(capsys, before, after):
    status = main([str(before), str(after)])
    printed = capsys.readouterr()
    return status, printed.out + printed.err


def test_the_same_results_are_the_same(original, copy, capsys):
    status, text = compared(capsys, original, copy)
    assert status == SAME
    assert text.endswith("all the same\n")
    frames = next(line.split() for line in text.splitlines() if line.startswith("frames"))
    assert frames == ["frames", "2", "120", "0", "0"]  # two recordings of 30 pairs


def flip_bit_of(array):
    array.view(np.uint8).reshape(-1)[0] ^= 1
    return array


def change_frame(root):
    chunk = next(root.glob("recordings/hamlet-mapping-*/frames-0000.zip"))
    with zipfile.ZipFile(chunk) as archive:
        images = {name: bytearray(archive.read(name)) for name in archive.namelist()}
    images["000007.png"][60] ^= 1
    with zipfile.ZipFile(chunk, "w") as archive:
        for name, image in images.items():
            archive.writestr(name, bytes(image))
    return "hamlet-mapping-0123/frames-0000.zip: 000007.png"


def change_samples(root):
    path = next(root.glob("recordings/hamlet-mapping-*/samples.npz"))
    arrays = dict(np.load(path))
    np.savez(path, **(arrays | {"poses_m": flip_bit_of(arrays["poses_m"])}))
    return "samples.npz: poses_m: 1 of 180 values, first at [0, 0]"


def change_map(root):
    path = root / "hamlet" / "topometric-default.pbstream"
    cognitive_map, _ = load_map(path)
    flip_bit_of(cognitive_map.edges.motion)
    save_map(path, cognitive_map, {"method": "another provenance"})
    return "hamlet/topometric-default.pbstream: edges.motion: 1 of 60 values"


def change_trajectory(root):
    path = root / "hamlet" / "topometric.tum"
    head, first, *rest = path.read_text().splitlines()
    time, x, *others = first.split()
    path.write_text("\n".join([head, " ".join([time, repr(np.nextafter(float(x), 1e9).item()), *others]), *rest]))
    return "hamlet/topometric.tum: poses: 1 of 120 values, first at [0, 1]"


def change_array(root):
    np.savez(root / "hamlet" / "ratslam.npz", codes=np.full((3, 2), -0.0, np.float32))
    return "hamlet/ratslam.npz: codes: 6 of 6 values"


def change_network(root):
    path = next((root / "towns").glob("*.net.xml"))
    path.write_text(path.read_text().replace("1", "2", 1))
    return "towns/grid.net.xml: text"


def change_figure(root):
    (root / "results.json").write_text(json.dumps(RESULTS).replace("0.230003", "0.230004"))
    return "results.json: scenarios[0].rows[0].ape.mean_m: 0.230003 -> 0.230004"


def change_definition(root):
    (root / "results.json").write_text(json.dumps(RESULTS).replace("APE", "RPE"))
    return "scenarios[0].rows[0].ape.definition"


def lose_row(root):
    path = root / "hamlet" / "robustness.json"
    path.write_text('{"conditions": []}')
    return "hamlet/robustness.json: conditions.length: 1 -> 0"


def lose_file(root):
    (root / "hamlet" / "semi-metric.tum").unlink()
    return "hamlet/semi-metric.tum: missing"


CHANGES = (change_frame, change_samples, change_map, change_trajectory, change_array, change_network, change_figure,
           change_definition, lose_row, lose_file)  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_one_changed_bit_is_told_by_name(original, copy, capsys, change):
    place = change(copy)
    status, text = compared(capsys, original, copy)
    assert status == DIFFERENT
    assert place in text


def test_timings_provenance_new_fields_and_new_names_of_modes_are_no_difference(original, copy, capsys):
    results = json.loads(json.dumps(RESULTS))
    (scenario,) = results["scenarios"]
    scenario |= {"configuration": {"refine": {"mode": "route"}}, "timings": {"mapping_cpu_s": 2.0}, "weather": "fog"}
    scenario["rows"][0] |= {"cpu_percent": 0.4, "map_bytes": 901}
    (copy / "results.json").write_text(json.dumps(results))
    (copy / "hamlet" / "robustness.json").write_text(json.dumps({"conditions": [{"mode": "coupled", "nees": 0.5}]}))
    status, text = compared(capsys, original, copy)
    assert status == SAME
    (new,) = (line.split()[-1] for line in text.splitlines() if line.startswith("results.json"))
    assert new == "1"


def test_recordings_of_one_name_are_told_apart_by_what_was_to_be_driven(original, copy, capsys):
    for root, keys in ((original, "ab"), (copy, "ba")):
        for key, seed in zip(keys, (1, 2), strict=True):
            folder = root / "recordings" / f"twin-mapping-{key * 16}"
            folder.mkdir()
            (folder / "manifest.json").write_text(json.dumps({"seed": seed, "tour": {"coverage": 0.1 * seed}}))
    status, _ = compared(capsys, original, copy)
    for folder in original.glob("recordings/twin-*"):
        shutil.rmtree(folder)
    assert status == SAME


def test_bad_input_is_one_line_and_status_2(original, copy, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    status, text = compared(capsys, original, tmp_path / "empty")
    assert (status, text.count("\n")) == (BAD_INPUT, 1)
    (copy / "hamlet" / "topometric-default.pbstream").write_bytes(b"no map")
    status, text = compared(capsys, original, copy)
    assert status == BAD_INPUT
    assert "topometric-default.pbstream" in text
    assert main(["no-such-commit", "HEAD", "--commits"]) == BAD_INPUT


def test_two_commits_are_cloned_set_up_run_and_compared(tmp_path, monkeypatch, capsys):
    """On a repository whose command writes one figure, the number in its file."""
    repository = tmp_path / "repository"
    repository.mkdir()
    (repository / "Makefile").write_text("setup:\n\tmkdir -p .venv/bin && cp command .venv/bin/hippodrome\n")
    (repository / "command").write_text('#!/bin/sh\nfor out; do :; done\nmkdir -p "$out" && cp figure.json "$out/results.json"\n')
    (repository / "command").chmod(0o755)
    git = ["git", "-c", "user.name=one", "-c", "user.email=one@example.org", "-C", str(repository)]
    subprocess.run([*git, "init", "--quiet"], check=True)
    for figure, name in (("1.5", "first"), ("1.5", "same"), ("1.6", "other")):
        (repository / "figure.json").write_text(f'{{"ape": {figure}, "timings": "{name}"}}')
        subprocess.run([*git, "add", "--all"], check=True)
        subprocess.run([*git, "commit", "--quiet", "--allow-empty", "--message", name], check=True)
        subprocess.run([*git, "tag", name], check=True)
    monkeypatch.setattr(commits, "REPOSITORY", repository)
    assert main(["first", "same", "--commits"]) == SAME
    assert main(["first", "other", "--commits", "--keep", str(tmp_path / "kept")]) == DIFFERENT
    assert "eval/results.json: ape: 1.5 -> 1.6" in capsys.readouterr().out
    assert len(list((tmp_path / "kept").glob("*/results/*/results.json"))) == 2 * len(commits.RUNS)
