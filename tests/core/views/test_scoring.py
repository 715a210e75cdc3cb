"""Scores: what they ignore (light, small yaw), what they keep (the place), and that they are the formula they claim to be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.types import ViewCells
from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.scoring import (
    QueryMean,
    bank_of,
    best_over_shifts,
    make_bank,
    score,
    start_query_mean,
    template_mean,
    update_query_mean,
)
from tests.core.views.skyline import panorama

KINDS = ["gradient", "grey"]


def frames_along(image, count, step):
    return [image[:, i * step : i * step + 160] for i in range(count)]


def bank_and_mean(frames, config):
    templates = np.stack([describe(frame, config) for frame in frames])
    mean = template_mean(config.kind, templates)
    return make_bank(config.kind, config.shape, templates, mean), start_query_mean(mean, count=100)


@pytest.mark.parametrize("kind", KINDS)
def test_every_view_finds_itself_among_all(kind):
    config = ViewCellConfig(kind=kind)
    frames = frames_along(panorama(0), 90, 40)
    bank, mean = bank_and_mean(frames, config)
    for index in range(0, 90, 7):
        best, shift = best_over_shifts(score(bank, bank.templates[index], mean, config), config.max_shift)
        assert best.argmax() == index
        assert shift[index] == 0


def test_the_gradient_score_is_the_cosine_of_mean_free_descriptors():
    config = ViewCellConfig()
    frames = frames_along(panorama(1), 40, 50)
    bank, mean = bank_and_mean(frames, config)
    query = bank.templates[4] - mean.mean
    stored = bank.templates - bank.mean
    expected = stored @ query / (np.linalg.norm(stored, axis=1) * np.linalg.norm(query))
    assert_allclose(score(bank, bank.templates[4], mean, config)[:, config.max_shift], expected, atol=2e-3)


def test_the_grey_score_is_the_mean_absolute_difference_over_the_overlap():
    config = ViewCellConfig(kind="grey", grey_px=(2, 4), grey_shift=1)
    stored = np.array([[[1, 2, 3, 4], [5, 6, 7, 8]]], dtype=np.uint8)
    query = np.array([[2, 3, 4, 9], [6, 7, 8, 9]], dtype=np.uint8)
    bank = make_bank("grey", config.shape, stored.transpose(0, 2, 1).reshape(1, -1), np.zeros(8, dtype=np.float32))
    zero = QueryMean(np.zeros(8, dtype=np.float32), 0)
    scores = score(bank, query.T.ravel(), zero, config)
    assert_allclose(scores, [[-np.mean([2, 2, 6, 2, 2, 2]), -np.mean([1, 1, 1, 5, 1, 1, 1, 1]), 0.0]])


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_yaw_is_found_as_a_shift_to_the_same_side(kind):
    config = ViewCellConfig(kind=kind)
    image = panorama(2)
    frames = frames_along(image, 60, 60)
    bank, mean = bank_and_mean(frames, config)
    turned_right = image[:, 30 * 60 + 10 : 30 * 60 + 170]  # the scene moves 10 px to the left: one gradient cell
    best, shift = best_over_shifts(score(bank, describe(turned_right, config), mean, config), config.max_shift)
    assert best.argmax() == 30
    assert shift[30] > 0


def test_gradient_survives_what_light_does_to_a_frame_better_than_grey():
    image = panorama(4)
    frames = frames_along(image, 90, 40)
    dim = [np.clip(255 * (frame / 255.0) ** 1.4 * 0.6, 0, 255).astype(np.uint8) for frame in frames]
    inverted = [255 - frame for frame in frames]  # lit faces swap: the extreme of an opposite sun
    right = {}
    for kind in KINDS:
        config = ViewCellConfig(kind=kind)
        bank, mean = bank_and_mean(frames, config)
        for name, changed in (("dim", dim), ("inverted", inverted)):
            hits = [
                best_over_shifts(score(bank, describe(f, config), mean, config), config.max_shift)[0].argmax() for f in changed
            ]
            right[kind, name] = np.mean(np.array(hits) == np.arange(90))
    assert right["gradient", "dim"] == 1.0
    assert right["gradient", "inverted"] == 1.0
    assert right["grey", "inverted"] < 0.5


def test_the_running_mean_is_an_average_and_then_forgets():
    config = ViewCellConfig(mean_horizon=4)
    state = start_query_mean(np.zeros(2, dtype=np.float32))
    for value in (1, 2, 3):
        state = update_query_mean(state, np.full(2, value, dtype=np.int8), config)
    assert_allclose(state.mean, 2.0)
    for _ in range(60):
        state = update_query_mean(state, np.full(2, 9, dtype=np.int8), config)
    assert_allclose(state.mean, 9.0, atol=1e-4)


def test_the_subtracted_mean_removes_what_every_view_shares():
    config = ViewCellConfig()
    image = panorama(5)
    image[60:90] = (np.arange(4000) // 8 % 2 * 200).astype(np.uint8)  # a fence along the whole road
    frames = frames_along(image, 80, 48)
    bank, mean = bank_and_mean(frames, config)
    blind = make_bank("gradient", config.shape, bank.templates, np.zeros_like(bank.mean))
    none = start_query_mean(np.zeros_like(bank.mean))

    def contrast(some_bank, some_mean):
        best = best_over_shifts(score(some_bank, bank.templates[40], some_mean, config), 1)[0]
        return best[40] - np.median(best)

    assert contrast(bank, mean) > 2.0 * contrast(blind, none)


def test_a_map_without_views_scores_nothing():
    config = ViewCellConfig()
    templates = np.zeros((0, 1024), dtype=np.int8)
    bank = bank_of(ViewCells("gradient", templates, template_mean("gradient", templates), config.shape))
    zero = start_query_mean(np.zeros(1024, dtype=np.float32))
    best, shift = best_over_shifts(score(bank, np.zeros(1024, dtype=np.int8), zero, config), 1)
    assert best.shape == shift.shape == (0,)
