"""One table knows the methods; labels of other versions still get a method."""

import pytest

from hippodrome.eval.methods.method import METHODS, ORBSLAM3, REFINED, TOPOMETRIC, Method, method_of


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.key)
def test_a_method_is_found_by_its_label(method):
    assert method_of(method.label) is method


def test_keys_labels_and_files_are_told_apart():
    for field in ("key", "label", "stem"):
        assert len({getattr(method, field) for method in METHODS}) == len(METHODS)
    maps = [method.map_file for method in METHODS if method.map_file is not None]
    assert len(set(maps)) == len(maps)
    assert all(method.mode is not None and method.frame == "network" for method in REFINED)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.key)
def test_files_are_named_after_the_label(method):
    """As for labels that the table does not have: a method may join or leave it, and its files stay where they are."""
    stem = method_of(f"{method.label} ").stem
    assert stem == f"{method.stem}-"


def test_an_unknown_label_has_a_frame_of_its_own():
    assert method_of("LIO, tuned (2)") == Method("LIO-tuned-2", "LIO, tuned (2)", "own", "LIO-tuned-2")


def test_an_unknown_label_that_begins_with_a_known_one_is_its_variant():
    tuned = method_of("topometric (tuned)")
    assert (tuned.frame, tuned.alignment, tuned.system, tuned.mode) == ("network", "none", TOPOMETRIC.label, None)
    assert (method_of("ORB-SLAM3 (Binocular)").alignment, method_of("ORB-SLAM3 (live) x").system) == ("se2", ORBSLAM3.label)
