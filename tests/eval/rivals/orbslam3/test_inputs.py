"""What ORB-SLAM3 is given: a vocabulary in DBoW2's text format, and settings that describe the camera."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core.types import HippodromeError
from hippodrome.eval.rivals.orbslam3.settings import settings_text
from hippodrome.eval.rivals.orbslam3.vocabulary import orb_descriptors, to_text, train
from hippodrome.sim.render.camera import CameraSpec

CAMERA = CameraSpec(width=640, height=480, rate_hz=11.192, stereo_baseline_m=0.5)


def clustered_descriptors(clusters, each, rng, flips=6):
    """``each`` noisy copies of every one of ``clusters`` random descriptors, shuffled, and which image each is from."""
    centres = rng.integers(0, 2, (clusters, 256), dtype=np.uint8)
    bits = np.repeat(centres, each, axis=0)
    for row in bits:
        row[rng.choice(256, flips, replace=False)] ^= 1
    order = rng.permutation(len(bits))
    return np.packbits(bits[order], axis=1), np.arange(len(bits), dtype=np.int32) // 20


def parsed(text):
    head, *lines = text.split("\n")
    rows = [line.split() for line in lines]
    return [int(n) for n in head.split()], rows


@pytest.fixture(scope="module")
def trained():
    descriptors, image = clustered_descriptors(30, 40, np.random.default_rng(0))
    return train(descriptors, image, np.random.default_rng(1), branching=6, depth=4), descriptors


def test_the_text_is_dbow2_s(trained):
    vocabulary, _ = trained
    text = to_text(vocabulary)
    head, rows = parsed(text)
    assert head == [6, 4, 0, 0]
    assert not text.endswith("\n")
    assert all(len(row) == 2 + 32 + 1 for row in rows)
    assert len(rows) <= (6**5 - 1) // 5
    for number, row in enumerate(rows, start=1):
        assert 0 <= int(row[0]) < number  # breadth first: a parent comes before its children
        assert row[1] in ("0", "1")
        assert all(0 <= int(byte) <= 255 for byte in row[2:34])
    parents = [int(row[0]) for row in rows]
    assert parents == sorted(parents)


def test_leaves_have_weights_and_no_children_and_inner_nodes_have_both_no_weight_and_children(trained):
    vocabulary, _ = trained
    numbers = np.arange(1, len(vocabulary.parent) + 1)
    has_children = np.isin(numbers, vocabulary.parent)
    assert_array_equal(has_children, ~vocabulary.is_leaf)
    assert np.all(vocabulary.weight[vocabulary.is_leaf] > 0)
    assert np.all(vocabulary.weight[~vocabulary.is_leaf] == 0)
    assert np.bincount(vocabulary.parent).max() <= vocabulary.branching


def descend(vocabulary, descriptor):
    """The word of a descriptor, as DBoW2 finds it."""
    bits, node = np.unpackbits(descriptor), 0
    while True:
        children = np.flatnonzero(vocabulary.parent == node)
        far = np.count_nonzero(np.unpackbits(vocabulary.descriptor[children], axis=1) != bits, axis=1)
        child = int(children[np.argmin(far)])
        if vocabulary.is_leaf[child]:
            return child, int(far.min())
        node = child + 1


def test_every_training_descriptor_finds_a_word_near_it(trained):
    vocabulary, descriptors = trained
    far = [descend(vocabulary, descriptor)[1] for descriptor in descriptors[::7]]
    assert np.mean(far) < 8.0  # six of 256 bits are noise, unrelated descriptors differ in 128


def test_weights_are_the_inverse_document_frequency_by_hand():
    rng = np.random.default_rng(2)
    a, b = rng.integers(0, 256, (2, 32), dtype=np.uint8)
    vocabulary = train(np.array([a, a, b, a]), np.array([0, 1, 1, 3], dtype=np.int32), rng, branching=3, depth=2)
    assert vocabulary.is_leaf.all()
    weight = {bytes(d): w for d, w in zip(vocabulary.descriptor, vocabulary.weight, strict=True)}
    assert_allclose([weight[a.tobytes()], weight[b.tobytes()]], np.log([4 / 3, 4 / 1]))


@settings(max_examples=20, deadline=None)
@given(count=st.integers(1, 60), copies=st.integers(1, 4), branching=st.integers(2, 5), depth=st.integers(1, 4))
def test_any_descriptors_make_a_sound_tree(count, copies, branching, depth):
    rng = np.random.default_rng(count)
    descriptors = np.repeat(rng.integers(0, 256, (count, 32), dtype=np.uint8), copies, axis=0)
    vocabulary = train(descriptors, np.arange(len(descriptors), dtype=np.int32), rng, branching, depth)
    assert np.isin(np.flatnonzero(~vocabulary.is_leaf) + 1, vocabulary.parent).all()
    assert vocabulary.is_leaf.any()
    level = np.zeros(len(vocabulary.parent) + 1, dtype=int)
    for number, parent in enumerate(vocabulary.parent, start=1):
        level[number] = level[parent] + 1
    assert level.max() <= depth


def test_training_is_deterministic():
    descriptors, image = clustered_descriptors(10, 20, np.random.default_rng(3))
    texts = {to_text(train(descriptors, image, np.random.default_rng(4), 4, 3)) for _ in range(2)}
    assert len(texts) == 1


def test_descriptors_know_their_frame():
    rng = np.random.default_rng(5)
    flat = np.full((120, 160, 3), 90, dtype=np.uint8)
    noisy = np.repeat(np.repeat(rng.integers(0, 256, (30, 40, 3), dtype=np.uint8), 4, axis=0), 4, axis=1)
    descriptors, image = orb_descriptors([noisy, flat, noisy])
    assert descriptors.shape[1] == 32
    assert set(image.tolist()) == {0, 2}
    with pytest.raises(HippodromeError, match="no training frame"):
        orb_descriptors([flat])


def test_settings_describe_the_camera():
    lines = dict(line.split(": ", 1) for line in settings_text(CAMERA).splitlines()[1:])
    assert settings_text(CAMERA).startswith("%YAML:1.0\n")
    assert float(lines["Camera.fx"]) == pytest.approx(320.0)  # 90 deg over 640 pixels
    assert float(lines["Camera.bf"]) == pytest.approx(160.0)
    assert float(lines["Camera.cx"]) == pytest.approx(319.5)
    assert lines["Camera.type"] == '"PinHole"'
    assert "File.version" not in lines
    assert lines["System.SaveAtlasToFile"] == '"atlas"'
    assert {"Viewer.KeyFrameSize", "Viewer.ViewpointF", "ThDepth", "ORBextractor.minThFAST"} <= set(lines)


def test_a_single_camera_has_no_stereo_settings():
    with pytest.raises(HippodromeError, match="baseline"):
        settings_text(CameraSpec())
